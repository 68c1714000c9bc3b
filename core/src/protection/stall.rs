//! Whether the encoder stands still though the motor's force changes by more than friction can hold.
//!
//! An actuator that stands within two counts is held by friction; friction holds against forces from
//! minus to plus its limit. Where the motor's force has changed by more than that since the encoder last
//! moved, either the encoder is dead or something holds the actuator. A static force that the drive holds
//! does not change, so it does not count.
//!
//! How much friction there is has been seen while the signs were proven, in one place of the axis; elsewhere
//! it may be three times that, and a few thousandths of the motor's force. The setting is the most that it
//! can be.

use super::{Trip, beyond};
use crate::encoder::Reading;
use crate::fault::Fault;
use crate::units::Current;

/// Counts within which the encoder stands still.
const STILL: f32 = 2.0;
/// What friction may be elsewhere: times what was seen, and as a share of the motor's force.
const ELSEWHERE: f32 = 3.0;
const SHARE: f32 = 0.003;

/// Coefficients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stall {
    force_constant: f32,
    /// m
    still: f32,
    /// N
    most: f32,
    share: f32,
}

/// Where the encoder was last seen to move, and the forces since then.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    anchor: f32,
    lowest: f32,
    highest: f32,
    /// N
    limit: f32,
}

impl Stall {
    /// * `stiction`: N
    pub(super) fn new(
        force_constant: f32,
        resolution: f32,
        stiction: f32,
        current_limit: f32,
    ) -> Self {
        Self {
            force_constant,
            still: STILL * resolution,
            most: stiction,
            share: SHARE * force_constant * current_limit,
        }
    }

    /// * `stiction`: what was seen, N
    pub(super) fn begin(self, stiction: Option<f32>) -> Memory {
        let seen = stiction.map_or(self.most, |seen| ELSEWHERE * seen + self.share);
        let most = if seen < self.most { seen } else { self.most };
        Memory {
            limit: 2.0 * most,
            ..Memory::default()
        }
    }

    pub(super) fn step(
        self,
        memory: &mut Memory,
        reading: &Reading,
        current: Current,
    ) -> Result<(), Trip> {
        let force = self.force_constant * current.0;
        let moved = (reading.position.0 - memory.anchor).abs() > self.still;
        if moved {
            *memory = Memory {
                anchor: reading.position.0,
                lowest: force,
                highest: force,
                limit: memory.limit,
            };
            return Ok(());
        }
        // Written out: the library's minimum is a call on this processor.
        if force < memory.lowest {
            memory.lowest = force;
        }
        if force > memory.highest {
            memory.highest = force;
        }
        beyond(Fault::Stalled, memory.highest - memory.lowest, memory.limit)
    }
}
