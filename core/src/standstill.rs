//! The rule for rest: what the integrating part of the loop may do while the machine ought to stand.
//!
//! The disturbance state integrates: against stiction and a coarse encoder it would push for ever, slip,
//! and push the other way. So what it finds is compensated as it comes while the reference moves and for a
//! while after; where the machine then stands within the tolerance the compensation is held, and there is
//! nothing left in the loop that integrates. Farther away it follows slowly: slowly enough that friction
//! lets go of the machine without a leap.

use crate::check::{SettingsError, not_negative, positive};
use crate::units::{Force, Position};
use serde::{Deserialize, Serialize};

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Standstill {
    /// How far from the target the actuator may stand, m.
    pub tolerance: f32,
    /// How long after the reference has come to rest the compensation follows at once, periods.
    pub settling: u32,
    /// Share of the way to what is found that it follows in a period after that.
    pub rate: f32,
}

/// What is kept from one period to the next.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory {
    compensation: f32,
    /// Periods since the reference came to rest.
    rested: u32,
    /// Whether it is held.
    holds: bool,
}

impl Memory {
    /// At rest under a steady force.
    pub(crate) fn at_rest(force: Force) -> Self {
        Self {
            compensation: force.0,
            rested: 0,
            holds: false,
        }
    }
}

/// Share of the tolerance within which the compensation begins to be held.
const NEAR: f32 = 0.5;

impl Standstill {
    /// One period: the force that is compensated.
    ///
    /// * `rests`: whether the reference does
    /// * `error`: of the actuator
    /// * `found`: the disturbance that the observer finds
    pub(crate) fn step(
        &self,
        memory: &mut Memory,
        rests: bool,
        error: Position,
        found: Force,
    ) -> Force {
        memory.rested = if rests {
            memory.rested.saturating_add(1)
        } else {
            0
        };
        if memory.rested <= self.settling {
            memory.holds = false;
            memory.compensation = found.0;
            return found;
        }
        let near = if memory.holds { 1.0 } else { NEAR };
        // Written so that what is no number is not held.
        memory.holds = error.0.abs() <= near * self.tolerance;
        if !memory.holds {
            memory.compensation += self.rate * (found.0 - memory.compensation);
        }
        Force(memory.compensation)
    }

    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        positive("standstill.tolerance", self.tolerance)?;
        not_negative("standstill.rate", self.rate)
    }
}
