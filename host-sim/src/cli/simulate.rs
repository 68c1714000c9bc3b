//! `host-sim simulate`: experiments in closed loop, the core beside feedback of the true state.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use crate::design::Design;
use crate::design::assessment::require_sound;
use crate::drive::PlantFile;
use crate::error::{Error, Result};
use crate::output::{print, write_file};
use crate::report::{csv::csv, design, experiments, run};
use crate::simulate::bound::bound;
use crate::simulate::scenario::{SCENARIOS, Scenario, of_the_paper};
use crate::simulate::watch::watched;
use crate::simulate::{Law, Run, simulate};
use clap::Args;
use clap::builder::PossibleValuesParser;
use std::path::PathBuf;

/// Simulate experiments on a drive.
#[derive(Debug, Args)]
pub(super) struct Simulate {
    #[command(flatten)]
    drive: DriveArgument,
    /// Experiment to simulate, may be given several times; the paper's four when not given.
    #[arg(long, value_name = "NAME", value_parser = scenario_names())]
    scenario: Vec<String>,
    /// What is really there, when it differs from what the drive file says.
    #[arg(long, value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// Length of each experiment, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.2, value_parser = seconds)]
    duration: f64,
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

/// Longest experiment, in control periods: every one is kept.
const LONGEST: f64 = 1e6;

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
        if self.duration / drive.control.sample_time < 2.0 {
            return Err(Error::Usage(format!(
                "--duration {}: must be two control periods of {} s at least",
                self.duration, drive.control.sample_time
            )));
        }
        if self.duration / drive.control.sample_time > LONGEST {
            return Err(Error::Usage(format!(
                "--duration {}: must be {LONGEST} control periods of {} s at most",
                self.duration, drive.control.sample_time
            )));
        }
        let scenarios: Vec<&Scenario> = if self.scenario.is_empty() {
            of_the_paper().iter().collect()
        } else {
            self.scenario
                .iter()
                .filter_map(|name| Scenario::named(name))
                .collect()
        };
        if self.csv && scenarios.len() != 1 {
            return Err(Error::Usage(
                "--csv prints one experiment: name it with --scenario".into(),
            ));
        }
        let design = Design::new(&drive)?;
        require_sound(&design)?;
        if let (true, [scenario]) = (self.csv, &scenarios[..]) {
            progress.step(0, 1, scenario.name);
            let run = simulate(&design, &plant, scenario, Law::Core, self.duration)?;
            let text = csv(&run)?;
            drop(progress);
            print(&String::from_utf8_lossy(&text))?;
            return require_no_fault([&run]);
        }

        let mut runs: Vec<experiments::Judged> = Vec::new();
        let mut files = Vec::new();
        for (done, scenario) in scenarios.iter().enumerate() {
            progress.step(done, scenarios.len(), scenario.name);
            let of = |law| watched(&design, &plant, scenario, law, self.duration);
            let ((core, metrics), (full_state, metrics_of_full_state)) =
                (of(Law::Core)?, of(Law::FullState)?);
            let bound = bound(&drive, &plant, scenario);
            for (name, content) in [
                (
                    format!("{}.svg", scenario.name),
                    run::plot(&core, &full_state, drive.actuator.current_limit)?.into_bytes(),
                ),
                (format!("{}.csv", scenario.name), csv(&core)?),
                (
                    format!("{}-full-state.csv", scenario.name),
                    csv(&full_state)?,
                ),
            ] {
                let path = self.out.join(name);
                write_file(&path, &content)?;
                files.push(path.display().to_string());
            }
            runs.extend([
                (core, metrics, bound.clone()),
                (full_state, metrics_of_full_state, bound),
            ]);
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
        require_no_fault(runs.iter().map(|(run, ..)| run))
    }
}

/// A run in which the drive stopped itself is a failed run, after its figures have been shown.
fn require_no_fault<'a>(runs: impl IntoIterator<Item = &'a Run>) -> Result<()> {
    for run in runs {
        if let Some((time, fault)) = run.fault {
            return Err(Error::Fault {
                experiment: run.scenario.name,
                time,
                number: fault.number(),
                fault: format!("{fault:?}"),
            });
        }
    }
    Ok(())
}
