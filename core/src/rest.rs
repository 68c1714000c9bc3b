//! Whether the actuator is at rest: it has stayed within a few counts for a while.

use crate::units::Position;

/// Counts within which the encoder stands still.
const REST_COUNTS: f32 = 2.5;
/// Counts within which it stays when the loop may be closed: what is slower is caught by the loop.
const START_COUNTS: f32 = 50.0;
/// How long it must stand still, s.
const REST_TIME: f32 = 0.05;

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rest {
    sample_time: f32,
    resolution: f32,
}

/// Where it was last seen to move, and for how many periods it has not.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory {
    anchor: f32,
    still: u32,
}

impl Memory {
    /// It has been shown to be at rest there.
    pub(crate) fn proven(position: Position) -> Self {
        Self {
            anchor: position.0,
            still: u32::MAX,
        }
    }

    /// Nothing is known but where it is.
    pub(crate) fn at(position: Position) -> Self {
        Self {
            anchor: position.0,
            still: 0,
        }
    }
}

impl Rest {
    /// * `resolution`: m per count
    /// * `sample_time`: s
    pub(crate) fn new(resolution: f32, sample_time: f32) -> Self {
        Self {
            sample_time,
            resolution,
        }
    }

    /// One period: whether the actuator is at rest.
    pub(crate) fn step(&self, memory: &mut Memory, position: Position) -> bool {
        self.within(memory, position, REST_COUNTS)
    }

    /// One period: whether the actuator is slow enough for the loop to be closed.
    pub(crate) fn may_start(&self, memory: &mut Memory, position: Position) -> bool {
        self.within(memory, position, START_COUNTS)
    }

    /// The same for an actuator that moves by as many counts where it stands.
    pub(crate) fn within(&self, memory: &mut Memory, position: Position, counts: f32) -> bool {
        if (position.0 - memory.anchor).abs() <= counts * self.resolution {
            memory.still = memory.still.saturating_add(1);
        } else {
            *memory = Memory::at(position);
        }
        self.rested(memory)
    }

    /// Whether it was at rest in the last period.
    pub(crate) fn rested(&self, memory: &Memory) -> bool {
        memory.still as f32 * self.sample_time >= REST_TIME
    }
}
