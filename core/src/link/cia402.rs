//! The drive in the words of CiA 402, the profile for drives (IEC 61800-7-201): state, statusword, mode of operation.
//!
//! The link has requests of its own; a CAN object dictionary can be put on them:
//!
//! | command of the controlword | request |
//! |---|---|
//! | shutdown (`xxxx x110`) from *switch on disabled* | `Commission` |
//! | enable operation (`xxxx 1111`) | `Start` |
//! | disable voltage (`xxxx xx0x`), shutdown from *operation enabled* | `Stop` |
//! | quick stop (`xxxx x01x`) | `Halt`, and `Stop` once the machine is held |
//! | fault reset (rising bit 7) | `Stop` |
//! | new set-point (rising bit 4), profile position | `Move`, with bit 6 `MoveBy` |
//! | halt (bit 8) | `Halt` |
//! | target velocity, profile velocity | `Jog` |
//! | homing at the present place (method 37) | `SetPosition` |
//! | store parameters (object 1010h) | `Store`, and a set of settings |
//! | homing operation start (rising bit 4), homing | `Home` |
//!
//! Of `Home`, 6098h (method) and the direction of 6099h (speeds) say what is looked for: 20 and 22 are the edge of the
//! home switch on the way up and down (an active one is refused, not moved off), −1 and −2, the manufacturer's own, a
//! stop there. 607Ch (home offset) is `position` the other way round; current and way back have no object. *Homing attained* is `position_set`: homing
//! ends with its mode, so in it bits 10, 12 and 13 of the statusword are zero, in progress; an error is a fault.
//!
//! | mode of the drive | state | mode of operation |
//! |---|---|---|
//! | `Idle` | switch on disabled: the signs are not proven | none (0) |
//! | `Ready` | ready to switch on; switched on while the run switch is closed | none |
//! | `Commissioning`, `Exciting` | operation enabled | −1, −2: the manufacturer's own |
//! | `Running` | operation enabled | profile position (1), profile velocity (3) while it jogs, homing (6) |
//! | `Stopping` | fault reaction active | profile position |
//! | `Fault` | fault | none |
//! | `Storing` | switch on disabled | none |

use super::message::Status;
use crate::mode::Mode;

/// State of the drive's state machine (CiA 402-2, 8.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// The amplifier is off, and the drive is not to be switched on before its signs are proven.
    SwitchOnDisabled,
    /// The amplifier is off; the run switch is open.
    ReadyToSwitchOn,
    /// The amplifier is off; the loop may be closed.
    SwitchedOn,
    /// Current flows.
    OperationEnabled,
    /// The loop brakes the machine because of a fault.
    FaultReactionActive,
    /// The amplifier is off because of a fault.
    Fault,
}

impl State {
    /// Its name in the profile.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SwitchOnDisabled => "switch on disabled",
            Self::ReadyToSwitchOn => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::OperationEnabled => "operation enabled",
            Self::FaultReactionActive => "fault reaction active",
            Self::Fault => "fault",
        }
    }

    /// Its bits of the statusword: 0 to 3, 5 and 6.
    const fn bits(self) -> u16 {
        match self {
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x23,
            Self::OperationEnabled => 0x27,
            Self::FaultReactionActive => 0x0F,
            Self::Fault => 0x08,
        }
    }
}

/// Bits of the statusword beside the state.
const VOLTAGE_ENABLED: u16 = 1 << 4;
const REMOTE: u16 = 1 << 9;
const TARGET_REACHED: u16 = 1 << 10;
const INTERNAL_LIMIT: u16 = 1 << 11;

impl Status {
    /// State of the drive.
    #[must_use]
    pub const fn state(&self) -> State {
        match self.mode {
            Mode::Idle | Mode::Storing => State::SwitchOnDisabled,
            Mode::Ready if self.run_switch => State::SwitchedOn,
            Mode::Ready => State::ReadyToSwitchOn,
            Mode::Commissioning | Mode::Exciting | Mode::Running => State::OperationEnabled,
            Mode::Stopping(_) => State::FaultReactionActive,
            Mode::Fault(_) => State::Fault,
        }
    }

    /// Object 0x6041.
    #[must_use]
    pub fn statusword(&self) -> u16 {
        let bit = |set: bool, bit: u16| if set { bit } else { 0 };
        self.state().bits()
            | bit(self.run_switch, VOLTAGE_ENABLED)
            | bit(self.remote, REMOTE)
            | bit(self.held.is_some(), TARGET_REACHED)
            | bit(self.limited, INTERNAL_LIMIT)
    }

    /// Object 0x6061.
    #[must_use]
    pub const fn mode_of_operation(&self) -> i8 {
        match self.mode {
            Mode::Commissioning => -1,
            Mode::Exciting => -2,
            Mode::Running if self.homing => 6,
            Mode::Running if self.jogging => 3,
            Mode::Running | Mode::Stopping(_) => 1,
            Mode::Idle | Mode::Ready | Mode::Fault(_) | Mode::Storing => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::Fault;
    use crate::units::Place;

    fn status(mode: Mode) -> Status {
        Status {
            mode,
            run_switch: true,
            ..Status::default()
        }
    }

    /// The masks by which the profile tells its states (CiA 402-2, table of the statusword): each state shows
    /// as itself and as no other.
    #[test]
    fn the_statusword_shows_the_state_and_no_other() {
        let told: [(u16, u16, State); 6] = [
            (0x4F, 0x40, State::SwitchOnDisabled),
            (0x6F, 0x21, State::ReadyToSwitchOn),
            (0x6F, 0x23, State::SwitchedOn),
            (0x6F, 0x27, State::OperationEnabled),
            (0x4F, 0x0F, State::FaultReactionActive),
            (0x4F, 0x08, State::Fault),
        ];
        let fault = Fault::Thermal;
        for mode in [
            Mode::Idle,
            Mode::Ready,
            Mode::Commissioning,
            Mode::Exciting,
            Mode::Running,
            Mode::Stopping(fault),
            Mode::Fault(fault),
        ] {
            for run_switch in [false, true] {
                let status = Status {
                    run_switch,
                    remote: true,
                    limited: true,
                    held: Some(Place(3)),
                    ..status(mode)
                };
                for (mask, value, state) in told {
                    let shows = status.statusword() & mask == value;
                    assert_eq!(shows, state == status.state(), "{mode:?} as {state:?}");
                }
            }
        }
    }

    #[test]
    fn a_drive_that_is_held_at_its_target_has_reached_it() {
        let held = Status {
            held: Some(Place(30_000)),
            ..status(Mode::Running)
        };
        assert_eq!(held.statusword(), 0x0437);
        assert_eq!(status(Mode::Running).statusword(), 0x0037);
        assert_eq!(held.mode_of_operation(), 1);
        let homing = Status {
            homing: true,
            ..status(Mode::Running)
        };
        assert_eq!(homing.mode_of_operation(), 6);
    }
}
