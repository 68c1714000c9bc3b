//! Whether the current is at its limit for longer than a move can need.

use super::Trip;
use crate::fault::Fault;
use crate::limits::Limits;
use crate::units::Current;

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Saturation {
    /// A
    nearly: f32,
    sample_time: f32,
    periods: u32,
}

impl Saturation {
    /// * `longest`, `sample_time`: s
    pub(super) fn new(limits: &Limits, longest: f32, sample_time: f32) -> Self {
        Self {
            // A step of the output and a rounding below the limit is at it.
            nearly: 0.999 * limits.current_limit - limits.current_resolution,
            sample_time,
            periods: (longest / sample_time) as u32,
        }
    }

    /// The memory is for how many periods the current has been at its limit.
    pub(super) fn step(self, memory: &mut u32, current: Current) -> Result<(), Trip> {
        if current.0.abs() < self.nearly {
            *memory = 0;
            return Ok(());
        }
        *memory = memory.saturating_add(1);
        if *memory <= self.periods {
            return Ok(());
        }
        Err(Trip {
            fault: Fault::Saturated,
            value: *memory as f32 * self.sample_time,
        })
    }
}
