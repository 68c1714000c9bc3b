//! Constant-gain state feedback to a reference, eq. (13): `i = −K (x_hat − x_ref)`.
//!
//! The state is taken relative to the reference from the start (`e = x_a − x_ref`, loads
//! `r_i + e`), so that the place on the axis costs no accuracy.

use crate::observer::Estimate;
use crate::units::{Current, Position, Velocity};

/// The two gains of one mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassGain {
    /// A/m
    pub position: f32,
    /// A s/m
    pub velocity: f32,
}

/// Gain `K` of (13), mass by mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regulator<const N: usize> {
    /// Gains of the actuator.
    pub actuator: MassGain,
    /// Gains of each load, from the actuator outwards.
    pub loads: [MassGain; N],
}

impl<const N: usize> Regulator<N> {
    /// Current that brings every mass to `position` at `velocity`.
    #[must_use]
    pub fn step(&self, estimate: &Estimate<N>, position: Position, velocity: Velocity) -> Current {
        let error = estimate.position.0 - position.0;
        let mut current = self.actuator.position * error
            + self.actuator.velocity * (estimate.velocity.0 - velocity.0);
        let loads = estimate.deflection.iter().zip(&estimate.load_velocity);
        for (gain, (deflection, load_velocity)) in self.loads.iter().zip(loads) {
            current +=
                gain.position * (deflection + error) + gain.velocity * (load_velocity - velocity.0);
        }
        Current(-current)
    }

    /// Every gain is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let finite = |gain: &MassGain| gain.position.is_finite() && gain.velocity.is_finite();
        finite(&self.actuator) && self.loads.iter().all(finite)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Force;

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
        };
        let current = regulator.step(&estimate, Position(1.0), Velocity(0.1));
        let expected =
            59.0 * 0.01 + 1.1 * 0.2 - 27.0 * 0.012 + 0.06 * 0.1 - 6.9 * 0.009 + 0.16 * 0.4;
        assert!((current.0 + expected).abs() < 1e-5);
    }
}
