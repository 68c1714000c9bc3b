//! `host-sim drive home`.

use super::{Ends, go_on};
use crate::error::{Error, Result};
use crate::link::require_possible;
use arso_core::request::At;
use arso_core::{Current, Homing, Place, Velocity};
use clap::{ArgGroup, Args};

/// Find zero: move until the actuator stands against a stop, or until the home switch is active.
///
/// For example `host-sim drive --port /dev/ttyACM0 home --stop 0.3 --velocity -0.02 --back-off 0.005`: down to the
/// stop, pushed by 0.3 A at most, which is 0 from then on, and 5 mm back from it. Or `... home --input --velocity 0.05
/// --position 0.2`: up to where the home switch becomes active, which is 0.2 m from then on. It is to be the actuator
/// that meets the stop: where a load does, its spring is pressed when the actuator stands. The travel is not kept on
/// the way. Ctrl-C brings the machine to rest and leaves zero as it was; so does the drive by itself when it no longer
/// hears this program.
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("place").required(true).args(["stop", "input"])))]
pub(super) struct HomeCommand {
    /// Largest current of the approach to a stop, A; times the force constant it is the force against it.
    #[arg(long, value_name = "CURRENT")]
    stop: Option<f64>,
    /// Find the edge of the home switch.
    #[arg(long)]
    input: bool,
    /// How fast to approach, negative downwards; m/s or rad/s.
    #[arg(long, value_name = "V")]
    velocity: f64,
    /// What the place found is called; m or rad.
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    position: f64,
    /// How far to move back from it; a stop needs some; m or rad.
    #[arg(long, value_name = "D", default_value_t = 0.0)]
    back_off: f64,
}

impl HomeCommand {
    pub(super) fn check(&self) -> Result<()> {
        require_possible("approach", self.velocity)?;
        require_possible("position", self.position)?;
        require_possible("back-off", self.back_off)?;
        if self.velocity == 0.0 {
            let rule = "must not be zero: its sign is the direction of the approach";
            return Err(Error::parameter("approach", self.velocity, rule));
        }
        if let Some(current) = self
            .stop
            .filter(|current| !(*current > 0.0 && current.is_finite()))
        {
            let rule = "must be a current above 0 A";
            return Err(Error::parameter("stop", current, rule));
        }
        if self.back_off < 0.0 || (self.stop.is_some() && self.back_off == 0.0) {
            let rule = if self.stop.is_some() {
                "must be above 0: the machine moves back from a stop"
            } else {
                "must not be negative: it is a distance back to where the approach came from"
            };
            return Err(Error::parameter("back-off", self.back_off, rule));
        }
        Ok(())
    }

    pub(super) fn run(&self, ends: &mut Ends) -> Result<()> {
        let drive = &mut ends.drive;
        let position = Place(drive.counts("position", self.position)?);
        let back_off = drive.counts("back-off", self.back_off)?;
        let Ok(back_off) = u32::try_from(back_off) else {
            let rule = "must be less than 4294967296 counts of the encoder";
            return Err(Error::parameter("back-off", self.back_off, rule));
        };
        let homing = Homing {
            velocity: Velocity(self.velocity as f32),
            at: self.stop.map_or(At::Input, |current| At::Stop {
                current: Current(current as f32),
            }),
            position,
            back_off,
        };
        let arrival = drive.home(homing, &go_on)?;
        ends.say("zero is known, the machine is held", Some(arrival.time))
    }
}
