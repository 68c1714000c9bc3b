//! Whether the encoder shows a motion that a force can have made.
//!
//! Over one period a held current moves the actuator by what is known; springs and friction add to that,
//! but cannot change by much from one period to the next. With the displacement `Δx_k` of a period,
//!
//! ```text
//! s_k = Δx_k − Δx_k−1 − T² k_f (i_k + i_k−1) / (2 m)       motion that the current does not explain
//! |s_k − s_k−1| ≤ limit
//! ```
//!
//! A counter that stops, jumps, or counts twice while the machine moves is found in the period in which
//! it does so; one that does so at rest has done nothing yet.

use super::{Trip, beyond};
use crate::actuator::Actuator;
use crate::encoder::Reading;
use crate::fault::Fault;
use crate::units::Current;

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EncoderStep {
    /// Displacement that a current over one period adds in it, and in the next, m/A.
    per_current: f32,
    /// m
    limit: f32,
}

/// The period before; nothing is known of it in the first three: what was before the start does not count.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    known: u8,
    displacement: f32,
    current: f32,
    unexplained: f32,
}

impl EncoderStep {
    /// * `limit`: m per period
    /// * `sample_time`: s
    pub(super) fn new(actuator: &Actuator, limit: f32, sample_time: f32) -> Self {
        let acceleration = actuator.actual_force_constant() / actuator.actual_mass();
        Self {
            per_current: 0.5 * sample_time * sample_time * acceleration,
            limit,
        }
    }

    /// By how much a stop may change what the current does not explain: it takes all of that, which may have turned
    /// round, m.
    ///
    /// * `current`: largest one against it
    pub(super) fn at_stop(self, current: Current) -> f32 {
        4.0 * self.per_current * current.0
    }

    /// * `more`: by which the change may be larger, m
    pub(super) fn step(
        self,
        memory: &mut Memory,
        reading: &Reading,
        current: Current,
        more: f32,
    ) -> Result<(), Trip> {
        let explained = self.per_current * (current.0 + memory.current);
        let unexplained = reading.displacement - memory.displacement - explained;
        let change = unexplained - memory.unexplained;
        let known = memory.known >= 3;
        *memory = Memory {
            known: memory.known.saturating_add(1),
            displacement: reading.displacement,
            current: current.0,
            unexplained,
        };
        if known {
            beyond(Fault::EncoderStep, change, self.limit + more)
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Place;

    const T: f32 = 1e-3;
    const ACTUATOR: Actuator = Actuator {
        mass: 0.059,
        force_constant: 6.43,
        mass_deviation: 0.0,
        force_constant_deviation: 0.0,
    };

    /// A free actuator under currents that jump as they like is explained to the rounding; a counter that
    /// stops is found in the period in which it does.
    #[test]
    fn currents_are_explained_and_a_stopped_counter_is_not() {
        let watch = EncoderStep::new(&ACTUATOR, 2e-6, T);
        for stops in [None, Some(30)] {
            let (mut memory, mut velocity) = (Memory::default(), 0.0_f32);
            for k in 0..60 {
                // A held current over the period; what is shown at its end.
                let current = if k % 7 < 3 { 2.0 } else { -1.0 };
                let acceleration = 6.43 / 0.059 * current;
                let mut displacement = velocity * T + 0.5 * acceleration * T * T;
                velocity += acceleration * T;
                if stops.is_some_and(|stops| k >= stops) {
                    displacement = 0.0;
                }
                let reading = Reading {
                    place: Place(0),
                    displacement,
                    jump: false,
                };
                let result = watch.step(&mut memory, &reading, Current(current), 0.0);
                assert_eq!(result.is_err(), stops == Some(k), "{k} {result:?}");
                if result.is_err() {
                    break;
                }
            }
        }
    }
}
