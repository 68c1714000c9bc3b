//! Protection: what is watched in every period in which current may flow.
//!
//! A file per watch, each with one job: it sees a period and says whether its fault is there. A new one
//! is a file, a field here and a row in [`fault`](crate::fault).

mod applied_current;
mod encoder_jump;

use crate::encoder::Reading;
use crate::fault::Fault;
use crate::limits::Limits;
use crate::units::Current;
use applied_current::AppliedCurrent;

/// All watches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Protection {
    applied_current: AppliedCurrent,
}

impl Protection {
    pub(crate) fn new(limits: &Limits) -> Self {
        Self {
            applied_current: AppliedCurrent::new(limits),
        }
    }

    /// One period: the first fault that is there.
    ///
    /// * `current`: said to have been applied over the period that ends now
    pub(crate) fn step(&self, reading: &Reading, current: Current) -> Option<Fault> {
        encoder_jump::step(reading).or_else(|| self.applied_current.step(current))
    }
}
