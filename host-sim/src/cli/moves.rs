//! `host-sim moves`: how moves go on plants that differ from the drive file.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use crate::compare::moves::{Task, campaign, with_friction};
use crate::design::Design;
use crate::design::assessment::require_sound;
use crate::design::paper;
use crate::error::{Error, Result};
use crate::output::print;
use crate::report::moves;
use clap::Args;

/// Try planned moves on plants drawn around the drive, beside the raw step and other laws.
///
/// Three sets of plants: the drive itself; what an identification leaves open (springs, last load and force constant
/// +-2 %, friction +-15 %); what a data sheet leaves open (+-5 %, +-10 %, +-3 %, +-30 %). For each law and set:
/// settling to 2 % and to the tolerance, over the bound of each plant, residual vibration, offset, peak current,
/// and how many plants it does not settle or hunts on. Where the drive file states no friction, 0.2/12 of the
/// motor's largest force is taken, for plants and feed-forward alike.
#[derive(Debug, Args)]
pub(super) struct MovesCommand {
    #[command(flatten)]
    drive: DriveArgument,
    /// How far, from rest to rest.
    #[arg(long, value_name = "M", default_value_t = paper::STEP)]
    distance: f64,
    /// How many plants are drawn for each set.
    #[arg(long, value_name = "N", default_value_t = 150,
          value_parser = clap::value_parser!(u32).range(1..=100_000))]
    plants: u32,
    /// What is drawn follows from this.
    #[arg(long, value_name = "S", default_value_t = 1, value_parser = super::not_negative::<u64>)]
    seed: u64,
    /// Evaluations for each rival that is tuned, 20 at the least.
    #[arg(long, value_name = "N", default_value_t = 400,
          value_parser = clap::value_parser!(u32).range(20..=1_000_000))]
    evaluations: u32,
    /// Print the figures as JSON, SI units.
    #[arg(long)]
    json: bool,
}

/// Longest distance, m.
const LONGEST: f64 = 1e6;

impl MovesCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let progress = Progress::new(quiet, "design");
        let stated = self.drive.load()?;
        let shortest = stated.encoder.resolution;
        if !(shortest..=LONGEST).contains(&self.distance.abs()) {
            let unit = stated.kind.units().position;
            let rule = format!(
                "must be from a count of the encoder ({shortest:e} {unit}) to {LONGEST:e} {unit}"
            );
            return Err(Error::parameter("distance", self.distance, rule));
        }
        let design = Design::new(&with_friction(&stated))?;
        require_sound(&design)?;
        let task = Task {
            distance: self.distance,
            plants: self.plants as usize,
            seed: self.seed,
            evaluations: self.evaluations as usize,
        };
        let assumed = stated.friction.coulomb == 0.0;
        let found = campaign(&design, assumed, &task, &|done, of, what| {
            progress.step(done, of, what);
        })?;
        drop(progress);
        if self.json {
            return print(&format!("{:#}\n", moves::json(&design, &found)));
        }
        if quiet {
            return Ok(());
        }
        print(&format!(
            "drive: {}\n{}",
            self.drive.shown(),
            moves::text(&design, &found)
        ))
    }
}
