//! What a move may show of a machine that differs from the model.
//!
//! Springs and masses that are off by a third make forces that the observers cannot explain, and the harder a
//! plan pushes the larger ones. So disturbance and innovation may go beyond what they may at rest by a share
//! of the plan's force, of its largest one so far, which is forgotten as the vibration it can have left fades:
//!
//! ```text
//! e_k = max(k_f |i_ff|, c e_k−1)        |d| ≤ limit + share e
//! ```
//!
//! So may the actuator be beside its plan.

use crate::check::{SettingsError, not_negative};
use serde::{Deserialize, Serialize};

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelError {
    /// By which the disturbance may go further, over the plan's force.
    pub disturbance: f32,
    /// By which the innovation may, over the plan's force.
    pub innovation: f32,
    /// By which the actuator may be farther from its plan, over the plan's force, m/N.
    pub tracking_error: f32,
    /// Share `c` of the plan's force that is remembered for the next period, below one.
    pub remembered: f32,
}

impl ModelError {
    /// One period; the force that differences are measured by, N.
    ///
    /// * `planned`: force of the plan, N
    pub(super) fn step(&self, memory: &mut f32, planned: f32) -> f32 {
        let (faded, planned) = (self.remembered * *memory, planned.abs());
        // A comparison where `f32::max` takes three.
        *memory = if planned > faded { planned } else { faded };
        *memory
    }

    /// Periods in which the plan's force is forgotten by `1/e`, one at least.
    pub(super) fn periods(&self) -> u32 {
        (1.0 / (1.0 - self.remembered)) as u32
    }

    pub(super) fn check(&self) -> Result<(), SettingsError> {
        not_negative("protection.model_error.disturbance", self.disturbance)?;
        not_negative("protection.model_error.innovation", self.innovation)?;
        not_negative("protection.model_error.tracking_error", self.tracking_error)?;
        not_negative("protection.model_error.remembered", self.remembered)?;
        not_negative(
            "1 - protection.model_error.remembered",
            1.0 - self.remembered,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::ModelError;

    #[test]
    fn the_largest_force_fades() {
        let error = ModelError {
            disturbance: 0.0,
            innovation: 0.0,
            tracking_error: 0.0,
            remembered: 0.5,
        };
        let mut memory = 0.0;
        let forces = [0.0, -8.0, 2.0, 0.0, 3.0].map(|planned| error.step(&mut memory, planned));
        assert_eq!(forces, [0.0, 8.0, 4.0, 2.0, 3.0]);
    }
}
