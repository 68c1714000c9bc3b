//! Moves: where every mass ought to be in each period, and the current that takes it there.
//!
//! The corridor asks for a [`Reference`] in each period and does not know what makes it; today that is
//! [`rigid`].

pub mod rigid;

use crate::units::{Current, Position, Velocity};

/// Where every mass ought to be in one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference<const N: usize> {
    /// Position of the actuator.
    pub position: Position,
    /// Velocity of the actuator.
    pub velocity: Velocity,
    /// Position of each load relative to the actuator, m.
    pub deflection: [f32; N],
    /// Velocity of each load, m/s.
    pub load_velocity: [f32; N],
    /// Feed-forward current `i_ff`.
    pub feed_forward: Current,
}

impl<const N: usize> Reference<N> {
    /// Every mass moves as the actuator does.
    #[must_use]
    pub fn rigid(position: Position, velocity: Velocity, feed_forward: Current) -> Self {
        Self {
            position,
            velocity,
            deflection: [0.0; N],
            load_velocity: [velocity.0; N],
            feed_forward,
        }
    }
}

/// At rest at the origin.
impl<const N: usize> Default for Reference<N> {
    fn default() -> Self {
        Self::rigid(Position(0.0), Velocity(0.0), Current(0.0))
    }
}
