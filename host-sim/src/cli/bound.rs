//! `host-sim bound`: the least time that any control can take.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use crate::design::paper;
use crate::drive::PlantFile;
use crate::error::{Error, Result};
use crate::output::print;
use crate::report::bound::{json, text};
use crate::simulate::bound::bound;
use crate::simulate::scenario::{SCENARIOS, Scenario};
use clap::Args;
use std::path::PathBuf;

/// Say how fast any control could be: the least time to settle and to come to rest.
///
/// By linear programmes, for the current limit of the drive file, without friction and forces from outside.
/// `simulate` and `compare` print beside each settling time how many times this it is.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
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

/// Shortest and longest distance, m.
const DISTANCES: (f64, f64) = (1e-9, 1e6);

impl BoundCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let drive = self.drive.load()?;
        let plant = match &self.plant {
            None => PlantFile::from(&drive),
            Some(path) => PlantFile::load(path)?,
        };
        plant.require_fit(&drive)?;
        let (shortest, longest) = DISTANCES;
        if !(shortest..=longest).contains(&self.distance.abs()) {
            let unit = drive.kind.units().position;
            let rule = format!("must be from {shortest:e} to {longest:e} {unit}");
            return Err(Error::parameter("distance", self.distance, rule));
        }
        let step = Scenario {
            target: self.distance,
            ..SCENARIOS[0]
        };
        let progress = Progress::new(quiet, "bound");
        let found = bound(&drive, &plant, &step);
        drop(progress);
        let found = found.map_err(|why| Error::Bound(why.to_string()))?;
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
