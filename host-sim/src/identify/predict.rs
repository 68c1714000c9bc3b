//! What a machine should have done: one-step predictions of the encoder, and the pure simulation.
//!
//! A simulation that is never corrected drifts: the actuator integrates every newton that the model
//! lacks twice. So the fit is to the innovations of a Kalman filter on the encoder, with a random force on
//! the actuator (amplifier noise) and a force that wanders slowly (whatever else the model lacks). With
//! little noise that is the output error, with much of it the error of one step.
//!
//! The filter begins with what is known of the start: everything but the position where the record begins
//! at rest, the position alone where it begins in motion. From there its gain runs into the steady one, and
//! again after a gap, over which the current is not known. An innovation that is wider than the steady one for
//! such a reason weighs less.

use super::log::Log;
use super::parameters::{Machine, RippleKind};
use crate::linear::dare;
use crate::linear::zoh::zero_order_hold;
use crate::machine::Motion;
use crate::machine::motion::PARTS;
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

impl Noise {
    /// More of it by a logarithm of the random force; of the wandering one, which is integrated once more, by half
    /// as much again, so that the filter is faster as a whole.
    pub(super) fn more(self, by: f64) -> Self {
        Self {
            force: self.force + by,
            wander: self.wander + 1.5 * by,
        }
    }
}

/// Distance from the steady gain, relative to it, at which the gain counts as steady.
const STEADY: f64 = 1e-3;
/// Periods over which the gain runs into the steady one, at most: after a rest, and where more is unknown.
const LONGEST: (usize, usize) = (60, 400);
/// Rows from which the velocity at the beginning of a record in motion is taken.
const BEFORE: usize = 10;
/// Longest interval that is no gap, parts of a period.
const REGULAR: u32 = PARTS + PARTS / 2;

/// Gains of some periods, each with the weight of its innovation.
type Run = Vec<(DVector<f64>, f64)>;

/// The filter's gain, period by period from the start of a record. States: those of the chain, and the
/// wandering force.
#[derive(Clone, Debug)]
pub(super) struct Gain {
    start: Run,
    /// After gaps, by their length in parts.
    gaps: Vec<(u32, Run)>,
    steady: DVector<f64>,
}

impl Gain {
    /// None when there is no filter.
    ///
    /// * `force`: that the current may have had over a gap, either way, N
    pub(super) fn new(log: &Log, machine: &Machine, noise: Noise, force: f64) -> Option<Self> {
        let chain = machine.chain();
        let n = chain.states();
        let mut a = DMatrix::zeros(n + 1, n + 1);
        a.view_mut((0, 0), (n, n)).copy_from(&chain.a());
        a.view_mut((0, n), (n, 1)).copy_from(&chain.force_input(0));
        let mut density = DMatrix::zeros(n + 1, n + 1);
        density[(1, 1)] = (2.0 * noise.force).exp() / chain.mass[0].powi(2);
        density[(n, n)] = (2.0 * noise.wander).exp();
        // The noise of a period, as if all of it came in its middle.
        let half = (&a * (0.5 * log.period)).exp();
        let process = &half * density * half.transpose() * log.period;
        let transition = &half * &half;
        let mut output = DVector::zeros(n + 1);
        output[0] = 1.0;
        let nothing = DVector::zeros(n + 1);
        let solution =
            dare::solve(&transition.transpose(), &output, &process, &nothing, 1.0).ok()?;
        let variance = solution.x[(0, 0)] + 1.0;
        let steady: DVector<f64> = solution.x.column(0) / variance;

        // From a covariance after a correction.
        let run = |mut covariance: DMatrix<f64>, longest: usize| {
            let mut run = Run::new();
            for _ in 0..longest {
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
                run.push((gain, (variance / now).sqrt().min(1.0)));
            }
            run
        };
        // The first sample is read with the noise of a measurement; at rest all masses are where it is.
        let mut at_start = DMatrix::from_fn(n + 1, n + 1, |i, j| {
            f64::from(u8::from(i < n && j < n && i % 2 == 0 && j % 2 == 0))
        });
        let mut longest = LONGEST.0;
        if !log.at_rest {
            longest = LONGEST.1;
            let scale = force / log.resolution;
            for mass in 0..n / 2 {
                let stretched = chain
                    .stiffness
                    .get(mass.max(1) - 1)
                    .map_or(0.0, |k| scale / k);
                if mass > 0 {
                    for other in mass..n / 2 {
                        // What stretches a spring moves all behind it.
                        at_start[(2 * other, 2 * other)] += stretched * stretched;
                    }
                }
                let fast = 0.2 * velocity(log) / log.resolution
                    + stretched
                        * (chain.stiffness.first().unwrap_or(&0.0) / chain.mass[mass]).sqrt();
                at_start[(2 * mass + 1, 2 * mass + 1)] = fast * fast + 1.0;
            }
        }
        let start = run(at_start, longest);
        let mut lengths: Vec<u32> = log.parts.iter().copied().filter(|p| *p > REGULAR).collect();
        lengths.sort_unstable();
        lengths.dedup();
        let settled = &solution.x - &steady * solution.x.row(0);
        let gaps = lengths.iter().map(|parts| {
            let time = log.period * f64::from(*parts) / f64::from(PARTS);
            // The last period's current is known.
            let unknown = time - log.period;
            let over = (&a * time).exp();
            let pushed = (&a * unknown).exp() - DMatrix::identity(n + 1, n + 1);
            // Response to a force held: the column of the wandering one.
            let pushed = (&a * log.period).exp() * pushed.column(n) * (force / log.resolution);
            let mut covariance = &over * &settled * over.transpose()
                + &process * (f64::from(*parts) / f64::from(PARTS))
                + &pushed * pushed.transpose();
            let now = covariance[(0, 0)] + 1.0;
            let gain: DVector<f64> = covariance.column(0) / now;
            let row = covariance.row(0).into_owned();
            covariance -= &gain * row;
            let mut gains = vec![(gain, (variance / now).sqrt().min(1.0))];
            gains.extend(run(covariance, LONGEST.1));
            (*parts, gains)
        });
        Some(Self {
            gaps: gaps.collect(),
            start,
            steady,
        })
    }
}

/// Velocity at the beginning of a record, m/s.
fn velocity(log: &Log) -> f64 {
    let rows = BEFORE.min(log.current.len());
    let parts: u32 = log.parts[..rows].iter().sum();
    let time = log.period * f64::from(parts) / f64::from(PARTS);
    if time > 0.0 {
        (log.position[rows] - log.position[0]) / time
    } else {
        0.0
    }
}

/// A machine where a record begins.
fn at_beginning(log: &Log, machine: &Machine) -> Motion {
    let mut motion = Motion::new(&machine.mechanics, log.period);
    for position in motion.state_mut().iter_mut().step_by(2) {
        *position = log.position[0];
    }
    if !log.at_rest {
        let velocity = velocity(log);
        for each in motion.state_mut().iter_mut().skip(1).step_by(2) {
            *each = velocity;
        }
    }
    motion
}

/// The forces of a machine that its chain does not have.
struct Beside<'a> {
    machine: &'a Machine,
    period: f64,
    /// Each gap: its load, its half and its spring, and what 1 N between the masses at that spring does over a
    /// period.
    gaps: Vec<(usize, f64, f64, DVector<f64>)>,
}

impl<'a> Beside<'a> {
    fn new(machine: &'a Machine, period: f64) -> Self {
        let chain = machine.chain();
        let gaps = machine.backlash.iter().take(chain.loads()).enumerate();
        let gaps = gaps.filter(|(_, gap)| **gap > 0.0).map(|(load, gap)| {
            let pair = chain.force_input(load) - chain.force_input(load + 1);
            let (_, response) = zero_order_hold(&chain.a(), &pair, period);
            (load, 0.5 * gap, chain.stiffness[load], response)
        });
        Self {
            gaps: gaps.collect(),
            machine,
            period,
        }
    }

    /// Of the motor's force over an interval between two measured positions, N.
    fn force(&self, from: f64, to: f64) -> f64 {
        let cogging = self
            .machine
            .ripple
            .filter(|r| r.kind == RippleKind::Cogging);
        cogging.map_or(0.0, |ripple| ripple.at(0.5 * (from + to))) - self.machine.holding_force
    }

    /// By how much the encoder errs at a position that it shows, m.
    fn error(&self, position: f64) -> f64 {
        let off_axis = self
            .machine
            .ripple
            .filter(|r| r.kind == RippleKind::Eccentricity);
        off_axis.map_or(0.0, |ripple| ripple.at(position))
    }

    /// One interval under a force, N.
    fn advance(&self, motion: &mut Motion, parts: u32, force: f64) {
        // Inside its gap a spring carries nothing: what it would carry in the middle of the interval is
        // taken back.
        let carried = |(load, half, stiffness, _): &(usize, f64, f64, DVector<f64>)| {
            let (state, inner) = (motion.state(), 2 * load);
            let deflection = state[inner] - state[inner + 2];
            let rate = state[inner + 1] - state[inner + 3];
            stiffness * (deflection + 0.5 * self.period * rate).clamp(-half, *half)
        };
        let carried: Vec<f64> = self.gaps.iter().map(carried).collect();
        if parts == PARTS {
            motion.advance(force);
        } else {
            motion.advance_for(force, parts);
        }
        for (newton, (_, _, _, response)) in carried.iter().zip(&self.gaps) {
            motion.state_mut().axpy(*newton, response, 1.0);
        }
    }
}

/// The innovations of a record, and the wandering force that the filter found.
pub(super) struct Prediction {
    /// In units of the encoder's resolution, each by its weight.
    pub(super) innovations: Vec<f64>,
    /// N, over each period.
    pub(super) wander: Vec<f64>,
}

/// Innovations of a filter over a log; none when it leaves all bounds.
pub(super) fn predict(log: &Log, machine: &Machine, gain: &Gain) -> Option<Prediction> {
    let n = machine.chain().states();
    let mut motion = at_beginning(log, machine);
    let mut wander = 0.0;
    let mut innovations = Vec::with_capacity(log.current.len());
    let mut wanders = Vec::with_capacity(log.current.len());
    let mut run = gain.start.iter();
    let beside = Beside::new(machine, log.period);
    let rows = log
        .current
        .iter()
        .zip(&log.parts)
        .zip(log.position.windows(2));
    for ((current, parts), position) in rows {
        let force = beside.force(position[0], position[1]);
        let force = machine.chain().force_constant * current + force;
        beside.advance(&mut motion, *parts, force + wander);
        wanders.push(wander);
        let measured = position[1] - beside.error(position[1]);
        let innovation = measured - motion.state()[0];
        if !innovation.is_finite() {
            return None;
        }
        if let Some((_, after)) = gain.gaps.iter().find(|(gap, _)| gap == parts) {
            run = after.iter();
        }
        let (now, weight) = run.next().map_or((&gain.steady, 1.0), |(now, w)| (now, *w));
        motion.state_mut().axpy(innovation, &now.rows(0, n), 1.0);
        wander += now[n] * innovation;
        innovations.push(weight * innovation / log.resolution);
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
    let mut motion = at_beginning(log, machine);
    let mut result = vec![log.position[0]];
    let beside = Beside::new(machine, log.period);
    for (k, (current, parts)) in log.current.iter().zip(&log.parts).enumerate() {
        let push = push.get(k).copied().unwrap_or(0.0);
        let force = beside.force(log.position[k], log.position[k + 1]);
        let force = machine.chain().force_constant * current + force + push;
        beside.advance(&mut motion, *parts, force);
        // As the encoder shows it.
        result.push(motion.state()[0] + beside.error(motion.state()[0]));
    }
    result
}
