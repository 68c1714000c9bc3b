//! `host-sim identify`: masses, springs and friction from a log.

use super::progress::Progress;
use crate::capture::Origin;
use crate::design::Design;
use crate::drive::{DEFAULT_DRIVE, DEFAULT_NAME, Drive};
use crate::error::{Error, Result};
use crate::identify::{Columns, Experiment, Log, Parameters, drive_file, identify};
use crate::output::{print, write_file};
use crate::report::identification;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

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
        let text = match &self.drive {
            None => DEFAULT_DRIVE.to_owned(),
            Some(path) => std::fs::read_to_string(path).map_err(Error::read(path))?,
        };
        let drive = Drive::load(self.drive.as_deref())?;
        let experiment = match self.run {
            RunKind::Excitation => Experiment::Excitation,
            RunKind::Free => Experiment::Free,
            RunKind::Slow => Experiment::Slow,
        };
        let hold = if self.hold.is_empty() {
            vec!["actuator.force_constant".to_owned()]
        } else {
            self.hold
        };
        let parameters = Parameters::new(&drive, experiment, &hold)?;
        let columns = self.column.into_iter();
        let columns = columns.fold(Columns::default(), Columns::with);
        let logs = self
            .log
            .iter()
            .map(|path| Log::load(path, &drive, &columns))
            .collect::<Result<Vec<Log>>>()?;
        for log in &logs {
            require_same_kind(log, &drive, self.drive.as_deref())?;
        }
        let result = {
            let progress = Progress::new(quiet, "frequency response");
            identify(&drive, &logs, &parameters, &|done, of, what| {
                progress.step(done, of, what);
            })?
        };
        if let Some(path) = &self.toml {
            write_file(path, drive_file(&text, &result.quantities)?.as_bytes())?;
        }
        let plot = self.out.join("identification.svg");
        write_file(
            &plot,
            identification::plot(&drive, &result, experiment)?.as_bytes(),
        )?;
        if self.json {
            return print(&format!("{:#}\n", identification::json(&drive, &result)));
        }
        if quiet {
            return Ok(());
        }
        let mut text = identification::table(&drive, &result);
        text += &format!("Residuals: {}\n", plot.display());
        if let Some(path) = &self.toml {
            text += &format!("Drive file: {}\n", path.display());
        }
        print(&text)
    }
}

/// A log of the other kind of drive is refused; whatever else differs is said.
fn require_same_kind(log: &Log, drive: &Drive, file: Option<&Path>) -> Result<()> {
    let Some(mark) = &log.drive else {
        return Ok(());
    };
    let said = Origin::marked(mark, log.period).ok_or_else(|| Error::Input {
        place: log.name.clone(),
        message: format!(
            "drive[name] = \"{mark}\": must be kind, loads and fingerprint as `capture` writes them"
        ),
    })?;
    if said.kind != drive.kind {
        return Err(Error::Usage(format!(
            "the log is of a {} drive, and the drive file describes a {} one",
            said.kind.name(),
            drive.kind.name()
        )));
    }
    // A description for which there are no gains is not that of a drive that ran.
    let Ok(design) = Design::new(drive) else {
        return Ok(());
    };
    let differences = said.differences(&Origin::of(&design)?);
    if !differences.is_empty() {
        let file = file.map(|path| path.display().to_string());
        eprintln!(
            "warning: the log is not of the drive that {} describes: it is of one with {}; what is taken \
             from the file is right only where it holds for that drive too",
            file.unwrap_or(DEFAULT_NAME.into()),
            differences.join(", ")
        );
    }
    Ok(())
}
