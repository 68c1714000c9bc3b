//! What is asked of the drive, and what it answers. Plain data without a transport; [`link`](crate::link) puts it on a
//! wire.

use crate::mode::Mode;
use crate::units::{Current, Place, Velocity};
use core::fmt;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// What can be asked of the drive. What is taken takes effect with the next period.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(rename_all = "snake_case")]
pub enum Request {
    /// Prove the signs of encoder and current by a small motion; idle or ready drives only.
    Commission,
    /// Play the excitation that the drive has; idle or ready drives only.
    Excite,
    /// Close the loop where the actuator stands; ready drives only.
    Start,
    /// Open the loop, end whatever is going on, acknowledge a fault; always taken.
    Stop,
    /// The actuator stands there: from now on zero is known, and with it the travel; idle or ready drives
    /// only.
    SetPosition(Place),
    /// Put the reference there at once; running drives only.
    Step(Place),
    /// Move there by a plan, on top of what is under way; running drives only.
    Move(Place),
    /// Move so many counts on from the target, of the move that waits or of the one that is under way; running
    /// drives only.
    MoveBy(i64),
    /// Move at that velocity until something else is asked; running drives only.
    Jog(Velocity),
    /// Find zero, from where the machine is held; ended by `Halt` and `Stop`; running drives only.
    Home(Homing),
    /// Come to rest by a plan and stay there; running drives only.
    Halt,
    /// Keep the amplifier off until the reset, so that settings can be written; drives without current only.
    Store,
    /// Go on with the settings that were handed over; drives that hold their machine at a target only.
    Change,
}

/// How zero is to be found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Homing {
    /// Velocity of the approach, with its direction.
    pub velocity: Velocity,
    /// What ends the approach.
    pub at: At,
    /// What the place found is to be called.
    pub position: Place,
    /// How far to move back from it, to where it came from, counts.
    pub back_off: u32,
}

/// What ends an approach.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(rename_all = "snake_case")]
pub enum At {
    /// The actuator stands against something.
    Stop {
        /// Largest current of the approach; times `k_f` it is the force.
        current: Current,
    },
    /// The home switch becomes active.
    Input,
}

impl Homing {
    /// Where it is to rest, from the place found.
    #[must_use]
    pub fn rests_at(&self, found: Place) -> Place {
        let back = i64::from(self.back_off);
        Place(if self.velocity.0 > 0.0 {
            found.0.wrapping_sub(back)
        } else {
            found.0.wrapping_add(back)
        })
    }
}

/// Why a request was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Refusal {
    /// What was asked.
    pub request: Request,
    /// What the drive is doing.
    pub mode: Mode,
    /// What stands in the way.
    pub reason: Reason,
}

/// What stands in the way of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// It is taken in other modes only.
    Mode,
    /// The drive has nothing to play.
    NoExcitation,
    /// The target is outside the travel.
    Travel,
    /// The run switch is open.
    RunSwitch,
    /// No move leads there: a value that is no number, or more of it than can be counted in periods.
    Unreachable,
    /// No settings were handed over.
    NoSettings,
    /// They change what a drive begins with: encoder, actuator, control period, force observers, plans.
    Restart,
    /// The machine is under way, or has not settled.
    Moving,
    /// The current would leap.
    Leap,
    /// The motor is warm, which the reset would forget.
    Warm,
    /// No approach of homing is that slow, or that fast.
    Velocity,
    /// The current of homing is none that finds a stop.
    Current,
    /// The machine is to move back from a stop, farther than it may stand off.
    BackOff,
    /// The home switch is active already.
    HomeSwitch,
    /// The drive homes, which is to be ended first.
    Homing,
}

impl Mode {
    /// The mode in which a request leaves the drive.
    ///
    /// # Errors
    /// The refusal, where this mode does not allow it.
    pub const fn next(self, request: Request) -> Result<Self, Refusal> {
        match (self, request) {
            (Self::Idle | Self::Ready, Request::Commission) => Ok(Self::Commissioning),
            (Self::Idle | Self::Ready, Request::Excite) => Ok(Self::Exciting),
            (Self::Idle | Self::Ready, Request::SetPosition(_)) => Ok(self),
            (Self::Ready, Request::Start)
            | (
                Self::Running,
                Request::Step(_)
                | Request::Move(_)
                | Request::MoveBy(_)
                | Request::Jog(_)
                | Request::Home(_)
                | Request::Halt
                | Request::Change,
            ) => Ok(Self::Running),
            (Self::Idle | Self::Ready | Self::Fault(_), Request::Store) => Ok(Self::Storing),
            (Self::Running | Self::Ready, Request::Stop) => Ok(Self::Ready),
            // Whatever else is going on, but for what the reset alone ends.
            (mode, request) => match request {
                Request::Stop if !matches!(mode, Self::Storing) => Ok(Self::Idle),
                _ => Err(Refusal {
                    request,
                    mode,
                    reason: Reason::Mode,
                }),
            },
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (request, wanted) = match self.request {
            Request::Commission => ("commission", "an idle or ready"),
            Request::Excite => ("excite", "an idle or ready"),
            Request::Start => ("start", "a ready"),
            Request::Stop => ("stop", "any"),
            Request::SetPosition(_) => ("set position", "an idle or ready"),
            Request::Step(_) => ("step", "a running"),
            Request::Move(_) | Request::MoveBy(_) => ("move", "a running"),
            Request::Jog(_) => ("jog", "a running"),
            Request::Home(_) => ("home", "a running"),
            Request::Halt => ("halt", "a running"),
            Request::Store => ("store", "an idle, ready or faulted"),
            Request::Change => ("change settings", "a running"),
        };
        match self.reason {
            Reason::Mode => write!(f, "{request} is for {wanted} drive, and this one is "),
            Reason::Travel => write!(
                f,
                "{request}: the target is outside the travel, the drive is "
            ),
            Reason::RunSwitch => write!(f, "{request}: the run switch is open, the drive is "),
            Reason::Unreachable => write!(f, "{request}: no move leads there, the drive is "),
            Reason::Velocity => write!(
                f,
                "{request}: the approach is too slow to be made or too fast to be ended, the drive is "
            ),
            Reason::Current => write!(
                f,
                "{request}: the current must be below the drive's limit and above what friction and weight take, \
                 the drive is "
            ),
            Reason::BackOff => write!(
                f,
                "{request}: it must move back from a stop by more than it may stand off, the drive is "
            ),
            Reason::HomeSwitch => write!(
                f,
                "{request}: the home switch is active already, move off it first, the drive is "
            ),
            Reason::Homing => write!(
                f,
                "{request}: it is homing and to be halted first, the drive is "
            ),
            Reason::NoExcitation => write!(f, "{request}: there is nothing to play, the drive is "),
            Reason::NoSettings => write!(f, "{request}: none were handed over, the drive is "),
            Reason::Restart => write!(
                f,
                "{request}: another encoder, actuator, amplifier, holding force, control period, force observer or plan \
                 needs the amplifier off, the drive is "
            ),
            Reason::Moving => write!(
                f,
                "{request}: the machine is under way or settles still, the drive is "
            ),
            Reason::Leap => write!(f, "{request}: the current would leap, the drive is "),
            Reason::Warm => write!(
                f,
                "{request}: the motor is warm, which the reset at the end would forget; ask again when it has cooled. \
                 The drive is "
            ),
        }?;
        match self.mode {
            Mode::Idle => f.write_str("idle"),
            Mode::Commissioning => f.write_str("commissioning"),
            Mode::Exciting => f.write_str("exciting"),
            Mode::Ready => f.write_str("ready"),
            Mode::Running => f.write_str("running"),
            Mode::Storing => f.write_str("storing settings"),
            Mode::Stopping(fault) | Mode::Fault(fault) => {
                write!(f, "stopped by fault {} ({})", fault.number(), fault.name())
            }
        }
    }
}

impl core::error::Error for Refusal {}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::fault::Fault;
    use std::string::ToString;
    use std::vec;

    const HOMING: Homing = Homing {
        velocity: Velocity(-0.05),
        at: At::Input,
        position: Place(0),
        back_off: 1000,
    };

    const MODES: [Mode; 8] = [
        Mode::Idle,
        Mode::Commissioning,
        Mode::Exciting,
        Mode::Ready,
        Mode::Running,
        Mode::Stopping(Fault::Thermal),
        Mode::Fault(Fault::Travel),
        Mode::Storing,
    ];

    /// What each mode makes of each request; nothing is refused.
    #[test]
    fn the_whole_table() {
        use Mode::{Commissioning, Exciting, Idle, Ready, Running};
        let step = Request::Step(Place(10_000));
        let taken = [
            (
                Request::Commission,
                vec![(Mode::Idle, Commissioning), (Ready, Commissioning)],
            ),
            (
                Request::Excite,
                vec![(Mode::Idle, Exciting), (Ready, Exciting)],
            ),
            (
                Request::SetPosition(Place(5)),
                vec![(Idle, Idle), (Ready, Ready)],
            ),
            (Request::Start, vec![(Ready, Running)]),
            (
                Request::Stop,
                vec![
                    (Idle, Idle),
                    (Commissioning, Idle),
                    (Exciting, Idle),
                    (Ready, Ready),
                    (Running, Ready),
                    (Mode::Stopping(Fault::Thermal), Idle),
                    (Mode::Fault(Fault::Travel), Idle),
                ],
            ),
            (step, vec![(Running, Running)]),
            (Request::Move(Place(10_000)), vec![(Running, Running)]),
            (Request::MoveBy(-10_000), vec![(Running, Running)]),
            (Request::Jog(Velocity(0.1)), vec![(Running, Running)]),
            (Request::Home(HOMING), vec![(Running, Running)]),
            (Request::Halt, vec![(Running, Running)]),
            (Request::Change, vec![(Running, Running)]),
            (
                Request::Store,
                vec![
                    (Idle, Mode::Storing),
                    (Ready, Mode::Storing),
                    (Mode::Fault(Fault::Travel), Mode::Storing),
                ],
            ),
        ];
        for (request, row) in taken {
            for mode in MODES {
                let expected = row
                    .iter()
                    .find(|(from, _)| *from == mode)
                    .map(|(_, to)| *to);
                let refusal = Refusal {
                    request,
                    mode,
                    reason: Reason::Mode,
                };
                assert_eq!(
                    mode.next(request),
                    expected.ok_or(refusal),
                    "{mode:?} {request:?}"
                );
            }
        }
    }

    /// The loop is closed only after the signs have been proven: no way leads from idle or a fault to
    /// running but through commissioning.
    #[test]
    fn no_loop_is_closed_with_unproven_signs() {
        let requests = [
            Request::Excite,
            Request::SetPosition(Place(0)),
            Request::Start,
            Request::Stop,
            Request::Step(Place(0)),
            Request::Move(Place(0)),
            Request::MoveBy(1),
            Request::Jog(Velocity(0.1)),
            Request::Home(HOMING),
            Request::Halt,
            Request::Store,
            Request::Change,
        ];
        let mut reached = std::vec![Mode::Idle, Mode::Fault(Fault::NoMotion)];
        for _ in 0..MODES.len() {
            for mode in reached.clone() {
                let next = requests
                    .iter()
                    .filter_map(|request| mode.next(*request).ok());
                for mode in next.chain([mode.completed()]) {
                    if !reached.contains(&mode) {
                        reached.push(mode);
                    }
                }
            }
        }
        assert!(!reached.contains(&Mode::Running) && !reached.contains(&Mode::Ready));
    }

    #[test]
    fn a_refusal_names_the_mode() {
        let refused = |mode: Mode, request| mode.next(request).unwrap_err().to_string();
        assert_eq!(
            refused(Mode::Idle, Request::Start),
            "start is for a ready drive, and this one is idle"
        );
        assert_eq!(
            refused(Mode::Fault(Fault::Travel), Request::Step(Place(0))),
            "step is for a running drive, and this one is stopped by fault 8 (Travel)"
        );
    }

    /// Requests and refusals are messages.
    #[test]
    fn they_survive_a_wire() {
        let refusal = Mode::Fault(Fault::Direction)
            .next(Request::Move(Place(30_000)))
            .unwrap_err();
        let mut buffer = [0; 32];
        let bytes = postcard::to_slice(&refusal, &mut buffer).unwrap();
        assert_eq!(postcard::from_bytes(bytes), Ok(refusal));
    }
}
