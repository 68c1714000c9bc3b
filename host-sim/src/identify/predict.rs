//! What a machine should have done: one-step predictions of the encoder, and the pure simulation.
//!
//! A simulation that is never corrected drifts: the actuator integrates every newton that the model
//! lacks twice. So the fit is to the innovations of a Kalman filter on the encoder, with a random force on
//! the actuator (amplifier noise) and a force that wanders slowly (whatever else the model lacks). With
//! little noise that is the output error, with much of it the error of one step.
//!
//! The filter begins with what is known of the start: everything but the position where the record begins
//! at rest, the position alone where it begins in motion. From there its gain runs into the steady one. An
//! innovation that is wider than the steady one for such a reason weighs less.

use super::log::Log;
use super::parameters::Machine;
use crate::linear::dare;
use crate::machine::{Mechanics, Motion};
use nalgebra::{DMatrix, DVector};

/// Densities of the random force, N/√Hz, and of the wandering force, N/√s, over the standard deviation
/// of the measurement in m, as logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Noise {
    /// Of the random force.
    pub(super) force: f64,
    /// Of the wandering force.
    pub(super) wander: f64,
}

/// Distance from the steady gain, relative to it, at which the gain counts as steady.
const STEADY: f64 = 1e-3;
/// Periods over which the gain runs into the steady one, at most.
const LONGEST: usize = 60;

/// The filter's gain, period by period from the start of a record. States: those of the chain, and the
/// wandering force.
#[derive(Clone, Debug)]
pub(super) struct Gain {
    /// Gains of the first periods, each with the weight of its innovation.
    first: Vec<(DVector<f64>, f64)>,
    steady: DVector<f64>,
}

impl Gain {
    /// None when there is no filter.
    pub(super) fn new(machine: &Machine, noise: Noise, period: f64) -> Option<Self> {
        let chain = &machine.chain;
        let n = chain.states();
        let mut a = DMatrix::zeros(n + 1, n + 1);
        a.view_mut((0, 0), (n, n)).copy_from(&chain.a());
        a.view_mut((0, n), (n, 1)).copy_from(&chain.force_input(0));
        let mut density = DMatrix::zeros(n + 1, n + 1);
        density[(1, 1)] = (2.0 * noise.force).exp() / chain.mass[0].powi(2);
        density[(n, n)] = (2.0 * noise.wander).exp();
        // The noise of a period, as if all of it came in its middle.
        let half = (a * (0.5 * period)).exp();
        let process = &half * density * half.transpose() * period;
        let transition = &half * &half;
        let mut output = DVector::zeros(n + 1);
        output[0] = 1.0;
        let nothing = DVector::zeros(n + 1);
        let solution =
            dare::solve(&transition.transpose(), &output, &process, &nothing, 1.0).ok()?;
        let variance = solution.x[(0, 0)] + 1.0;
        let steady: DVector<f64> = solution.x.column(0) / variance;

        // The first sample is read with the noise of a measurement; at rest all masses are where it is.
        let mut covariance = DMatrix::from_fn(n + 1, n + 1, |i, j| {
            f64::from(u8::from(i < n && j < n && i % 2 == 0 && j % 2 == 0))
        });
        let mut first = Vec::new();
        for _ in 0..LONGEST {
            covariance = &transition * covariance * transition.transpose() + &process;
            let now = covariance[(0, 0)] + 1.0;
            let gain: DVector<f64> = covariance.column(0) / now;
            let row = covariance.row(0).into_owned();
            covariance -= &gain * row;
            let near = gain
                .iter()
                .zip(steady.iter())
                .all(|(now, steady)| (now - steady).abs() <= STEADY * steady.abs());
            if near {
                break;
            }
            first.push((gain, (variance / now).sqrt().min(1.0)));
        }
        Some(Self { first, steady })
    }
}

/// The innovations of a record, and the wandering force that the filter found.
pub(super) struct Prediction {
    /// In units of `scale`, each by its weight.
    pub(super) innovations: Vec<f64>,
    /// N, over each period.
    pub(super) wander: Vec<f64>,
}

/// Innovations of a filter over a log; none when it leaves all bounds.
///
/// * `scale`: what one unit of innovation is, m
pub(super) fn predict(log: &Log, machine: &Machine, gain: &Gain, scale: f64) -> Option<Prediction> {
    let chain = &machine.chain;
    let n = chain.states();
    let mut motion = Motion::new(&Mechanics::of_chain(&machine.chain, machine.coulomb), log.period);
    for position in motion.state_mut().iter_mut().step_by(2) {
        *position = log.position[0];
    }
    let mut wander = 0.0;
    let mut innovations = Vec::with_capacity(log.current.len());
    let mut wanders = Vec::with_capacity(log.current.len());
    for (k, (current, measured)) in log.current.iter().zip(&log.position[1..]).enumerate() {
        motion.advance(chain.force_constant * current + wander);
        wanders.push(wander);
        let innovation = measured - motion.state()[0];
        if !innovation.is_finite() {
            return None;
        }
        let (now, weight) = match gain.first.get(k) {
            Some((now, weight)) => (now, *weight),
            None => (&gain.steady, 1.0),
        };
        motion.state_mut().axpy(innovation, &now.rows(0, n), 1.0);
        wander += now[n] * innovation;
        innovations.push(weight * innovation / scale);
    }
    Some(Prediction {
        innovations,
        wander: wanders,
    })
}

/// Position of the actuator in a simulation that is never corrected, m.
///
/// * `push`: force beside the current's, N, over each period; nothing where it ends
pub(super) fn simulation(log: &Log, machine: &Machine, push: &[f64]) -> Vec<f64> {
    let mut motion = Motion::new(&Mechanics::of_chain(&machine.chain, machine.coulomb), log.period);
    let mut result = vec![0.0];
    for (k, current) in log.current.iter().enumerate() {
        let push = push.get(k).copied().unwrap_or(0.0);
        motion.advance(machine.chain.force_constant * current + push);
        result.push(motion.state()[0]);
    }
    result
}
