//! Action-reaction state observer, eq. (17), and the variant that is the default.
//!
//! Both are linear observers that predict over one period, exactly for a held input, and then
//! correct with the reaction force:
//!
//! ```text
//! z_k|k−1 = F z_k−1 + g u_k        z_k = z_k|k−1 + L (f_reac_hat − c z_k|k−1)
//! ```
//!
//! * [`Form::Anchored`]: the measured motion of the actuator is the input, so only the load is
//!   estimated. States `r_1 v_1 … r_N v_N q_1 q_2 d`: position of each load relative to the
//!   actuator and its velocity, the lags of the two force observers, and the disturbance on the
//!   actuator that the reaction force cannot be told from (friction). `u` is the mean velocity
//!   over the last period, `(x_k − x_{k−1}) / T`: no filter, and quantisation does not add up.
//!   The output is `q_2`. `S = 2 N + 3`.
//! * [`Form::Reaction`]: eq. (17) as printed. States `x_a v_a x_1 v_1 … x_N v_N` of the free
//!   chain, `u` the applied current, output `k (x_a − x_1) + c (v_a − v_1)`. Its rigid motion is
//!   unobservable and drifts under any force the model lacks: for comparison only. `S = 2 N + 2`.
//!
//! Only the coefficients `F, g, c, L` differ; they come from the design
//! ([`ObserverGains`]).

use crate::gains::ObserverGains;
use crate::units::{Current, Force, Position, Velocity};
use nalgebra::{RowSVector, SMatrix, SVector};

/// Which states the observer has and what drives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The load alone, driven by the measured motion of the actuator.
    Anchored,
    /// The whole free chain, driven by the current, eq. (17).
    Reaction,
}

impl Form {
    /// Number of states for `loads` load masses.
    #[must_use]
    pub const fn states(self, loads: usize) -> usize {
        match self {
            Form::Anchored => 2 * loads + 3,
            Form::Reaction => 2 * loads + 2,
        }
    }
}

/// Coefficients of the observer.
#[derive(Clone, Debug, PartialEq)]
pub struct Observer<const N: usize, const S: usize> {
    form: Form,
    rate: f32,
    transition: SMatrix<f32, S, S>,
    input: SVector<f32, S>,
    output: RowSVector<f32, S>,
    correction: SVector<f32, S>,
}

/// State `z` of the observer.
#[derive(Clone, Copy, Debug)]
pub struct State<const S: usize> {
    z: SVector<f32, S>,
}

/// What is known of the actuator in one period.
#[derive(Clone, Copy, Debug)]
pub struct ActuatorMotion {
    /// Measured position, m.
    pub position: Position,
    /// Distance since the sample before, m.
    pub displacement: f32,
    /// Velocity through the disturbance observer's filter, m/s.
    pub velocity: Velocity,
}

/// Estimate of the whole chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<const N: usize> {
    /// Position of the actuator, m.
    pub position: Position,
    /// Velocity of the actuator, m/s.
    pub velocity: Velocity,
    /// Position of each load relative to the actuator, `x_i − x_a`, m.
    pub deflection: [f32; N],
    /// Velocity of each load, m/s.
    pub load_velocity: [f32; N],
    /// Disturbance on the actuator, N; zero where the form has none.
    pub disturbance: Force,
}

impl<const N: usize, const S: usize> Observer<N, S> {
    /// * `gains`: what the design found; `S` fits its form, see
    ///   [`Gains::check`](crate::Gains::check)
    /// * `sample_time`: s
    #[must_use]
    pub fn new(gains: &ObserverGains<S>, sample_time: f32) -> Self {
        Self {
            form: gains.form,
            rate: 1.0 / sample_time,
            transition: SMatrix::<f32, S, S>::from(gains.transition).transpose(),
            input: SVector::from(gains.input),
            output: RowSVector::from_fn(|_, column| {
                gains.output.get(column).copied().unwrap_or(0.0)
            }),
            correction: SVector::from(gains.correction),
        }
    }

    /// The state at rest: every mass at the actuator's position, no force.
    #[must_use]
    pub fn at_rest(&self, position: Position) -> State<S> {
        let mut z = SVector::<f32, S>::zeros();
        if self.form == Form::Reaction {
            for x in z.iter_mut().step_by(2) {
                *x = position.0;
            }
        }
        State { z }
    }

    /// One period.
    ///
    /// * `actuator`: its measured motion
    /// * `current`: current that was applied over the period that ends now
    /// * `reaction_force`: force found by (18)
    pub fn step(
        &self,
        state: &mut State<S>,
        actuator: ActuatorMotion,
        current: Current,
        reaction_force: Force,
    ) -> Estimate<N> {
        let input = match self.form {
            Form::Anchored => actuator.displacement * self.rate,
            Form::Reaction => current.0,
        };
        let predicted = self.transition * state.z + self.input * input;
        let innovation = reaction_force.0 - (self.output * predicted).x;
        state.z = predicted + self.correction * innovation;
        self.estimate(state, actuator)
    }

    fn estimate(&self, state: &State<S>, actuator: ActuatorMotion) -> Estimate<N> {
        let mut z = state.z.iter().copied();
        let mut estimate = Estimate {
            position: actuator.position,
            velocity: actuator.velocity,
            deflection: [0.0; N],
            load_velocity: [0.0; N],
            disturbance: Force(0.0),
        };
        let mut origin = 0.0;
        if self.form == Form::Reaction {
            origin = z.next().unwrap_or(0.0);
            estimate.position = Position(origin);
            estimate.velocity = Velocity(z.next().unwrap_or(0.0));
        }
        let loads = estimate
            .deflection
            .iter_mut()
            .zip(&mut estimate.load_velocity);
        for (deflection, velocity) in loads {
            *deflection = z.next().unwrap_or(0.0) - origin;
            *velocity = z.next().unwrap_or(0.0);
        }
        if self.form == Form::Anchored {
            estimate.disturbance = Force(z.nth(2).unwrap_or(0.0));
        }
        estimate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One load on a spring, no correction, anchored: an undamped oscillator driven by the
    /// actuator's velocity, whose discrete transition is known in closed form.
    #[test]
    fn prediction_is_the_exact_motion_of_a_load_on_a_moving_actuator() {
        let (omega, t) = (60.0_f32, 1e-3_f32);
        let (sin, cos) = (libm::sinf(omega * t), libm::cosf(omega * t));
        let mut transition = [[0.0; 5]; 5];
        transition[0] = [cos, sin / omega, 0.0, 0.0, 0.0];
        transition[1] = [-omega * sin, cos, 0.0, 0.0, 0.0];
        let gains = ObserverGains {
            form: Form::Anchored,
            transition,
            // dr/dt = v − v_a: response to a held v_a.
            input: [-sin / omega, 1.0 - cos, 0.0, 0.0, 0.0],
            output: [0.0, 0.0, 0.0, 1.0, 0.0],
            correction: [0.0; 5],
        };
        let observer = Observer::<1, 5>::new(&gains, t);
        let mut state = observer.at_rest(Position(0.0));
        // Actuator starts at constant velocity: the load's velocity is v (1 − cos ωt).
        let velocity = 0.2;
        for k in 1..=300 {
            let motion = ActuatorMotion {
                position: Position(velocity * t * k as f32),
                displacement: velocity * t,
                velocity: Velocity(velocity),
            };
            let estimate = observer.step(&mut state, motion, Current(0.0), Force(0.0));
            let angle = omega * t * k as f32;
            assert!(
                (estimate.load_velocity[0] - velocity * (1.0 - libm::cosf(angle))).abs() < 2e-5
            );
            assert!((estimate.deflection[0] + velocity / omega * libm::sinf(angle)).abs() < 1e-6);
        }
    }

    /// The correction is the gain times what the output lacks.
    #[test]
    fn correction_uses_the_predicted_output() {
        let mut gains = ObserverGains {
            form: Form::Reaction,
            transition: [[0.0; 4]; 4],
            input: [0.0; 4],
            output: [2.0, 0.0, -2.0, 0.0],
            correction: [0.1, 0.2, 0.3, 0.4],
        };
        for i in 0..4 {
            gains.transition[i][i] = 1.0;
        }
        let observer = Observer::<1, 4>::new(&gains, 1e-3);
        let mut state = observer.at_rest(Position(0.5));
        let motion = ActuatorMotion {
            position: Position(0.0),
            displacement: 0.0,
            velocity: Velocity(0.0),
        };
        let estimate = observer.step(&mut state, motion, Current(0.0), Force(3.0));
        // Output of the state at rest is zero, so the innovation is 3 N.
        assert!((estimate.position.0 - 0.8).abs() < 1e-6);
        assert!((estimate.velocity.0 - 0.6).abs() < 1e-6);
        assert!((estimate.deflection[0] - 0.6).abs() < 1e-6);
        assert!((estimate.load_velocity[0] - 1.2).abs() < 1e-6);
    }
}
