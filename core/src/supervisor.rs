//! States of the drive, and the faults that stop it.
//!
//! ```text
//! Idle --Start--> Running --Stop--> Idle
//! any state --fault--> Fault --Stop--> Idle
//! ```
//!
//! Current flows in `Running` alone. A fault is latched, takes effect in the period in which it
//! is found, and is left only by an explicit `Stop`; a limit that merely acts (current limited)
//! is no fault and shows in the telemetry.

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
    /// No current; the encoder is read.
    #[default]
    Idle,
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

    /// From idle to running; whether that happened.
    pub fn start(&mut self) -> bool {
        let idle = self.state == State::Idle;
        if idle {
            self.state = State::Running;
        }
        idle
    }

    /// To idle from any state; acknowledges a fault.
    pub fn stop(&mut self) {
        self.state = State::Idle;
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
    fn the_first_fault_stays_until_it_is_acknowledged() {
        let mut supervisor = Supervisor::default();
        assert!(supervisor.start() && !supervisor.start());
        supervisor.trip(Fault::EncoderJump);
        supervisor.trip(Fault::NonFinite);
        assert!(!supervisor.start());
        assert_eq!(supervisor.state(), State::Fault(Fault::EncoderJump));
        supervisor.stop();
        assert_eq!(supervisor.state(), State::Idle);
        assert!(supervisor.start());
    }
}
