//! `host-sim paper`: what the gains printed in the paper do.

use crate::design::paper::grid;
use crate::error::Result;
use crate::output::print;
use crate::report::paper;
use clap::Args;

/// Show what the gains printed in the paper do on plants consistent with its Table I.
#[derive(Debug, Args)]
pub(super) struct PaperCommand {
    /// Print the grid as JSON, SI units.
    #[arg(long)]
    json: bool,
}

impl PaperCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let grid = grid()?;
        if self.json {
            return print(&format!("{:#}\n", paper::json(&grid)));
        }
        if quiet {
            return Ok(());
        }
        print(&paper::tables(&grid))
    }
}
