//! `host-sim bound`: the least time that any control can take.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use crate::design::paper;
use crate::drive::PlantFile;
use crate::error::Result;
use crate::output::print;
use crate::report::bound::{json, text};
use crate::simulate::bound::step_bound;
use clap::Args;
use std::path::PathBuf;

/// Say how fast any control could be: the least time to settle and to come to rest.
///
/// By linear programmes, for the current limit of the drive file, without friction and forces from outside.
/// `simulate` and `compare` print beside each settling time how many times this it is.
#[derive(Debug, Args)]
pub(super) struct BoundCommand {
    #[command(flatten)]
    drive: DriveArgument,
    /// How far, from rest to rest; the sign is of no account.
    #[arg(long, value_name = "M", default_value_t = paper::STEP)]
    distance: f64,
    /// What is really there, when it differs from what the drive file says.
    #[arg(long, value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// Print both times as JSON, SI units.
    #[arg(long)]
    json: bool,
}

impl BoundCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let drive = self.drive.load()?;
        let plant = match &self.plant {
            None => PlantFile::from(&drive),
            Some(path) => PlantFile::load(path)?,
        };
        let progress = Progress::new(quiet, "bound");
        let found = step_bound(&drive, &plant, self.distance)?;
        drop(progress);
        if self.json {
            let json = json(&drive, &plant, self.distance, &found);
            return print(&format!("{json:#}\n"));
        }
        if quiet {
            return Ok(());
        }
        let mut shown = format!("drive: {}", self.drive.shown());
        if let Some(plant) = &self.plant {
            shown += &format!(", plant: {}", plant.display());
        }
        print(&format!(
            "{shown}\n{}",
            text(&drive, &plant, self.distance, &found)
        ))
    }
}
