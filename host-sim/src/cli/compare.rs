//! `host-sim compare`: the drive beside its rivals.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use crate::compare::{Effort, bounds, compare, require_comparable};
use crate::design::Design;
use crate::design::assessment::require_sound;
use crate::error::Result;
use crate::output::{print, write_file};
use crate::report::comparison;
use clap::Args;
use std::path::PathBuf;

/// Set the drive beside its rivals, on plants that differ.
///
/// The rivals are tuned in the same run, all by the same search with the same number of evaluations, for the
/// least worst settling time over the plants whose springs, last load and force constant differ: collocated PD
/// alone, with a notch, with a disturbance observer, and with ZV, ZVD, EI and MZV shapers; a Kalman filter
/// on the encoder; and the drive's own law with other weights. Those that can remove friction are tuned on
/// the plant with friction as well. The drive itself is taken as designed, and once more as the same gain on
/// the true state. Every settling time stands beside the bound of its plant: the least time any control can
/// take. A second table shows all of them on plants drawn at random, without bounds; a third all of them by planned
/// moves, on the drive's own plan and with its friction fed forward.
#[derive(Debug, Args)]
pub(super) struct CompareCommand {
    #[command(flatten)]
    drive: DriveArgument,
    /// Draw settling times and overshoots of all laws on all plants, as SVG.
    #[arg(long, value_name = "PATH")]
    plot: Option<PathBuf>,
    /// Evaluations for each law that is tuned, 20 at the least.
    #[arg(long, value_name = "N", default_value_t = Effort::default().evaluations as u32,
          value_parser = clap::value_parser!(u32).range(20..=1_000_000))]
    evaluations: u32,
    /// How many plants are drawn at random.
    #[arg(long, value_name = "N", default_value_t = Effort::default().plants as u32,
          value_parser = clap::value_parser!(u32).range(0..=100_000))]
    plants: u32,
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
        let effort = Effort {
            evaluations: self.evaluations as usize,
            plants: self.plants as usize,
        };
        let found = compare(&design, effort, &|done, of, what| {
            progress.step(done, of, what);
        })?;
        let bounds = bounds(&design);
        drop(progress);
        if let Some(path) = &self.plot {
            write_file(path, comparison::plot(&design, &found.steps)?.as_bytes())?;
        }
        if self.json {
            return print(&format!(
                "{:#}\n",
                comparison::json(&design, &found, &bounds)
            ));
        }
        if quiet {
            return Ok(());
        }
        let mut text = format!(
            "drive: {}\n{}",
            self.drive.shown(),
            comparison::text(&design, &found, &bounds, effort)
        );
        if let Some(path) = &self.plot {
            text += &format!("plot written to {}\n", path.display());
        }
        print(&text)
    }
}
