//! `host-sim drive settings`: those that a drive runs with, and others for it.

use super::Ends;
use crate::cli::drive_argument::DriveArgument;
use crate::cli::progress::Progress;
use crate::design::Design;
use crate::design::assessment::Assessment;
use crate::error::Result;
use crate::link::{Connection, Pushed};
use crate::output::print;
use crate::report::link as report;
use crate::simulate::corridor::settings_image;
use clap::{Args, Subcommand};

/// Read the settings that a drive runs with, or send it others.
#[derive(Debug, Args)]
pub(super) struct SettingsCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Say what the drive runs with, and where that is from.
    ///
    /// For example `host-sim drive --port /dev/ttyACM0 settings show`. All values are as the drive has them, SI units;
    /// of the planned moves only how many there are and how far they reach.
    Show,
    /// Design the gains and planned moves of a drive file, and send them.
    ///
    /// For example `host-sim drive --port /dev/ttyACM0 settings push my-drive.toml`. With the amplifier off they are
    /// kept in flash and the drive resets itself: it forgets where zero is, and has to be enabled anew. A drive that
    /// holds its machine takes other gains, limits and friction at once, and keeps them until its reset only.
    Push(DriveArgument),
    /// Let the drive go back to the settings that are compiled into its firmware.
    ///
    /// For example `host-sim drive --port /dev/ttyACM0 settings forget`, after new firmware was flashed: what was pushed
    /// comes first otherwise. The amplifier must be off, and the drive resets itself.
    Forget,
}

impl SettingsCommand {
    /// The set that is to be sent, if one is.
    pub(super) fn set(&self, quiet: bool) -> Result<Option<Vec<u8>>> {
        let Action::Push(drive) = &self.action else {
            return Ok(None);
        };
        let progress = Progress::new(quiet, "design");
        let design = Design::new(&drive.load()?)?;
        Assessment::new(&design)?.require_sound()?;
        let set = settings_image(&design);
        drop(progress);
        set.map(Some)
    }

    /// * `set`: what is to be sent, see [`set`](Self::set)
    pub(super) fn run(&self, ends: &mut Ends, set: Option<&[u8]>) -> Result<()> {
        match (set, &self.action) {
            (Some(set), _) => push(ends, set),
            (None, Action::Forget) => forget(ends),
            (None, _) => show(ends),
        }
    }
}

fn push(ends: &mut Ends, set: &[u8]) -> Result<()> {
    let progress = Progress::new(ends.quiet, "settings");
    let pushed = ends
        .drive
        .push(set, |done, of| progress.step(done, of, "bytes"));
    drop(progress);
    ends.say(
        match pushed? {
            Pushed::Known => "the drive has these settings already",
            Pushed::Kept => "the drive keeps the settings and has begun anew with them",
            Pushed::Changed => {
                "the drive runs with the settings until its reset; to keep them, push them once more when it is disabled"
            }
        },
        None,
    )
}

fn forget(ends: &mut Ends) -> Result<()> {
    let said = if ends.drive.forget_settings()? {
        "the drive has begun anew with the settings of its firmware"
    } else {
        "the drive runs with the settings of its firmware already"
    };
    ends.say(said, None)
}

fn show(ends: &mut Ends) -> Result<()> {
    let status = ends.drive.status()?;
    let (header, set) = ends.drive.settings()?;
    let value = report::settings_json(&header, &set, status.source)?;
    if ends.json {
        return print(&format!("{value:#}\n"));
    }
    let drive: &Connection = &ends.drive;
    ends.print(&report::settings(drive, value, status.source)?)
}
