//! Thermal load of the motor, I²t: the mean square of the current over the time in which it heats up.
//!
//! ```text
//! θ_k = θ_k−1 + (i² − θ_k−1) T / τ        θ ≤ continuous²
//! ```

use super::Trip;
use crate::fault::Fault;
use crate::units::Current;

/// Coefficients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Thermal {
    gain: f32,
    /// A²
    limit: f32,
}

impl Thermal {
    /// * `continuous`: A
    /// * `time`, `sample_time`: s
    pub(super) fn new(continuous: f32, time: f32, sample_time: f32) -> Self {
        Self {
            gain: sample_time / time,
            limit: continuous * continuous,
        }
    }

    /// The memory is the mean square of the current, A².
    pub(super) fn step(self, memory: &mut f32, current: Current) -> Result<(), Trip> {
        *memory += self.gain * (current.0 * current.0 - *memory);
        if *memory <= self.limit {
            return Ok(());
        }
        Err(Trip {
            fault: Fault::Thermal,
            // In the unit of its limit.
            value: libm::sqrtf(*memory),
        })
    }
}
