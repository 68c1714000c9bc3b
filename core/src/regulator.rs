//! Constant-gain state feedback, eq. (13): `i = −K x`, with `x` the difference from the reference.
//!
//! The observers see that difference from the start, so that neither the place on the axis nor what a plan
//! does to the machine costs accuracy.

use crate::check::{SettingsError, finite};
use crate::observer::Estimate;
use crate::units::{Current, Force, Position, Velocity};
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

/// The two gains of one mass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MassGain {
    /// A/m
    pub position: f32,
    /// A s/m
    pub velocity: f32,
}

/// Gain `K` of (13), mass by mass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Regulator<const N: usize> {
    /// Gains of the actuator.
    pub actuator: MassGain,
    /// Gains of each load, from the actuator outwards.
    #[serde(with = "BigArray")]
    pub loads: [MassGain; N],
}

impl<const N: usize> Regulator<N> {
    /// `−K x`: current that takes a difference from the reference away.
    #[must_use]
    pub fn step(&self, estimate: &Estimate<N>) -> Current {
        let position = estimate.position.0;
        let mut current =
            self.actuator.position * position + self.actuator.velocity * estimate.velocity.0;
        let loads = self.loads.iter().enumerate();
        for (load, gain) in loads {
            // Each at its own place in the chain, which moves with the actuator.
            current += gain.position * (estimate.deflection[load] + position)
                + gain.velocity * estimate.load_velocity[load];
        }
        Current(-current)
    }

    /// Current that brings an actuator at rest, as if the load were rigid: no observer can upset it.
    ///
    /// * `position`, `velocity`: of the actuator, and so of every mass, relative to where it is to stand
    #[must_use]
    pub(crate) fn brake(&self, position: Position, velocity: Velocity) -> Current {
        let rigid = Estimate {
            position,
            velocity,
            deflection: [0.0; N],
            load_velocity: [velocity.0; N],
            disturbance: Force(0.0),
            innovation: Force(0.0),
        };
        self.step(&rigid)
    }

    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        for gain in core::iter::once(&self.actuator).chain(&self.loads) {
            finite("regulator", [&gain.position, &gain.velocity])?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn current_is_the_scalar_product_of_gain_and_error() {
        let gain = |position, velocity| MassGain { position, velocity };
        let regulator = Regulator {
            actuator: gain(59.0, 1.1),
            loads: [gain(-27.0, 0.06), gain(-6.9, 0.16)],
        };
        let estimate = Estimate {
            position: Position(0.01),
            velocity: Velocity(0.2),
            deflection: [0.002, -0.001],
            load_velocity: [0.1, 0.4],
            disturbance: Force(7.0),
            innovation: Force(0.0),
        };
        let current = regulator.step(&estimate);
        let expected =
            59.0 * 0.01 + 1.1 * 0.2 - 27.0 * 0.012 + 0.06 * 0.1 - 6.9 * 0.009 + 0.16 * 0.4;
        assert!((current.0 + expected).abs() < 1e-5);
    }
}
