//! The default observer: the load alone, driven by the measured motion of the actuator.
//!
//! States `r_1 v_1 … r_N v_N q_1 q_2 d`: position of each load relative to the actuator and its
//! velocity, the lags of the two force observers, and the disturbance on the actuator that the reaction
//! force cannot be told from (friction). `S = 2 N + 3`; another number does not compile:
//!
//! ```compile_fail
//! use arso_core::observer::{Anchored, LinearObserver};
//! const OBSERVER: Anchored<3, 8> =
//!     Anchored::new(LinearObserver::new([[0.0; 8]; 8], [0.0; 8], [0.0; 8], [0.0; 8]));
//! ```
//!
//! The input `u` is the mean velocity over the last period, `(x_k − x_{k−1}) / T`: no filter, and
//! quantisation does not add up. The output is `q_2`. Being relative, it does not care where on the axis
//! the drive stands, and there is no rigid motion to be observed: that is measured.

use super::{Estimate, LinearObserver, Seen, StateObserver};
use crate::check::SettingsError;
use crate::units::{Force, Position};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// Coefficients; the input is per m/s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anchored<const N: usize, const S: usize>(LinearObserver<S>);

impl<const N: usize, const S: usize> Anchored<N, S> {
    const STATES: () = assert!(S == 2 * N + 3, "an anchored observer has 2 N + 3 states");

    /// From the coefficients that a design found.
    #[must_use]
    pub const fn new(coefficients: LinearObserver<S>) -> Self {
        let () = Self::STATES;
        Self(coefficients)
    }
}

impl<const N: usize, const S: usize> StateObserver<N> for Anchored<N, S> {
    const FORM: u8 = 0;

    type Memory = SVector<f32, S>;

    fn check(&self) -> Result<(), SettingsError> {
        let () = Self::STATES;
        self.0.check()
    }

    fn same(&self, copy: &Self, part: usize) -> bool {
        self.0.same(&copy.0, part)
    }

    fn at_rest(&self, disturbance: Force) -> Self::Memory {
        // What holds the actuator has passed both lags.
        SVector::from_fn(|row, _| if row < 2 * N { 0.0 } else { disturbance.0 })
    }

    /// No state is a position on the axis.
    fn shift(&self, _: &mut Self::Memory, _: Position) {}

    fn step(&self, z: &mut Self::Memory, seen: &Seen) -> Estimate<N> {
        let innovation = self.0.step(z, seen.mean_velocity.0, seen.reaction_force);
        Estimate {
            position: seen.position,
            velocity: seen.velocity,
            deflection: core::array::from_fn(|load| z[2 * load]),
            load_velocity: core::array::from_fn(|load| z[2 * load + 1]),
            disturbance: Force(z[S - 1]),
            innovation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Current, Velocity};

    /// One load on a spring, no correction: an undamped oscillator driven by the actuator's velocity,
    /// whose discrete transition is known in closed form.
    #[test]
    fn prediction_is_the_exact_motion_of_a_load_on_a_moving_actuator() {
        let (omega, t) = (60.0_f32, 1e-3_f32);
        let (sin, cos) = (libm::sinf(omega * t), libm::cosf(omega * t));
        let mut transition = [[0.0; 5]; 5];
        transition[0] = [cos, sin / omega, 0.0, 0.0, 0.0];
        transition[1] = [-omega * sin, cos, 0.0, 0.0, 0.0];
        // dr/dt = v − v_a: response to a held v_a.
        let input = [-sin / omega, 1.0 - cos, 0.0, 0.0, 0.0];
        let output = [0.0, 0.0, 0.0, 1.0, 0.0];
        let observer =
            Anchored::<1, 5>::new(LinearObserver::new(transition, input, output, [0.0; 5]));
        let mut memory = observer.at_rest(Force(0.0));
        // Actuator starts at constant velocity: the load's velocity is v (1 − cos ωt).
        let velocity = 0.2;
        for k in 1..=300 {
            let seen = Seen {
                position: Position(velocity * t * k as f32),
                mean_velocity: Velocity(velocity),
                velocity: Velocity(velocity),
                current: Current(0.0),
                reaction_force: Force(0.0),
            };
            let estimate = observer.step(&mut memory, &seen);
            let angle = omega * t * k as f32;
            assert!(
                (estimate.load_velocity[0] - velocity * (1.0 - libm::cosf(angle))).abs() < 2e-5
            );
            assert!((estimate.deflection[0] + velocity / omega * libm::sinf(angle)).abs() < 1e-6);
        }
    }
}
