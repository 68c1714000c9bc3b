//! States of the drive, and the faults that stop it.
//!
//! ```text
//! Idle --Commission--> Commissioning --signs proven--> Ready --Start--> Running --Stop--> Ready
//! Idle, Ready --Excite--> Exciting --all played, Stop--> Idle
//! any state --fault--> Fault --Stop--> Idle
//! ```
//!
//! Current flows in `Commissioning`, `Exciting` and `Running` alone. The loop is never closed before
//! the signs of encoder and current have been proven since the last reset, excitation or fault. A
//! fault is latched, takes effect in the period in which it is found, and is left only by an explicit
//! `Stop`; a limit that merely acts (current limited) is no fault and shows in the telemetry.

/// A fault that stops the drive. The numbers are stable: they appear in logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
#[repr(u8)]
pub enum Fault {
    /// A measurement, an estimate or the command is not finite.
    NonFinite = 1,
    /// The encoder moved by more than a quarter of its counter's range within one period.
    EncoderJump = 2,
    /// The move asked for cannot be made: not finite, or too long to be counted in periods.
    Target = 3,
    /// The current said to have been applied is beyond the limit: output and command disagree.
    AppliedCurrent = 4,
    /// Commissioning: a positive current moves the encoder backwards. Phases of the encoder or
    /// leads of the motor are swapped.
    Direction = 5,
    /// Commissioning, excitation: the encoder does not move though current flows. Encoder, amplifier
    /// or motor is not connected, or something holds the actuator.
    NoMotion = 6,
    /// Commissioning, excitation: the actuator does not come to rest.
    NotAtRest = 7,
    /// The actuator left the travel allowed to it.
    Travel = 8,
}

impl Fault {
    /// The fault's number.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }
}

/// What the drive is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
pub enum State {
    /// No current; the encoder is read. The signs are not proven.
    #[default]
    Idle,
    /// The signs are being proven.
    Commissioning,
    /// A current profile is played in open loop.
    Exciting,
    /// No current; the loop may be closed.
    Ready,
    /// The loop is closed.
    Running,
    /// No current, until `Stop` acknowledges the fault.
    Fault(Fault),
}

/// Holds the state and says which changes are allowed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Supervisor {
    state: State,
}

impl Supervisor {
    /// The present state.
    #[must_use]
    pub fn state(&self) -> State {
        self.state
    }

    /// No current flows and no fault is latched.
    fn resting(self) -> bool {
        matches!(self.state, State::Idle | State::Ready)
    }

    /// From idle or ready to commissioning; whether that happened.
    pub fn commission(&mut self) -> bool {
        let resting = self.resting();
        if resting {
            self.state = State::Commissioning;
        }
        resting
    }

    /// The signs are proven.
    pub fn commissioned(&mut self) {
        if self.state == State::Commissioning {
            self.state = State::Ready;
        }
    }

    /// From idle or ready to exciting; whether that happened.
    pub fn excite(&mut self) -> bool {
        let resting = self.resting();
        if resting {
            self.state = State::Exciting;
        }
        resting
    }

    /// All has been played. What it did to the machine is not known here: as after a reset.
    pub fn excited(&mut self) {
        if self.state == State::Exciting {
            self.state = State::Idle;
        }
    }

    /// From ready to running; whether that happened.
    pub fn start(&mut self) -> bool {
        let ready = self.state == State::Ready;
        if ready {
            self.state = State::Running;
        }
        ready
    }

    /// Ends whatever is going on; acknowledges a fault.
    pub fn stop(&mut self) {
        self.state = match self.state {
            State::Running | State::Ready => State::Ready,
            State::Idle | State::Commissioning | State::Exciting | State::Fault(_) => State::Idle,
        };
    }

    /// Latches a fault; the first one stays.
    pub fn trip(&mut self, fault: Fault) {
        if !matches!(self.state, State::Fault(_)) {
            self.state = State::Fault(fault);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loop_is_closed_only_after_commissioning() {
        let mut supervisor = Supervisor::default();
        supervisor.commissioned();
        assert!(!supervisor.start());
        assert!(supervisor.commission() && !supervisor.commission());
        assert!(!supervisor.start());
        supervisor.stop();
        assert_eq!(supervisor.state(), State::Idle);
        supervisor.commission();
        supervisor.commissioned();
        assert!(supervisor.start() && !supervisor.start());
        supervisor.stop();
        assert_eq!(supervisor.state(), State::Ready);
        assert!(supervisor.start());
        supervisor.trip(Fault::EncoderJump);
        supervisor.stop();
        assert!(!supervisor.start());
    }

    #[test]
    fn an_excitation_begins_at_rest_and_leaves_the_signs_unproven() {
        let mut supervisor = Supervisor::default();
        supervisor.excited();
        assert!(supervisor.excite() && !supervisor.excite());
        assert!(!supervisor.commission() && !supervisor.start());
        supervisor.commissioned();
        assert_eq!(supervisor.state(), State::Exciting);
        supervisor.excited();
        assert_eq!(supervisor.state(), State::Idle);

        for end in [Supervisor::stop, Supervisor::excited] {
            supervisor.commission();
            assert!(!supervisor.excite());
            supervisor.commissioned();
            assert!(supervisor.excite());
            end(&mut supervisor);
            assert_eq!(supervisor.state(), State::Idle);
        }
        supervisor.commission();
        supervisor.commissioned();
        supervisor.start();
        assert!(!supervisor.excite());
        supervisor.excited();
        assert_eq!(supervisor.state(), State::Running);
        supervisor.trip(Fault::Travel);
        assert!(!supervisor.excite());
    }

    #[test]
    fn the_first_fault_stays_until_it_is_acknowledged() {
        let mut supervisor = Supervisor::default();
        supervisor.trip(Fault::EncoderJump);
        supervisor.trip(Fault::NonFinite);
        assert!(!supervisor.start());
        assert_eq!(supervisor.state(), State::Fault(Fault::EncoderJump));
        assert!(!supervisor.commission());
        supervisor.stop();
        assert_eq!(supervisor.state(), State::Idle);
    }
}
