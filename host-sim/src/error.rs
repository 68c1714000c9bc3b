//! Errors as the user sees them: one sentence each, and the exit code that goes with it.

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
    /// The command line asks for something that cannot be done.
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
}

impl Error {
    /// 2 for what the user can correct in command line or files, 1 for a failed run.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Input { .. } | Error::Usage(_) | Error::Read { .. } => 2,
            Error::Write { .. }
            | Error::Design(_)
            | Error::Identification(_)
            | Error::Simulation(_) => 1,
        }
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
