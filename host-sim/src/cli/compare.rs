//! `host-sim compare`: the drive beside its rivals.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use crate::compare::{bounds, compare, require_comparable};
use crate::design::Design;
use crate::design::assessment::require_sound;
use crate::error::Result;
use crate::output::{print, write_file};
use crate::report::comparison;
use clap::Args;
use std::path::PathBuf;

/// Set the drive beside its rivals, on plants that differ.
///
/// The rivals are tuned in the same run for the least worst settling time over the plants whose springs,
/// last load and force constant differ: collocated PD alone and with ZV, ZVD and EI shapers, and a Kalman
/// filter on the encoder, which is tuned on the plant with friction as well. Only that one has Coulomb
/// friction. Every settling time stands beside the bound of its plant: the least time any control can take. Feedback of the true state is the bound of the drive's gain without friction.
#[derive(Debug, Args)]
pub(super) struct CompareCommand {
    #[command(flatten)]
    drive: DriveArgument,
    /// Draw settling times and overshoots of all laws on all plants, as SVG.
    #[arg(long, value_name = "PATH")]
    plot: Option<PathBuf>,
    /// Print the figures as JSON, SI units.
    #[arg(long)]
    json: bool,
}

impl CompareCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let progress = Progress::new(quiet, "design");
        let design = Design::new(&self.drive.load()?)?;
        require_comparable(&design)?;
        require_sound(&design)?;
        let rows = compare(&design, &|done, of, what| progress.step(done, of, what))?;
        let bounds = bounds(&design);
        drop(progress);
        if let Some(path) = &self.plot {
            write_file(path, comparison::plot(&design, &rows)?.as_bytes())?;
        }
        if self.json {
            return print(&format!(
                "{:#}\n",
                comparison::json(&design, &rows, &bounds)
            ));
        }
        if quiet {
            return Ok(());
        }
        let mut text = format!(
            "drive: {}\n{}",
            self.drive.shown(),
            comparison::text(&design, &rows, &bounds)
        );
        if let Some(path) = &self.plot {
            text += &format!("plot written to {}\n", path.display());
        }
        print(&text)
    }
}
