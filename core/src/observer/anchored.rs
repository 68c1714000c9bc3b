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
//! Loads act on loads and on both lags, but lags and disturbance on no load, and the first lag not on the disturbance:
//!
//! ```text
//!         loads  q_1  q_2   d
//! loads     x     0    0    0
//! q_1       x     x    0    x        the change over a period, F − 1
//! q_2       x     x    x    x
//! d         0     0    0    x
//! ```
//!
//! What is zero is not multiplied: of 81 products with three loads 55 are left, of 225 with six 175.
//!
//! The input `u` is the mean velocity over the last period, `(x_k − x_{k−1}) / T`: no filter, and
//! quantisation does not add up. The output is `q_2`. Being relative, it does not care where on the axis
//! the drive stands, and there is no rigid motion to be observed: that is measured.

use super::{Estimate, LinearObserver, Seen, StateObserver};
use crate::check::SettingsError;
use crate::units::{Force, Position, Velocity};
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

    /// Whether what is not multiplied is zero, and the output is `q_2`.
    fn has_structure(&self) -> bool {
        let LinearObserver { change, output, .. } = &self.0;
        let [q1, q2, d] = [S - 3, S - 2, S - 1];
        let zero = |row: usize, column: usize| match row {
            row if row < q1 => column >= q1,
            row if row == q1 => column == q2,
            row if row == q2 => false,
            _ => column < d,
        };
        let mut elements = (0..S).flat_map(|row| (0..S).map(move |column| (row, column)));
        let changes = elements.all(|at| !zero(at.0, at.1) || change[at] == 0.0);
        let mut outputs = output.iter().enumerate();
        changes && outputs.all(|(state, c)| *c == f32::from(u8::from(state == q2)))
    }

    /// Predicts and corrects the state `z`, as [`LinearObserver`] does; the innovation.
    #[inline]
    fn predict_and_correct(
        &self,
        z: &mut SVector<f32, S>,
        Velocity(input): Velocity,
        Force(reaction_force): Force,
    ) -> f32 {
        let LinearObserver { change, .. } = &self.0;
        let [q1, q2, d] = [S - 3, S - 2, S - 1];
        // Summed up before it comes to the state: what is small is not rounded as what is large.
        let mut sum = (self.0.input * input).data.0[0];
        // Columns as arrays, whose length the compiler knows: as views its loops cost ten times as much from five loads on.
        for (column, z) in change.data.0.iter().zip(z.iter()).take(q1) {
            for (sum, change) in sum.iter_mut().zip(column).take(d) {
                *sum += change * z;
            }
        }
        sum[q1] += change[(q1, q1)] * z[q1] + change[(q1, d)] * z[d];
        sum[q2] += change[(q2, q1)] * z[q1] + change[(q2, q2)] * z[q2] + change[(q2, d)] * z[d];
        sum[d] += change[(d, d)] * z[d];
        let predicted = *z + SVector::from(sum);
        let innovation = reaction_force - predicted[q2];
        *z = predicted + self.0.correction * innovation;
        innovation
    }
}

impl<const N: usize, const S: usize> StateObserver<N> for Anchored<N, S> {
    const FORM: u8 = 0;

    type Memory = SVector<f32, S>;

    fn check(&self) -> Result<(), SettingsError> {
        let () = Self::STATES;
        self.0.check()?;
        if self.has_structure() {
            Ok(())
        } else {
            Err(SettingsError::Structure)
        }
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
        let innovation = self.predict_and_correct(z, seen.mean_velocity, seen.reaction_force);
        Estimate {
            position: seen.position,
            velocity: seen.velocity,
            deflection: core::array::from_fn(|load| z[2 * load]),
            load_velocity: core::array::from_fn(|load| z[2 * load + 1]),
            disturbance: Force(z[S - 1]),
            innovation: Force(innovation),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::units::Current;
    use nalgebra::SMatrix;
    use proptest::prelude::*;

    /// One load on a spring of natural frequency `omega`, rad/s, without damping and correction: change and input over a
    /// period, whose closed forms are known.
    fn oscillator(omega: f64, period: f64) -> ([[f32; 5]; 5], [f32; 5]) {
        let angle = omega * period;
        // cos − 1, without the loss of what is small beside one.
        let turned = -2.0 * libm::sin(0.5 * angle).powi(2);
        let sin = libm::sin(angle);
        let mut change = [[0.0; 5]; 5];
        change[0][..2].copy_from_slice(&[turned, sin / omega].map(|x| x as f32));
        change[1][..2].copy_from_slice(&[-omega * sin, turned].map(|x| x as f32));
        // dr/dt = v − v_a: response to a held v_a.
        let input = [-sin / omega, -turned, 0.0, 0.0, 0.0].map(|x| x as f32);
        (change, input)
    }

    /// A second of an undamped oscillation, at 20 kHz as at 1 kHz: neither its frequency nor its amplitude is lost to
    /// rounding. (With the transition in place of the change it is off by 30 times as much at 20 kHz.)
    #[test]
    fn prediction_is_the_exact_motion_of_a_load_on_a_moving_actuator() {
        for (omega, period) in [(60.0, 1e-3), (75.0, 1e-4), (75.0, 5e-5), (228.0, 5e-5)] {
            let (change, input) = oscillator(omega, period);
            let output = [0.0, 0.0, 0.0, 1.0, 0.0];
            let observer =
                Anchored::<1, 5>::new(LinearObserver::new(change, input, output, [0.0; 5]));
            observer.check().unwrap();
            let mut memory = observer.at_rest(Force(0.0));
            // Actuator starts at constant velocity: the load's velocity is v (1 − cos ωt).
            let velocity = 0.2;
            let (mut off, mut off_velocity) = (0.0_f64, 0.0_f64);
            for k in 1..=(1.0 / period) as u32 {
                let time = period * f64::from(k);
                let seen = Seen {
                    position: Position((velocity * time) as f32),
                    mean_velocity: Velocity(velocity as f32),
                    velocity: Velocity(velocity as f32),
                    current: Current(0.0),
                    reaction_force: Force(0.0),
                };
                let estimate = observer.step(&mut memory, &seen);
                let moved = velocity * (1.0 - libm::cos(omega * time));
                let deflected = -velocity / omega * libm::sin(omega * time);
                off_velocity =
                    off_velocity.max((f64::from(estimate.load_velocity[0]) - moved).abs());
                off = off.max((f64::from(estimate.deflection[0]) - deflected).abs());
            }
            assert!(
                off_velocity < 2e-5 * velocity,
                "{omega} {period}: {off_velocity}"
            );
            assert!(off < 2e-5 * velocity / omega, "{omega} {period}: {off}");
        }
    }

    const SIZE: usize = 7;

    /// Elements that may differ from zero, by the table above.
    fn structured(elements: [[f32; SIZE]; SIZE]) -> [[f32; SIZE]; SIZE] {
        let mask = [
            [1, 1, 1, 1, 0, 0, 0],
            [1, 1, 1, 1, 0, 0, 0],
            [1, 1, 1, 1, 0, 0, 0],
            [1, 1, 1, 1, 0, 0, 0],
            [1, 1, 1, 1, 1, 0, 1],
            [1, 1, 1, 1, 1, 1, 1],
            [0, 0, 0, 0, 0, 0, 1],
        ];
        let kept = |row: usize, column: usize| elements[row][column] * mask[row][column] as f32;
        core::array::from_fn(|row| core::array::from_fn(|column| kept(row, column)))
    }

    fn element() -> impl Strategy<Value = f32> {
        (-1.0_f32..1.0).prop_filter("differs from zero", |x| *x != 0.0)
    }

    proptest! {
        /// All products, those with zero too, in double precision.
        #[test]
        fn nothing_is_left_out(
            elements in prop::array::uniform7(prop::array::uniform7(element())),
            start in prop::array::uniform7(element()),
            (input, correction) in (prop::array::uniform7(element()), prop::array::uniform7(element())),
            (velocity, force) in (element(), element()),
        ) {
            let change = structured(elements);
            let mut output = [0.0; SIZE];
            output[SIZE - 2] = 1.0;
            let observer = Anchored::<2, SIZE>::new(LinearObserver::new(change, input, output, correction));
            prop_assert_eq!(observer.check(), Ok(()));
            let mut z = SVector::from(start);
            let innovation = observer.predict_and_correct(&mut z, Velocity(velocity), Force(force));

            let wide = |x: [f32; SIZE]| SVector::from(x.map(f64::from));
            let rows = change.map(|row| wide(row).transpose());
            let f = SMatrix::from_rows(&rows) + SMatrix::identity();
            let predicted: SVector<f64, SIZE> = f * wide(start) + wide(input) * f64::from(velocity);
            let expected = f64::from(force) - predicted[SIZE - 2];
            let corrected = predicted + wide(correction) * expected;
            prop_assert!((f64::from(innovation) - expected).abs() < 1e-5);
            for (z, expected) in z.iter().zip(corrected.iter()) {
                prop_assert!((f64::from(*z) - expected).abs() < 1e-5);
            }
        }

        /// What would not be multiplied is refused.
        #[test]
        fn what_has_another_structure_is_refused(
            (row, column) in (0..SIZE, 0..SIZE), value in element(), state in 0..SIZE,
        ) {
            let mut output = [0.0; SIZE];
            output[SIZE - 2] = 1.0;
            let checked = |change, output| {
                Anchored::<2, SIZE>::new(LinearObserver::new(change, [0.0; SIZE], output, [0.0; SIZE])).check()
            };
            let mut change = [[0.0; SIZE]; SIZE];
            change[row][column] = value;
            let fits = structured(change) == change;
            prop_assert_eq!(checked(change, output).is_ok(), fits);
            output[state] += value;
            prop_assert_eq!(checked([[0.0; SIZE]; SIZE], output), Err(SettingsError::Structure));
        }
    }
}
