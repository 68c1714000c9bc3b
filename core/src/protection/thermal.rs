//! Thermal load of the motor, I²t: the mean square of the current over the time in which it heats up.
//!
//! ```text
//! θ_k = θ_k−1 + (i² − θ_k−1) T / τ        θ ≤ continuous²
//! ```
//!
//! The heat is the motor's: it goes on through every mode and no `Start` forgets it. It is judged while the
//! drive runs.

use super::Trip;
use crate::fault::Fault;
use crate::units::Current;

/// Mean square of the current, A².
pub(crate) type Heat = f32;

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
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

    /// One period of any mode.
    pub(super) fn step(self, heat: &mut Heat, current: Current) {
        *heat += self.gain * (current.0 * current.0 - *heat);
    }

    /// How warm the motor is, as a share of what it can take.
    pub(super) fn warmth(self, heat: Heat) -> f32 {
        heat / self.limit
    }

    /// Whether the motor has become too hot.
    pub(super) fn judge(self, heat: Heat) -> Result<(), Trip> {
        if heat <= self.limit {
            return Ok(());
        }
        Err(Trip {
            fault: Fault::Thermal,
            // In the unit of its limit.
            value: libm::sqrtf(heat),
        })
    }
}
