//! `host-sim drive move`, `jog` and `set-position`.

use super::{Ends, go_on};
use crate::error::{Error, Result};
use crate::link::require_possible;
use arso_core::Place;
use arso_core::request::Request;
use clap::Args;

/// Longest jog, s.
const LONGEST: f64 = 1e6;

/// Move to a position, or by a distance, by a plan, and wait until the machine is held there.
///
/// For example `host-sim drive --port /dev/ttyACM0 move 0.03`, and back by `... move --by -0.03`. A move that is
/// asked for while another one is under way is put on top of it; `--by` counts from the target of that. Ctrl-C
/// brings the machine to rest.
#[derive(Debug, Args)]
pub(super) struct MoveCommand {
    /// Where to, or how far; m or rad, in whole counts of the encoder.
    #[arg(value_name = "X")]
    target: f64,
    /// X is a distance from the target before.
    #[arg(long)]
    by: bool,
    /// Do not wait for the end.
    #[arg(long)]
    no_wait: bool,
}

impl MoveCommand {
    pub(super) fn check(&self) -> Result<()> {
        require_possible("target", self.target)
    }

    pub(super) fn run(&self, ends: &mut Ends) -> Result<()> {
        let drive = &mut ends.drive;
        let counts = drive.counts("target", self.target)?;
        let request = if self.by {
            if counts == 0 {
                let rule = format!(
                    "must be one count of the encoder at least, {}",
                    drive.shown(drive.resolution())
                );
                return Err(Error::parameter("target", self.target, rule));
            }
            Request::MoveBy(counts)
        } else {
            Request::Move(Place(counts))
        };
        if self.no_wait {
            drive.request(request)?;
            return ends.say("the move has begun", None);
        }
        let arrival = drive.go(request, &go_on)?;
        let target = arrival.status.held.map(|held| drive.position(held));
        let target = target.map_or(String::new(), |target| {
            format!(" at its target {}", drive.shown(target))
        });
        let said = format!("the machine is held{target}");
        ends.say(&said, Some(arrival.time))
    }
}

/// Move at a velocity until Ctrl-C, or for some time, and come to rest by a plan.
///
/// For example `host-sim drive --port /dev/ttyACM0 jog -0.05 --for 0.5`. The drive keeps its travel, and comes to
/// rest by itself when it no longer hears this program.
#[derive(Debug, Args)]
pub(super) struct JogCommand {
    /// How fast; m/s or rad/s.
    #[arg(value_name = "V")]
    velocity: f64,
    /// For how long, by the drive's clock.
    #[arg(long = "for", value_name = "SECONDS")]
    duration: Option<f64>,
}

impl JogCommand {
    pub(super) fn check(&self) -> Result<()> {
        require_possible("velocity", self.velocity)?;
        if self.velocity == 0.0 {
            let rule = "must not be zero; `stop` brings the machine to rest";
            return Err(Error::parameter("velocity", self.velocity, rule));
        }
        require_duration(self.duration)
    }

    pub(super) fn run(&self, ends: &mut Ends) -> Result<()> {
        let (by_itself, arrival) = ends.drive.jog(self.velocity, self.duration, &go_on)?;
        if by_itself {
            eprintln!(
                "warning: the machine came to rest before it was halted: at the end of its travel, or because the \
                 drive heard nothing for 0.1 s"
            );
        }
        ends.say("the machine is held", Some(arrival.time))
    }
}

/// Refuses a time that nobody means.
pub(super) fn require_duration(duration: Option<f64>) -> Result<()> {
    match duration {
        Some(duration) if !(duration > 0.0 && duration <= LONGEST) => {
            let rule = format!("must be above 0, and at most {LONGEST:e} s");
            Err(Error::parameter("duration", duration, rule))
        }
        _ => Ok(()),
    }
}

/// Say where the actuator stands; from then on zero is known, and the travel is kept.
///
/// For example `host-sim drive --port /dev/ttyACM0 set-position 0`. Taken by a drive that is idle or ready; it moves
/// nothing.
#[derive(Debug, Args)]
pub(super) struct SetPositionCommand {
    /// Where it stands; m or rad.
    #[arg(value_name = "X")]
    target: f64,
}

impl SetPositionCommand {
    pub(super) fn check(&self) -> Result<()> {
        require_possible("target", self.target)
    }

    pub(super) fn run(&self, ends: &mut Ends) -> Result<()> {
        let counts = ends.drive.counts("target", self.target)?;
        ends.drive.request(Request::SetPosition(Place(counts)))?;
        ends.say("zero is known", None)
    }
}
