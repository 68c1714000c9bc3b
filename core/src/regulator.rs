//! Constant-gain state feedback to a reference, eq. (13): `i = −K (x_hat − x_ref)`.
//!
//! The state is taken relative to the reference from the start (`e = x_a − x_ref`, loads
//! `r_i + e`), so that the place on the axis costs no accuracy.

use crate::check::{SettingsError, finite};
use crate::moves::Reference;
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
    /// Current that brings every mass to its reference, without the feed-forward.
    #[must_use]
    pub fn step(&self, estimate: &Estimate<N>, reference: &Reference<N>) -> Current {
        let error = estimate.position.0 - reference.position.0;
        let mut current = self.actuator.position * error
            + self.actuator.velocity * (estimate.velocity.0 - reference.velocity.0);
        let loads = self.loads.iter().enumerate();
        for (load, gain) in loads {
            // Each at its own place in the chain, which moves with the actuator.
            let deflection = estimate.deflection[load] - reference.deflection[load];
            let velocity = estimate.load_velocity[load] - reference.load_velocity[load];
            current += gain.position * (deflection + error) + gain.velocity * velocity;
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
        self.step(&rigid, &Reference::default())
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
            position: Position(1.01),
            velocity: Velocity(0.3),
            deflection: [0.002, -0.001],
            load_velocity: [0.2, 0.5],
            disturbance: Force(7.0),
            innovation: Force(0.0),
        };
        let rigid = Reference::rigid(Position(1.0), Velocity(0.1), Current(9.0));
        let current = regulator.step(&estimate, &rigid);
        let expected =
            59.0 * 0.01 + 1.1 * 0.2 - 27.0 * 0.012 + 0.06 * 0.1 - 6.9 * 0.009 + 0.16 * 0.4;
        assert!((current.0 + expected).abs() < 1e-5);
        // A reference of its own for each mass.
        let flexible = Reference {
            deflection: [0.001, 0.0],
            load_velocity: [0.1, 0.6],
            ..rigid
        };
        let current = regulator.step(&estimate, &flexible);
        let expected = expected + 27.0 * 0.001 - 0.16 * 0.5;
        assert!((current.0 + expected).abs() < 1e-5);
    }
}
