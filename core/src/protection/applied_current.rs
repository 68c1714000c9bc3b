//! Whether the current said to be applied can have been applied by this drive.

use super::{Trip, beyond};
use crate::fault::Fault;
use crate::limits::Limits;
use crate::units::Current;

/// Largest plausible magnitude, A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AppliedCurrent {
    largest: f32,
}

impl AppliedCurrent {
    pub(super) fn new(limits: &Limits) -> Self {
        Self {
            // A step of the output for its rounding.
            largest: limits.current_limit + limits.current_resolution,
        }
    }

    pub(super) fn step(self, applied: Current) -> Result<(), Trip> {
        beyond(Fault::AppliedCurrent, applied.0, self.largest).map_err(|trip| {
            if applied.0.is_finite() {
                trip
            } else {
                Fault::NonFinite.into()
            }
        })
    }
}
