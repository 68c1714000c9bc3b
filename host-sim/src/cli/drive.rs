//! `host-sim drive`: a drive that is connected, over its serial link.

mod files;
mod home;
mod motion;
mod settings;
mod telemetry;
mod watch;

use super::interrupt::{INTERRUPTED, catch_interrupt};
use super::record::Wanted;
use crate::error::{Error, Result};
use crate::link::{Connection, Port};
use crate::output::print;
use crate::report::link as report;
use arso_core::request::Request;
use clap::{Args, Subcommand};
use std::sync::atomic::Ordering;

/// Command a drive over its serial link, and read what it says.
///
/// The port is a serial device (/dev/ttyACM0, COM3), opened with 1 Mbaud, 8N1, or HOST:PORT of a server that
/// passes one on. Positions are in m, or in rad where the drive is rotary. For example, from a drive that has just
/// been switched on: `host-sim drive --port /dev/ttyACM0 enable`, then `... move 0.03`, then `... disable`. From the
/// first such command on, `status` too, until its reset the drive heeds the link and of its switches the run switch alone.
#[derive(Debug, Args)]
pub(super) struct DriveCommand {
    #[command(subcommand)]
    action: Action,
    /// Where the drive is: /dev/ttyACM0, COM3, 127.0.0.1:5000.
    #[arg(long, value_name = "PORT", global = true)]
    port: Option<String>,
    /// Print what is printed as JSON, SI units.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Say what the drive is doing: state, motion, identity.
    ///
    /// Names, statusword and mode of operation are those of `CiA 402`. For example
    /// `host-sim drive --port /dev/ttyACM0 status --json`.
    Status,
    /// Close the loop; a drive that is idle proves its signs by a small motion before.
    ///
    /// For example `host-sim drive --port /dev/ttyACM0 enable`. The run switch must be closed. Ctrl-C switches the
    /// amplifier off.
    Enable,
    /// Switch the amplifier off at once, whatever goes on; what moves coasts.
    ///
    /// For example `host-sim drive --port /dev/ttyACM0 disable`. To bring the machine to rest before: `stop`.
    Disable,
    /// Acknowledge a fault.
    ///
    /// For example `host-sim drive --port /dev/ttyACM0 clear`. The drive is idle then: `enable` proves its signs
    /// anew. A drive without a fault goes on as it was.
    Clear,
    Move(motion::MoveCommand),
    Jog(motion::JogCommand),
    /// Bring the machine to rest by a plan, and hold it there.
    ///
    /// For example `host-sim drive --port /dev/ttyACM0 stop`.
    Stop,
    SetPosition(motion::SetPositionCommand),
    Home(home::HomeCommand),
    /// Read the last moves that the drive keeps in its memory.
    ///
    /// What `record` reads from a dump, here from the drive; what is written is what `identify` reads. For example
    /// `host-sim drive --port /dev/ttyACM0 record --move 3`. A drive that has moved is read once it has stood for a
    /// quarter of a second.
    Record(Wanted),
    /// List the last faults, the oldest first, and what to do about each.
    ///
    /// For example `host-sim drive --port /dev/ttyACM0 faults`. The drive remembers eight until its reset.
    Faults,
    Telemetry(telemetry::TelemetryCommand),
    Settings(settings::SettingsCommand),
    Watch(watch::WatchCommand),
}

impl DriveCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let Some(name) = &self.port else {
            return Err(Error::Usage(
                "`port` must say where the drive is, for example `port` /dev/ttyACM0".into(),
            ));
        };
        // What cannot be used is said before anything is sent.
        match &self.action {
            Action::Move(command) => command.check()?,
            Action::Jog(command) => command.check()?,
            Action::SetPosition(command) => command.check()?,
            Action::Home(command) => command.check()?,
            Action::Telemetry(command) => command.check(self.json)?,
            Action::Watch(_) => watch::WatchCommand::check(self.json)?,
            Action::Record(wanted) if wanted.csv && self.json => {
                return Err(Error::Usage("--json and --csv exclude each other".into()));
            }
            _ => {}
        }
        let set = match &self.action {
            Action::Settings(command) => command.set(quiet)?,
            _ => None,
        };
        let port = Port::open(name)?;
        // What goes on for a while ends in order.
        if let Action::Enable
        | Action::Move(_)
        | Action::Jog(_)
        | Action::Home(_)
        | Action::Telemetry(_)
        | Action::Watch(_) = &self.action
        {
            catch_interrupt()?;
        }
        let mut ends = Ends {
            drive: Connection::new(port)?,
            json: self.json,
            quiet,
        };
        let drive = &mut ends.drive;
        match self.action {
            Action::Status => {
                let status = drive.status()?;
                if self.json {
                    return print(&format!("{:#}\n", report::status_json(drive, &status)?));
                }
                ends.print(&report::status(&ends.drive, &status))
            }
            Action::Enable => {
                let said = if drive.enable(&go_on)? {
                    "the drive runs"
                } else {
                    "the drive runs already"
                };
                ends.say(said, None)
            }
            Action::Disable => {
                drive.request(Request::Stop)?;
                ends.say("the amplifier is off", None)
            }
            Action::Clear => {
                let said = if drive.clear()? {
                    "the fault is acknowledged"
                } else {
                    "there is no fault"
                };
                ends.say(said, None)
            }
            Action::Move(command) => command.run(&mut ends),
            Action::Jog(command) => command.run(&mut ends),
            Action::Stop => {
                let arrival = drive.halt()?;
                ends.say("the machine is held", Some(arrival.time))
            }
            Action::SetPosition(command) => command.run(&mut ends),
            Action::Home(command) => command.run(&mut ends),
            Action::Record(wanted) => {
                let last_moves = drive.last_moves()?;
                match wanted.write(&last_moves)? {
                    Some(_) if self.json => {
                        print(&format!("{:#}\n", report::moves_json(&last_moves)))
                    }
                    Some(written) => ends.print(&written),
                    None => Ok(()),
                }
            }
            Action::Faults => {
                let faults = drive.faults()?;
                if self.json {
                    return print(&format!("{:#}\n", report::faults_json(&faults)));
                }
                let now = drive.status()?.period;
                ends.print(&report::faults(&ends.drive, &faults, now))
            }
            Action::Telemetry(command) => command.run(&mut ends),
            Action::Settings(command) => command.run(&mut ends, set.as_deref()),
            Action::Watch(command) => command.run(&mut ends, name),
        }
    }
}

/// A drive, and how what it does is said.
struct Ends {
    drive: Connection,
    json: bool,
    quiet: bool,
}

impl Ends {
    /// Text for people.
    fn print(&self, text: &str) -> Result<()> {
        if self.quiet { Ok(()) } else { print(text) }
    }

    /// What was done and where the actuator is, for people, or the status, for programs.
    ///
    /// * `time`: how long it took, s
    fn say(&mut self, what: &str, time: Option<f64>) -> Result<()> {
        let status = self.drive.status()?;
        if self.json {
            let mut json = report::status_json(&self.drive, &status)?;
            if let Some(time) = time {
                json["duration"] = serde_json::json!(time);
            }
            return print(&format!("{json:#}\n"));
        }
        if self.quiet {
            return Ok(());
        }
        let place = self.drive.shown(status.position.into());
        let after = time.map_or(String::new(), |time| format!(" after {time:.3} s"));
        print(&format!("{what}{after}; the actuator is at {place}\n"))
    }
}

/// Whether nobody has pressed Ctrl-C.
fn go_on() -> bool {
    !INTERRUPTED.load(Ordering::Relaxed)
}
