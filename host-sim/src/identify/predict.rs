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
use crate::linear::dlqe::dlqe;
use crate::linear::zoh::zero_order_hold;
use crate::machine::{Mechanics, Motion};
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
    let mut output = RowDVector::zeros(n + 1);
    output[0] = 1.0;
    let correction = dlqe(&a, &transition, &output, &densities, 1.0, log.period).ok()?;

    let mechanics = Mechanics::of_chain(&machine.chain, machine.coulomb);
    let mut motion = Motion::new(&mechanics, log.period);
    for position in motion.state_mut().iter_mut().step_by(2) {
        *position = origin * scale;
    }
    let mut wander = 0.0;
    let mut result = Vec::with_capacity(log.current.len());
    for (current, measured) in log.current.iter().zip(&log.position[1..]) {
        motion.advance(chain.force_constant * current + wander);
        let innovation = measured - motion.state()[0];
        motion
            .state_mut()
            .axpy(innovation, &correction.rows(0, n), 1.0);
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
    let mechanics = Mechanics::of_chain(&machine.chain, machine.coulomb);
    let mut motion = Motion::new(&mechanics, log.period);
    let mut result = vec![0.0];
    for current in &log.current {
        motion.advance(machine.chain.force_constant * current);
        result.push(motion.state()[0]);
    }
    result
}
