//! `host-sim identify`: masses, springs and friction from a log.

use super::records::{DescribedDrive, held_by_default};
use crate::error::Result;
use crate::identify::{Columns, Experiment, Parameters, drive_file};
use crate::output::{print, write_file};
use crate::report::identification;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Identify masses, springs and friction from a log of encoder and current.
///
/// The log is a CSV with the columns `time[s]`, `count[1]` and `applied_current[A]`, as `capture` writes it, or
/// with others that `--column` names; `host-sim excite` writes a current profile to play.
#[derive(Debug, Args)]
pub(super) struct IdentifyCommand {
    /// The log, or several logs of the same machine.
    #[arg(required = true)]
    log: Vec<PathBuf>,
    /// What is known of the drive: its sample time, encoder and limit, and roughly all else; the paper's
    /// rig when not given.
    #[arg(long, value_name = "DRIVE.toml")]
    drive: Option<PathBuf>,
    /// What the log is of.
    #[arg(long, value_enum, default_value_t = RunKind::Excitation)]
    run: RunKind,
    /// Take this from the drive file as known, by its key, such as load[1].mass; may be given several
    /// times. When not given: the force constant.
    #[arg(long, value_name = "KEY")]
    hold: Vec<String>,
    /// Names of the log's columns where they are others: WHAT is time, count, position (instead of count),
    /// current or mode; units in brackets, such as `t[ms]`, are understood.
    #[arg(long, value_name = "WHAT=NAME,…")]
    column: Vec<Columns>,
    /// Write the drive file with the identified values.
    #[arg(long, value_name = "PATH")]
    toml: Option<PathBuf>,
    /// Where the plot goes.
    #[arg(long, value_name = "DIR", default_value = "target/host-sim")]
    out: PathBuf,
    /// Print the figures as JSON, SI units; the plot is drawn all the same.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum RunKind {
    /// The whole chain, excited over all its modes.
    Excitation,
    /// The actuator alone, its load detached: its mass (or force constant) and friction.
    Free,
    /// The whole chain, moved slowly, its loads and springs as in the drive file: the same.
    Slow,
}

impl IdentifyCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let file = DescribedDrive::load(self.drive.as_deref())?;
        let drive = &file.drive;
        let experiment = match self.run {
            RunKind::Excitation => Experiment::Excitation,
            RunKind::Free => Experiment::Free,
            RunKind::Slow => Experiment::Slow,
        };
        let hold = if self.hold.is_empty() {
            held_by_default()
        } else {
            self.hold
        };
        // What cannot be used is said before anything is read.
        Parameters::new(drive, experiment, &hold)?;
        let logs = file.logs(&self.log, &self.column)?;
        let result = file.identified(&logs, experiment, &hold, quiet)?;
        if let Some(path) = &self.toml {
            write_file(path, drive_file(&file.text, &result.quantities)?.as_bytes())?;
        }
        let plot = self.out.join("identification.svg");
        write_file(
            &plot,
            identification::plot(drive, &result, experiment)?.as_bytes(),
        )?;
        if self.json {
            return print(&format!("{:#}\n", identification::json(drive, &result)));
        }
        if quiet {
            return Ok(());
        }
        let mut text = identification::table(drive, &result);
        text += &format!("Residuals: {}\n", plot.display());
        if let Some(path) = &self.toml {
            text += &format!("Drive file: {}\n", path.display());
        }
        print(&text)
    }
}
