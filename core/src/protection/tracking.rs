//! Whether the actuator is where its plan has it.
//!
//! A machine that follows a plan is beside it by what its description has wrong, by what friction and a kick make, and
//! no farther; one that something drives or holds is soon. A raw step leaves the machine far from its reference:
//! then it is not looked at before the machine has been near for as long as a vibration lasts.

use super::{Trip, beyond};
use crate::fault::Fault;
use crate::units::Position;

/// What is kept from one period to the next.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    /// Periods for which the actuator has yet to be near.
    unsettled: u32,
}

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tracking {
    /// m
    limit: f32,
    /// Periods for which it must be near after it has left its plan.
    settles: u32,
}

impl Tracking {
    /// * `limit`: at rest, m
    /// * `settles`: periods
    pub(super) fn new(limit: f32, settles: u32) -> Self {
        Self { limit, settles }
    }

    /// The actuator is not to follow its plan.
    pub(super) fn leaves(self, memory: &mut Memory) {
        memory.unsettled = self.settles;
    }

    /// * `error`: from the reference
    /// * `more`: by which it may be farther, m
    pub(super) fn step(self, memory: &mut Memory, error: Position, more: f32) -> Result<(), Trip> {
        if memory.unsettled == 0 {
            return beyond(Fault::TrackingError, error.0, self.limit + more);
        }
        if error.0.abs() <= self.limit {
            memory.unsettled -= 1;
        } else {
            memory.unsettled = self.settles;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRACKING: Tracking = Tracking {
        limit: 1e-3,
        settles: 3,
    };

    #[test]
    fn beside_its_plan_it_is_stopped_and_after_a_step_only_when_it_has_settled() {
        let trips = |errors: &[f32], stepped: bool| {
            let mut memory = Memory::default();
            if stepped {
                TRACKING.leaves(&mut memory);
            }
            errors.iter().position(|error| {
                let result = TRACKING.step(&mut memory, Position(*error), 0.5e-3);
                result.is_err()
            })
        };
        let errors = [0.0, 1.4e-3, -1.4e-3, 0.0, 1.6e-3];
        assert_eq!(trips(&errors, false), Some(4));
        assert_eq!(trips(&errors, true), None);
        assert_eq!(trips(&[0.0, f32::NAN], false), Some(1));
        // Past it and back it has not settled.
        let steps = [30e-3, 0.5e-3, -0.5e-3, -2e-3, 0.0, 0.0, 0.0, 1.4e-3, 2e-3];
        assert_eq!(trips(&steps, true), Some(8));
        assert_eq!(trips(&steps[..8], true), None);
    }
}
