//! `host-sim simulate`: experiments in closed loop, the core beside feedback of the true state.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use crate::design::Design;
use crate::design::assessment::require_sound;
use crate::drive::PlantFile;
use crate::error::{Error, Result};
use crate::output::{print, write_file};
use crate::report::{csv::csv, design, experiments, run};
use crate::simulate::Run;
use crate::simulate::experiment::{Experiment, Judged, require_duration};
use crate::simulate::scenario::{SCENARIOS, Scenario};
use crate::simulate::sequence::{MoveSequence, whole_counts};
use clap::Args;
use clap::builder::PossibleValuesParser;
use std::path::PathBuf;

/// Simulate experiments on a drive.
#[derive(Debug, Args)]
pub(super) struct Simulate {
    #[command(flatten)]
    drive: DriveArgument,
    /// Experiment to simulate, may be given several times; the paper's four and a planned move when not given.
    #[arg(long, value_name = "NAME", value_parser = scenario_names())]
    scenario: Vec<String>,
    /// Planned move by a distance from the target before, m or rad; several are made one after the other.
    #[arg(
        long = "move",
        value_name = "DISTANCE",
        num_args = 1..,
        conflicts_with = "scenario"
    )]
    moves: Vec<f64>,
    /// When each move is asked for, s, as many times as moves, also while the one before is under way; when not
    /// given the first at 0, each further one 15 periods of the slowest mode after the end of the plan before.
    #[arg(
        long,
        value_name = "TIME",
        num_args = 1..,
        requires = "moves"
    )]
    at: Vec<f64>,
    /// What is really there, when it differs from what the drive file says.
    #[arg(long, value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// Length of each experiment, s; 1.2 when not given, with --move until the last has ended as above.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    duration: Option<f64>,
    /// Where plots and CSV files go.
    #[arg(long, value_name = "DIR", default_value = "target/host-sim")]
    out: PathBuf,
    /// Print the figures as JSON, SI units.
    #[arg(long)]
    json: bool,
    /// Print every step of one experiment as CSV and write no files.
    #[arg(long, conflicts_with = "json")]
    csv: bool,
}

fn scenario_names() -> PossibleValuesParser {
    PossibleValuesParser::new(SCENARIOS.iter().map(|scenario| scenario.name))
}

fn seconds(text: &str) -> std::result::Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.001..=1000.0).contains(&seconds) {
        Ok(seconds)
    } else {
        Err("must be from 0.001 to 1000 s".into())
    }
}

impl Simulate {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let progress = Progress::new(quiet, "design");
        let drive = self.drive.load()?;
        let plant = match &self.plant {
            None => PlantFile::from(&drive),
            Some(path) => PlantFile::load(path)?,
        };
        plant.require_fit(&drive)?;
        self.require_duration(drive.control.sample_time, 0.0)?;
        let design = Design::new(&drive)?;
        require_sound(&design)?;
        let experiments = self.experiments(&design)?;
        if self.csv && experiments.len() != 1 {
            return Err(Error::Usage(
                "--csv prints one experiment: name it with --scenario, or ask for it with --move"
                    .into(),
            ));
        }
        if let (true, [experiment]) = (self.csv, &experiments[..]) {
            progress.step(0, 1, experiment.name());
            let run = experiment.simulate(&design, &plant, self.duration(experiment))?;
            let text = csv(&run)?;
            drop(progress);
            print(&String::from_utf8_lossy(&text))?;
            return run.require_no_fault();
        }

        let mut runs: Vec<Judged> = Vec::new();
        let mut files = Vec::new();
        let mut whole = Vec::new();
        for (done, experiment) in experiments.iter().enumerate() {
            let name = experiment.name();
            progress.step(done, experiments.len(), name);
            let duration = self.duration(experiment);
            let outcome = experiment.judge(&design, &plant, duration)?;
            let (core, full_state) = (outcome.core, outcome.full_state);
            let title = format!("{name}: {}", experiment.title(drive.kind));
            let limit = drive.actuator.current_limit;
            for (name, content) in [
                (
                    format!("{name}.svg"),
                    run::plot(&core, &full_state, &title, &experiment.aims(), limit)?.into_bytes(),
                ),
                (format!("{name}.csv"), csv(&core)?),
                (format!("{name}-full-state.csv"), csv(&full_state)?),
            ] {
                let path = self.out.join(name);
                write_file(&path, &content)?;
                files.push(path.display().to_string());
            }
            runs.extend(outcome.judged);
            whole.extend([core, full_state]);
        }
        drop(progress);
        if self.json {
            let json = experiments::json(&design, &runs, &files);
            print(&format!("{json:#}\n"))?;
        } else if !quiet {
            let mut text = format!("drive: {}", self.drive.shown());
            if let Some(plant) = &self.plant {
                text += &format!(", plant: {}", plant.display());
            }
            text += &format!("\n{}\n", design::tables(&design)?);
            text += &experiments::tables(&design, &runs);
            text += &format!("Plots and CSV of every step: {}\n", self.out.display());
            print(&text)?;
        }
        // A run in which the drive stopped itself is a failed run, after its figures have been shown.
        whole.iter().try_for_each(Run::require_no_fault)
    }

    /// What is to be simulated.
    fn experiments(&self, design: &Design) -> Result<Vec<Experiment>> {
        if !self.moves.is_empty() {
            let sequence = MoveSequence::new(design, &self.moves, &self.at)?;
            self.say_what_is_rounded(design, &sequence);
            let last = sequence.moves().last();
            let period = design.drive.control.sample_time;
            self.require_duration(period, last.map_or(0.0, |last| sequence.time(last)))?;
            return Ok(vec![Experiment::Moves(sequence)]);
        }
        if self.scenario.is_empty() {
            return Ok(SCENARIOS.iter().map(Experiment::Named).collect());
        }
        let named = self
            .scenario
            .iter()
            .filter_map(|name| Scenario::named(name));
        Ok(named.map(Experiment::Named).collect())
    }

    /// A distance that the encoder cannot count out.
    fn say_what_is_rounded(&self, design: &Design, sequence: &MoveSequence) {
        let resolution = design.drive.encoder.resolution;
        for (asked, one) in self.moves.iter().zip(sequence.moves()) {
            if !whole_counts(*asked, resolution) {
                eprintln!(
                    "warning: --move {asked}: no whole number of encoder counts, rounded to {}",
                    (one.distance / resolution).round()
                );
            }
        }
    }

    /// * `last`: when the last move begins, s
    fn require_duration(&self, period: f64, last: f64) -> Result<()> {
        let Some(duration) = self.duration else {
            return Ok(());
        };
        require_duration(duration, period, last)
            .map_err(|rule| Error::Usage(format!("--duration {duration}: {rule}")))
    }

    /// Length of an experiment, s.
    fn duration(&self, experiment: &Experiment) -> f64 {
        self.duration.unwrap_or_else(|| experiment.duration())
    }
}
