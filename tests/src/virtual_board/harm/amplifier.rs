//! The amplifier: converter code and enable line to motor current.

use host_sim::machine::Actuator;
use std::collections::VecDeque;

/// How it reads the converter, by the drive file: to the last bit what the drive takes it for, so that a
/// difference to the simulation is a difference in the drive.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// A per code; negative where a higher code is less current.
    pub step: f32,
    /// Code of no current.
    pub zero_code: f32,
}

impl From<&Actuator> for Scale {
    fn from(actuator: &Actuator) -> Self {
        let step = actuator.current_resolution as f32;
        Self {
            step: if actuator.inverted { -step } else { step },
            zero_code: actuator.zero_code.into(),
        }
    }
}

/// Half of the converter's range.
const MIDDLE: f32 = 2048.0;

/// What the amplifier, or the wire to it, makes of its reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AmplifierFault {
    /// What it should.
    #[default]
    None,
    /// Times a factor: 0 is a dead amplifier, -1 a changed sign.
    Gain(f64),
    /// The current that flowed last, whatever is asked.
    StuckAtLast,
    /// This current, A, whatever is asked.
    Stuck(f64),
    /// This much more, A.
    Offset(f64),
    /// What was asked some plant steps before.
    Late(usize),
    /// Current flows whether enabled or not.
    EnableIgnored,
    /// One bit of the converter's output does not change.
    Bit {
        /// Which.
        bit: u16,
        /// Its level.
        high: bool,
    },
}

/// An amplifier that may be broken.
#[derive(Clone, Debug)]
pub struct Amplifier {
    scale: Scale,
    fault: AmplifierFault,
    /// What flowed last, A.
    current: f64,
    /// What was asked and has not been made yet, A.
    asked: VecDeque<f64>,
}

impl Amplifier {
    /// One in order.
    #[must_use]
    pub fn new(scale: Scale) -> Self {
        Self {
            scale,
            fault: AmplifierFault::None,
            current: 0.0,
            asked: VecDeque::new(),
        }
    }

    /// Breaks it.
    pub fn fail(&mut self, fault: AmplifierFault) {
        if let AmplifierFault::Late(steps) = fault {
            self.asked = std::iter::repeat_n(self.current, steps).collect();
        }
        self.fault = match fault {
            AmplifierFault::StuckAtLast => AmplifierFault::Stuck(self.current),
            other => other,
        };
    }

    /// The current that flows over the next plant step, A, before its own limit.
    ///
    /// * `code`: without one the amplifier's input rests at half its range
    pub fn step(&mut self, code: Option<u16>, enabled: bool) -> f64 {
        let code = match (self.fault, code) {
            (AmplifierFault::Bit { bit, high }, Some(code)) => {
                Some(code & !(1 << bit) | u16::from(high) << bit)
            }
            (_, code) => code,
        };
        let Scale { step, zero_code } = self.scale;
        let asked = f64::from((code.map_or(MIDDLE, f32::from) - zero_code) * step);
        let made = match self.fault {
            AmplifierFault::Gain(gain) => gain * asked,
            AmplifierFault::Stuck(current) => current,
            AmplifierFault::Offset(offset) => asked + offset,
            AmplifierFault::Late(_) => {
                self.asked.push_back(asked);
                self.asked.pop_front().unwrap_or(asked)
            }
            _ => asked,
        };
        self.current = if enabled || self.fault == AmplifierFault::EnableIgnored {
            made
        } else {
            0.0
        };
        self.current
    }

    /// What flowed last, A.
    #[must_use]
    pub fn current(&self) -> f64 {
        self.current
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// +0.5 A asked for, after +0.25 A has flowed: what flows then, enabled and not.
    #[test]
    fn each_fault_does_what_it_says() {
        for (fault, enabled, disabled) in [
            (AmplifierFault::None, 0.5, 0.0),
            (AmplifierFault::Gain(-1.0), -0.5, 0.0),
            (AmplifierFault::StuckAtLast, 0.25, 0.0),
            (AmplifierFault::Stuck(2.0), 2.0, 0.0),
            (AmplifierFault::Offset(0.2), 0.7, 0.0),
            (AmplifierFault::Late(1), 0.25, 0.0),
            (AmplifierFault::EnableIgnored, 0.5, 0.5),
            (
                AmplifierFault::Bit {
                    bit: 11,
                    high: false,
                },
                -1.548,
                0.0,
            ),
        ] {
            for (enable, expected) in [(true, enabled), (false, disabled)] {
                let mut amplifier = Amplifier::new(Scale {
                    step: 1e-3,
                    zero_code: 2048.0,
                });
                assert_eq!(amplifier.step(Some(2048 + 250), true), 0.25);
                amplifier.fail(fault);
                let found = amplifier.step(Some(2048 + 500), enable);
                assert!((found - expected).abs() < 1e-6, "{fault:?}: {found}");
            }
        }
    }
}
