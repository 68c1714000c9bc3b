//! The drive file, the same way in every subcommand: the positional argument, or `--drive`. Where something
//! else is positional (the log of `identify`), `--drive` alone.

use crate::drive::{DEFAULT_NAME, Drive};
use crate::error::Result;
use clap::Args;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Which drive.
#[derive(Debug, Args)]
pub(super) struct DriveArgument {
    /// Description of the drive; the paper's rig when not given
    #[arg(value_name = "DRIVE.toml")]
    file: Option<PathBuf>,
    /// The same as DRIVE.toml; every command that knows a drive takes it
    #[arg(long, value_name = "DRIVE.toml", conflicts_with = "file")]
    drive: Option<PathBuf>,
}

impl DriveArgument {
    /// The file, if one is given.
    pub(super) fn path(&self) -> Option<&Path> {
        self.file.as_deref().or(self.drive.as_deref())
    }

    pub(super) fn load(&self) -> Result<Drive> {
        Drive::load(self.path())
    }

    /// The file as it was given.
    pub(super) fn shown(&self) -> String {
        let path = self.path().map(|path| path.display().to_string());
        path.unwrap_or(DEFAULT_NAME.into())
    }

    /// The file without its folder, which says nothing on another machine.
    pub(super) fn name(&self) -> Cow<'_, str> {
        let name = self.path().and_then(Path::file_name);
        name.map_or(DEFAULT_NAME.into(), |name| name.to_string_lossy())
    }
}
