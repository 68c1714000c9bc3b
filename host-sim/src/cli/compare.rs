//! `host-sim compare`: the drive beside its rivals.

use crate::compare::{compare, require_comparable};
use crate::design::Design;
use crate::design::assessment::require_sound;
use crate::drive::{DEFAULT_NAME, Drive};
use crate::error::Result;
use crate::output::print;
use crate::report::comparison;
use clap::Args;
use std::path::PathBuf;

/// Set the drive beside its rivals, on plants that differ.
///
/// The rivals are tuned in the same run for the least worst settling time over the plants whose springs,
/// last load and force constant differ: collocated PD alone and with ZV, ZVD and EI shapers, and a Kalman
/// filter on the encoder, which is tuned on the plant with friction as well. Only that one has Coulomb
/// friction. Feedback of the true state is the bound of the drive's gain without friction.
#[derive(Debug, Args)]
pub(super) struct CompareCommand {
    /// Description of the drive; the paper's rig when not given.
    drive: Option<PathBuf>,
    /// Print the figures as JSON, SI units.
    #[arg(long)]
    json: bool,
}

impl CompareCommand {
    pub(super) fn run(self) -> Result<()> {
        let drive = Drive::load(self.drive.as_deref())?;
        let design = Design::new(&drive)?;
        require_comparable(&design)?;
        require_sound(&design)?;
        let rows = compare(&design)?;
        if self.json {
            return print(&format!("{:#}\n", comparison::json(&design, &rows)));
        }
        let name = self.drive.as_ref().map(|path| path.display().to_string());
        print(&format!(
            "drive: {}\n{}",
            name.unwrap_or(DEFAULT_NAME.into()),
            comparison::text(&design, &rows)
        ))
    }
}
