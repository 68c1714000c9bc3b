//! `host-sim tune`: gain, observer and plans for a drive that is not known better than a set of plants.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use super::records::DescribedDrive;
use crate::compare::robust::{Known, Ranges, Task, drive_file, tune};
use crate::design::Design;
use crate::design::assessment::require_sound;
use crate::design::paper;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::output::{Unfinished, print};
use crate::report::tune as report;
use crate::simulate::scenario::Approach;
use crate::simulate::sequence::require_within_travel;
use arso_core::Place;
use clap::{Args, ValueEnum};
use std::io::Write;
use std::path::PathBuf;

/// Tune a drive for plants that are not known better than a set of them.
///
/// The feedback gain itself is searched (two entries for each mass), with the noise densities of the observer and the
/// share of the current limit that planned moves use, on plants drawn from the set: least mean settling time to 1, 1.4,
/// 2 and 2.8 %, half over all plants and half over the worst quarter. Beside it PD laws, tuned by the same search on the same
/// plants. All are then judged on plants that no tuning saw. With `--toml` the drive file is written with what was
/// found, its `[cost]` replaced by `[gain]`.
#[derive(Debug, Args)]
pub(super) struct TuneCommand {
    #[command(flatten)]
    drive: DriveArgument,
    /// How well the drive is known; the following options change what that means.
    #[arg(long, value_enum, default_value_t = Set::Wide)]
    set: Set,
    /// Factors of all springs.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true)]
    stiffness: Option<Range>,
    /// Factors of the last load's mass.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true)]
    last_load: Option<Range>,
    /// Factors of the force constant.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true)]
    force_constant: Option<Range>,
    /// Coulomb friction, N.
    #[arg(long, value_name = "LOW:HIGH", allow_hyphen_values = true)]
    friction: Option<Range>,
    /// Go by a raw step of the reference instead of a planned move.
    #[arg(long)]
    step: bool,
    /// How far, from rest to rest.
    #[arg(long, value_name = "M", default_value_t = paper::STEP)]
    distance: f64,
    /// Evaluations for each law, 20 at the least.
    #[arg(long, value_name = "N", default_value_t = 1200,
          value_parser = clap::value_parser!(u32).range(20..=1_000_000))]
    evaluations: u32,
    /// On how many plants each evaluation is made.
    #[arg(long, value_name = "N", default_value_t = 24,
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    tuned_on: u32,
    /// On how many others the laws are judged.
    #[arg(long, value_name = "N", default_value_t = 150,
          value_parser = clap::value_parser!(u32).range(1..=100_000))]
    plants: u32,
    /// What is drawn follows from this.
    #[arg(long, value_name = "S", default_value_t = 1, value_parser = super::not_negative::<u64>)]
    seed: u64,
    /// Write the drive file with the tuned gain, observer and plans.
    #[arg(long, value_name = "PATH")]
    toml: Option<PathBuf>,
    /// Print the figures as JSON, SI units.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Set {
    /// Springs +-30 %, last load 0 to +50 %, force constant +-10 %, friction 0 to what the file states, or to 1.55 % of
    /// the motor's force.
    Wide,
    /// +-5 %, +-10 %, +-3 %, the file's friction +-30 %.
    Rough,
    /// +-2 %, +-2 %, +-2 %, the file's friction +-15 %.
    Identified,
}

/// Lower and upper end.
#[derive(Clone, Copy, Debug)]
struct Range([f64; 2]);

impl std::str::FromStr for Range {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (low, high) = text.split_once(':').unwrap_or((text, text));
        match (low.trim().parse(), high.trim().parse()) {
            (Ok(low), Ok(high)) => Ok(Self([low, high])),
            _ => Err("must be two numbers, such as 0.7:1.3".into()),
        }
    }
}

/// Longest distance, m; smallest and largest factor, and most friction over the motor's force.
const LONGEST: f64 = 1e6;
const FACTORS: [f64; 2] = [0.1, 10.0];
const FRICTION: f64 = 0.5;

impl TuneCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let progress = Progress::new(quiet, "design");
        let file = DescribedDrive::load(self.drive.path())?;
        let stated = &file.drive;
        let shortest = stated.encoder.resolution;
        if !(shortest..=LONGEST).contains(&self.distance.abs()) {
            let unit = stated.kind.units().position;
            let rule = format!(
                "must be from a count of the encoder ({shortest:e} {unit}) to {LONGEST:e} {unit}"
            );
            return Err(Error::parameter("distance", self.distance, rule));
        }
        let task = Task {
            approach: if self.step {
                Approach::Step
            } else {
                Approach::Move
            },
            distance: self.distance,
            ranges: self.ranges(stated)?,
            tuned_on: self.tuned_on as usize,
            judged_on: self.plants as usize,
            seed: self.seed,
            evaluations: self.evaluations as usize,
        };
        let design = Design::new(stated)?;
        require_sound(&design)?;
        let place = Place((self.distance / shortest).round() as i64);
        require_within_travel("distance", &design, self.distance, place)?;
        // What cannot be written is said before the work.
        let written = self.toml.as_deref().map(Unfinished::create).transpose()?;
        let found = tune(&design, &task, &|done, of, what| {
            progress.step(done, of, what);
        })?;
        drop(progress);
        if let (Some(mut written), Some(path)) = (written, &self.toml) {
            let text = drive_file(&file.text, &found.drive)?;
            let failed = written
                .write_all(text.as_bytes())
                .map_err(Error::write(path));
            failed.and_then(|()| written.finish())?;
        }
        if self.json {
            return print(&format!("{:#}\n", report::json(&design, &task, &found)));
        }
        if quiet {
            return Ok(());
        }
        let mut text = format!(
            "drive: {}\n{}",
            file.shown(),
            report::text(&design, &task, &found)
        );
        if let Some(path) = &self.toml {
            text += &format!("Drive file: {}\n", path.display());
        }
        print(&text)
    }

    /// The set, with the ranges that are given instead.
    fn ranges(&self, drive: &Drive) -> Result<Ranges> {
        let known = match self.set {
            Set::Wide => Known::Wide,
            Set::Rough => Known::Rough,
            Set::Identified => Known::Identified,
        };
        let friction = self.friction.map(|Range(friction)| friction);
        let mut ranges = Ranges::of(drive, known, friction)?;
        let force = drive.actuator.largest_force();
        let newtons = [0.0, FRICTION * force];
        let given = [
            ("stiffness", self.stiffness, &mut ranges.stiffness, FACTORS),
            ("last-load", self.last_load, &mut ranges.last_load, FACTORS),
            (
                "force-constant",
                self.force_constant,
                &mut ranges.force_constant,
                FACTORS,
            ),
            ("friction", self.friction, &mut ranges.friction, newtons),
        ];
        for (name, given, range, [least, most]) in given {
            let Some(Range([low, high])) = given else {
                continue;
            };
            if !(least <= low && low <= high && high <= most) {
                let unit = if name == "friction" {
                    drive.kind.units().force
                } else {
                    "times what the file states"
                };
                let rule = format!("must rise, from {least} to {most} {unit} at most");
                return Err(Error::parameter(name, format!("{low}:{high}"), rule));
            }
            *range = [low, high];
        }
        Ok(ranges)
    }
}
