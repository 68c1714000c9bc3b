//! Whether the encoder stands still though the motor's force changes by more than friction can hold.
//!
//! An actuator that stands within two counts is held by friction; friction holds against forces from
//! minus to plus its limit. Where the motor's force has changed by more than that since the encoder last
//! moved, either the encoder is dead or something holds the actuator. A static force that the drive holds
//! does not change, so it does not count.

use super::{Trip, beyond};
use crate::encoder::Reading;
use crate::fault::Fault;
use crate::units::Current;

/// Counts within which the encoder stands still.
const STILL: f32 = 2.0;

/// Coefficients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stall {
    force_constant: f32,
    /// m
    still: f32,
    /// N
    limit: f32,
}

/// Where the encoder was last seen to move, and the forces since then.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    anchor: f32,
    lowest: f32,
    highest: f32,
}

impl Stall {
    /// * `stiction`: N
    pub(super) fn new(force_constant: f32, resolution: f32, stiction: f32) -> Self {
        Self {
            force_constant,
            still: STILL * resolution,
            limit: 2.0 * stiction,
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
        beyond(Fault::Stalled, memory.highest - memory.lowest, self.limit)
    }
}
