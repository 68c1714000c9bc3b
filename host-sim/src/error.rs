//! Errors as the user sees them: one sentence each, and the exit code that goes with it.
//!
//! A sentence here names parameters by their own names, in backticks; which flag of the command line
//! sets a parameter is known to `cli` alone, which words the sentence for its user.

use std::path::{Path, PathBuf};

/// Everything that can end the program early.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file given by the user says something that cannot be used.
    #[error("{place}: {message}")]
    Input {
        /// `file:line` as far as known.
        place: String,
        /// Key, value, what is wrong with it and what is allowed.
        message: String,
    },
    /// A drive file says what only a plant file can say.
    #[error("{place}: {what} belongs into a plant file")]
    PlantOnly {
        /// `file:line`.
        place: String,
        /// The table or key.
        what: &'static str,
    },
    /// A parameter has a value that cannot be used.
    #[error("{}: {rule}", named(parameter, values))]
    Parameter {
        /// Its name.
        parameter: &'static str,
        /// Its value; several where it was given several times.
        values: Vec<String>,
        /// What it must be, or what it leads to.
        rule: String,
    },
    /// What is asked for cannot be done.
    #[error("{0}")]
    Usage(String),
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file cannot be written; what stood there before is still there.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The drive is described well, but no gains exist for it.
    #[error("no gains can be designed for this drive: {0}")]
    Design(String),
    /// The log is readable, but does not say what was asked of it.
    #[error("nothing was identified: {0}")]
    Identification(String),
    /// The simulation left what can be computed.
    #[error("the simulation failed: {0}")]
    Simulation(String),
    /// The drive stopped itself in a run.
    #[error("in {experiment} the drive stopped after {time:.3} s with fault {number} ({fault})")]
    Fault {
        /// In which experiment.
        experiment: &'static str,
        /// When, s.
        time: f64,
        /// Number of the fault.
        number: u8,
        /// Its name.
        fault: String,
    },
    /// The drive cannot be set beside its rivals.
    #[error("nothing was compared: {0}")]
    Comparison(String),
    /// The sweep is not complete.
    #[error("the sweep is not complete: {0}")]
    Sweep(String),
    /// No least time of a motion can be found.
    #[error("no bound was found: {0}")]
    Bound(String),
    /// There is no log, or nothing in it.
    #[error("nothing was captured: {0}")]
    Capture(String),
    /// A drive that is connected cannot be spoken to.
    #[error("the link failed: {0}")]
    Link(String),
    /// A drive that is connected does not take a request.
    #[error("the drive refuses: {0}")]
    Refused(arso_core::Refusal),
    /// A drive that is connected did not do, or not end, what was asked of it.
    #[error("{0}")]
    Drive(String),
    /// A table, a file or a plot cannot be formed from what was computed.
    #[error("the report cannot be formed: {0}")]
    Report(String),
}

/// A parameter and its values as a sentence begins with them.
fn named(parameter: &str, values: &[String]) -> String {
    let each = values.iter().map(|value| format!("`{parameter}` {value}"));
    each.collect::<Vec<_>>().join(" ")
}

/// An equation that has no solution, or none that can be computed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NoSolution(pub String);

impl From<NoSolution> for Error {
    fn from(NoSolution(why): NoSolution) -> Self {
        Error::Design(why)
    }
}

impl Error {
    /// 2 for what the user can correct in command line or files, 1 for a failed run.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Input { .. }
            | Error::PlantOnly { .. }
            | Error::Parameter { .. }
            | Error::Usage(_)
            | Error::Read { .. } => 2,
            Error::Write { .. }
            | Error::Design(_)
            | Error::Identification(_)
            | Error::Simulation(_)
            | Error::Fault { .. }
            | Error::Comparison(_)
            | Error::Sweep(_)
            | Error::Bound(_)
            | Error::Capture(_)
            | Error::Link(_)
            | Error::Refused(_)
            | Error::Drive(_)
            | Error::Report(_) => 1,
        }
    }

    /// A parameter whose one value cannot be used.
    #[must_use]
    pub fn parameter(
        parameter: &'static str,
        value: impl std::fmt::Display,
        rule: impl Into<String>,
    ) -> Self {
        Error::Parameter {
            parameter,
            values: vec![value.to_string()],
            rule: rule.into(),
        }
    }

    /// For `map_err` on reading what is named so: a path, or words.
    pub fn read(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Error {
        let path = path.into();
        move |source| Error::Read { path, source }
    }

    /// For `map_err` on writing to `path`.
    pub fn write(path: &Path) -> impl Fn(std::io::Error) -> Error + '_ {
        move |source| Error::Write {
            path: path.to_owned(),
            source,
        }
    }
}

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
