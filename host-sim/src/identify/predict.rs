//! What a machine should have done: one-step predictions of the encoder, and the pure simulation.
//!
//! A simulation that is never corrected drifts: the actuator integrates every newton that the model
//! lacks twice. So the fit is to the innovations of a steady-state Kalman filter on the encoder, with a
//! random force on the actuator (amplifier noise) and a force that wanders slowly (whatever else the
//! model lacks). With little noise that is the output error, with much of it the error of one step; how
//! much there is, is identified too: over both densities, as over everything else, the innovations are
//! least where the model is right, and then they are white.

use super::log::Log;
use super::parameters::Machine;
use crate::design::discretise::{cost_integral, zero_order_hold};
use crate::design::riccati;
use nalgebra::{DMatrix, DVector, RowDVector};

/// Densities of the random force, N/√Hz, and of the wandering force, N/√s, over the standard deviation
/// of the measurement in m, as logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Noise {
    /// Of the random force.
    pub(super) force: f64,
    /// Of the wandering force.
    pub(super) wander: f64,
}

/// Parts of a period in which friction is resolved where the actuator may stick.
const SUBSTEPS: u32 = 20;

/// The chain with Coulomb friction, advanced over control periods; `f64` and no allocation per step.
struct Motion {
    coulomb: f64,
    force_constant: f64,
    transition: DMatrix<f64>,
    response: DVector<f64>,
    fine_transition: DMatrix<f64>,
    fine_response: DVector<f64>,
    state: DVector<f64>,
    next: DVector<f64>,
}

impl Motion {
    fn new(machine: &Machine, period: f64) -> Self {
        let chain = &machine.chain;
        let (a, b) = (chain.a(), chain.force_input(0));
        let (transition, response) = zero_order_hold(&a, &b, period);
        let (fine_transition, fine_response) =
            zero_order_hold(&a, &b, period / f64::from(SUBSTEPS));
        Self {
            coulomb: machine.coulomb,
            force_constant: chain.force_constant,
            transition,
            response,
            fine_transition,
            fine_response,
            state: DVector::zeros(chain.states()),
            next: DVector::zeros(chain.states()),
        }
    }

    /// One period under a held current and a further force on the actuator. As the simulated plant does
    /// it: at once while the actuator slides, in steps where it may turn round or stick.
    fn advance(&mut self, current: f64, force: f64) {
        let motor = self.force_constant * current + force;
        let before = self.state[1];
        let sliding = motor - self.coulomb * before.signum();
        self.next.gemv(1.0, &self.transition, &self.state, 0.0);
        self.next.axpy(sliding, &self.response, 1.0);
        let change = (self.next[1] - before).abs();
        if self.coulomb == 0.0 || change < before.abs().min(self.next[1].abs()) {
            std::mem::swap(&mut self.state, &mut self.next);
            return;
        }
        for _ in 0..SUBSTEPS {
            let before = self.state[1];
            self.next.gemv(1.0, &self.fine_transition, &self.state, 0.0);
            self.next.axpy(motor, &self.fine_response, 1.0);
            let friction = self.friction(before, self.next[1]);
            self.next.axpy(friction, &self.fine_response, 1.0);
            std::mem::swap(&mut self.state, &mut self.next);
        }
    }

    /// Friction over one part of a period, from the velocity at its beginning and what it would be at
    /// the end without friction: sliding, holding, or turned round in between, in which case it is the
    /// mean of both directions over the times they last.
    fn friction(&self, before: f64, without: f64) -> f64 {
        let limit = self.coulomb;
        let per_newton = self.fine_response[1];
        if before != 0.0 {
            let against = -limit * before.signum();
            let after = without + against * per_newton;
            if after * before > 0.0 {
                return against;
            }
            let drive = (without - before) / per_newton;
            if drive.abs() > limit {
                let share = before / (before - after);
                return against * (2.0 * share - 1.0);
            }
        }
        // Negative friction, tried by a fit, pushes instead.
        (-without / per_newton).clamp(-limit.abs(), limit.abs()) * limit.signum()
    }
}

/// Innovations of the filter over a log, in standard deviations of `scale`; none when there is no
/// filter.
///
/// * `origin`: true position at the first sample, which itself is read with noise, in units of `scale`
/// * `scale`: what one unit of innovation is, m
pub(super) fn innovations(
    log: &Log,
    machine: &Machine,
    noise: Noise,
    (origin, scale): (f64, f64),
) -> Option<Vec<f64>> {
    let chain = &machine.chain;
    let n = chain.states();
    let mut a = DMatrix::zeros(n + 1, n + 1);
    a.view_mut((0, 0), (n, n)).copy_from(&chain.a());
    a.view_mut((0, n), (n, 1)).copy_from(&chain.force_input(0));
    let mut densities = DMatrix::zeros(n + 1, n + 1);
    densities[(1, 1)] = (2.0 * noise.force).exp() / chain.mass[0].powi(2);
    densities[(n, n)] = (2.0 * noise.wander).exp();
    let (transition, _) = zero_order_hold(&a, &DVector::zeros(n + 1), log.period);
    let process = cost_integral(&a.transpose(), &densities, log.period);
    let mut output = RowDVector::zeros(n + 1);
    output[0] = 1.0;
    let solution = riccati::solve(
        &transition.transpose(),
        &output.transpose(),
        &process,
        &DVector::zeros(n + 1),
        1.0,
    )
    .ok()?;
    let variance = solution.x[(0, 0)] + 1.0;
    let correction = solution.x.column(0) / variance;

    let mut motion = Motion::new(machine, log.period);
    for position in motion.state.iter_mut().step_by(2) {
        *position = origin * scale;
    }
    let mut wander = 0.0;
    let mut result = Vec::with_capacity(log.current.len());
    for (current, measured) in log.current.iter().zip(&log.position[1..]) {
        motion.advance(*current, wander);
        let innovation = measured - motion.state[0];
        motion.state.axpy(innovation, &correction.rows(0, n), 1.0);
        wander += correction[n] * innovation;
        if !innovation.is_finite() {
            return None;
        }
        result.push(innovation / scale);
    }
    Some(result)
}

/// Position of the actuator in a simulation that is never corrected, m.
pub(super) fn simulation(log: &Log, machine: &Machine) -> Vec<f64> {
    let mut motion = Motion::new(machine, log.period);
    let mut result = vec![0.0];
    for current in &log.current {
        motion.advance(*current, 0.0);
        result.push(motion.state[0]);
    }
    result
}
