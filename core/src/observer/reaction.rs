//! Eq. (17) as printed: the whole free chain, driven by the current. For comparison only.
//!
//! States `x_a v_a x_1 v_1 … x_N v_N`, `u` the applied current, output `k (x_a − x_1) + c (v_a − v_1)`.
//! `S = 2 N + 2`; another number does not compile. Its rigid motion makes no reaction force, so it is
//! not observed and drifts under any force that the model lacks.

use super::{Estimate, LinearObserver, Seen, StateObserver};
use crate::check::SettingsError;
use crate::units::{Force, Position, Velocity};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// Coefficients; the input is per A.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reaction<const N: usize, const S: usize>(LinearObserver<S>);

impl<const N: usize, const S: usize> Reaction<N, S> {
    const STATES: () = assert!(S == 2 * N + 2, "a reaction observer has 2 N + 2 states");

    /// From the coefficients that a design found.
    #[must_use]
    pub const fn new(coefficients: LinearObserver<S>) -> Self {
        let () = Self::STATES;
        Self(coefficients)
    }
}

impl<const N: usize, const S: usize> StateObserver<N> for Reaction<N, S> {
    const FORM: u8 = 1;

    type Memory = SVector<f32, S>;

    fn check(&self) -> Result<(), SettingsError> {
        let () = Self::STATES;
        self.0.check()
    }

    fn same(&self, copy: &Self, part: usize) -> bool {
        self.0.same(&copy.0, part)
    }

    /// It knows no disturbance.
    fn at_rest(&self, _: Force) -> Self::Memory {
        SVector::zeros()
    }

    fn shift(&self, z: &mut Self::Memory, distance: Position) {
        for position in z.iter_mut().step_by(2) {
            *position -= distance.0;
        }
    }

    fn step(&self, z: &mut Self::Memory, seen: &Seen) -> Estimate<N> {
        let innovation = self.0.step(z, seen.current.0, seen.reaction_force);
        Estimate {
            position: Position(z[0]),
            velocity: Velocity(z[1]),
            deflection: core::array::from_fn(|load| z[2 * load + 2] - z[0]),
            load_velocity: core::array::from_fn(|load| z[2 * load + 3]),
            disturbance: Force(0.0),
            innovation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Current;

    /// The correction is the gain times what the output lacks.
    #[test]
    fn correction_uses_the_predicted_output() {
        let observer = Reaction::<1, 4>::new(LinearObserver::new(
            [[0.0; 4]; 4],
            [0.0; 4],
            [2.0, 0.0, -2.0, 0.0],
            [0.1, 0.2, 0.3, 0.4],
        ));
        let mut memory = observer.at_rest(Force(1.0));
        observer.shift(&mut memory, Position(-0.5));
        let seen = Seen {
            position: Position(0.0),
            mean_velocity: Velocity(0.0),
            velocity: Velocity(0.0),
            current: Current(0.0),
            reaction_force: Force(3.0),
        };
        let estimate = observer.step(&mut memory, &seen);
        // Output of the state at rest is zero, so the innovation is 3 N.
        assert!((estimate.position.0 - 0.8).abs() < 1e-6);
        assert!((estimate.velocity.0 - 0.6).abs() < 1e-6);
        assert!((estimate.deflection[0] - 0.6).abs() < 1e-6);
        assert!((estimate.load_velocity[0] - 1.2).abs() < 1e-6);
    }
}
