//! The start of an identification: least squares on the frequency response.
//!
//! The response of the actuator's acceleration to the current is estimated from the log as cross
//! spectrum over power spectrum: of whole periods where the current repeats, which keeps neighbouring
//! frequencies apart exactly, or else of overlapping windowed pieces (Welch's method). It is compared
//! with that of the model in logarithm and phase, where a resonance in the wrong place still shows
//! which way to go.
//!
//! What the actuator feels of the chain is a continued fraction, from the last mass inwards:
//!
//! ```text
//! Z_n = −ω² m_n + jω b_n      Z_{i−1} = −ω² m_{i−1} + jω b_{i−1} + 1 / (1 / (k_i + jω c_i) + 1 / Z_i)
//! x_a / i = k_f / (Z_0 + jω b)
//! ```

use super::least_squares::fit;
use super::log::Log;
use super::parameters::{Machine, Parameters, Quantity};
use crate::chain::Chain;
use nalgebra::Complex;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use realfft::RealFftPlanner;
use std::f64::consts::{PI, TAU};

type C = Complex<f64>;

/// One frequency of the response.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// rad/s.
    pub omega: f64,
    /// Acceleration over current, m/s² per A.
    pub response: C,
    /// Share of the acceleration that the current explains, 0 to 1.
    pub coherence: f64,
}

/// Pieces that a log without period is cut into, each overlapping the next by half.
const PIECES: usize = 4;
/// The shortest period that a current can have, samples.
const SHORTEST: usize = 64;
/// Coherence below which a frequency is left out.
const COHERENT: f64 = 0.7;
/// Power of the current below which a frequency counts as not excited, over the largest.
const EXCITED: f64 = 1e-3;

/// Period of a current that repeats itself at least once, samples.
fn period(current: &[f64]) -> Option<usize> {
    let samples = current.len();
    (SHORTEST..=samples / 2).find(|period| current[..samples - period] == current[*period..])
}

/// Frequency response of a log, at the frequencies where the current explains the motion.
#[must_use]
pub fn response(log: &Log) -> Vec<Point> {
    let samples = log.current.len();
    let repeats = period(&log.current);
    // The first period begins at rest and is left out where there are others.
    let (length, starts): (usize, Vec<usize>) = if let Some(length) = repeats {
        let periods = samples / length;
        let first = usize::from(periods > 2);
        (length, (first..periods).map(|k| k * length).collect())
    } else {
        let length = 2 * samples / (PIECES + 1);
        (length, (0..PIECES).map(|k| k * length / 2).collect())
    };
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let window = |i: usize| match repeats {
        Some(_) => 1.0,
        None => 0.5 - 0.5 * (TAU * i as f64 / length as f64).cos(),
    };
    let spectrum = |signal: &dyn Fn(usize) -> f64, from: usize| {
        let mean = (0..length).map(|i| signal(from + i)).sum::<f64>() / length as f64;
        let mut piece: Vec<f64> = (0..length)
            .map(|i| (signal(from + i) - mean) * window(i))
            .collect();
        let mut result = transform.make_output_vec();
        // Fails for buffers of the wrong length alone.
        let _ = transform.process(&mut piece, &mut result);
        result
    };
    // The second difference around a sample.
    let x = &log.position;
    let rate = 1.0 / (log.period * log.period);
    let acceleration = |k: usize| {
        let k = k.clamp(1, x.len() - 2);
        (x[k + 1] - 2.0 * x[k] + x[k - 1]) * rate
    };
    let current = |k: usize| log.current[k];
    let bins = length / 2 + 1;
    let (mut cross, mut of_current, mut of_motion) =
        (vec![C::from(0.0); bins], vec![0.0; bins], vec![0.0; bins]);
    for from in starts {
        let (u, y) = (spectrum(&current, from), spectrum(&acceleration, from));
        for bin in 0..bins {
            let (u, y) = (C::new(u[bin].re, u[bin].im), C::new(y[bin].re, y[bin].im));
            cross[bin] += y * u.conj();
            of_current[bin] += u.norm_sqr();
            of_motion[bin] += y.norm_sqr();
        }
    }
    let largest = of_current.iter().copied().fold(0.0, f64::max);
    // The lowest bins are the window's, the highest those of rounding.
    let lowest = if repeats.is_some() { 1 } else { 3 };
    (lowest..bins * 4 / 5)
        .filter(|bin| of_current[*bin] > EXCITED * largest && of_motion[*bin] > 0.0)
        .map(|bin| Point {
            omega: TAU * bin as f64 / (length as f64 * log.period),
            response: cross[bin] / of_current[bin],
            coherence: cross[bin].norm_sqr() / (of_current[bin] * of_motion[bin]),
        })
        .filter(|point| point.coherence > COHERENT)
        .collect()
}

/// Acceleration over current of a model as the log shows it: current held, second difference.
#[must_use]
pub fn model_response(chain: &Chain, omega: f64, period: f64) -> C {
    let s = C::new(0.0, omega);
    let ground = chain
        .ground
        .iter()
        .rev()
        .copied()
        .chain(std::iter::repeat(0.0));
    let masses = chain.mass.iter().rev().zip(ground);
    let springs = chain.stiffness.iter().zip(&chain.damping).rev();
    let mut force = C::from(0.0);
    // Outermost mass first, each followed by the spring that holds it.
    let mut springs = springs.map(Some).chain([None]);
    for (mass, ground) in masses {
        force += s * s * *mass + s * ground;
        if let Some(Some((stiffness, damping))) = springs.next() {
            let spring = C::from(*stiffness) + s * *damping;
            force = spring * force / (spring + force);
        }
    }
    let position = chain.force_constant / (force + s * chain.viscous);
    let turn = C::from_polar(1.0, omega * period);
    let held = (1.0 - turn.conj()) / (s * period);
    position * held * (turn - 2.0 + turn.conj()) / (period * period)
}

/// Starts of this search: the drive file, and others drawn around it as it is trusted, always the same.
const TRIES: usize = 48;
const SEED: u64 = 1;
/// Evaluations per coordinate after which one is given up.
const PATIENCE: usize = 30;
/// Machines that are handed on.
const STARTS: usize = 3;
/// How far the drive file is trusted here, as standard deviations of logarithms (masses, stiffnesses,
/// dampings; friction in tenths of the motor's force): a user knows masses best. Keeps the fit from
/// explaining a mode by a mass that vanishes.
const PRIOR: [f64; 3] = [0.2, 0.5, 1.0];
fn trust(quantity: Quantity) -> f64 {
    match quantity {
        Quantity::ActuatorMass | Quantity::ForceConstant | Quantity::Mass(_) => PRIOR[0],
        Quantity::Stiffness(_) => PRIOR[1],
        _ => PRIOR[2],
    }
}

/// Standard deviation of logarithm and phase at a fully coherent frequency, and of a phase against
/// a logarithm: phases jump by half a turn at each resonance.
const DEVIATION: f64 = 0.1;
const PHASE: f64 = 0.3;

/// Machines that fit the response, the best first, at most [`STARTS`].
pub(super) fn starts(parameters: &Parameters, points: &[Point], period: f64) -> Vec<Machine> {
    let nominal = parameters.coordinates(parameters.start());
    let residuals = |x: &[f64]| -> Option<Vec<f64>> {
        let chain = parameters.machine(x).mechanics.chain;
        let mut residuals = Vec::with_capacity(2 * points.len() + x.len());
        for point in points {
            let ratio = (point.response / model_response(&chain, point.omega, period)).ln();
            // Wrapped to half a turn.
            let phase = (ratio.im + PI).rem_euclid(TAU) - PI;
            let deviation = DEVIATION / point.coherence.min(0.999)
                * (1.0 + (1.0 - point.coherence.min(0.999)) / DEVIATION);
            residuals.push(ratio.re / deviation);
            residuals.push(PHASE * phase / deviation);
        }
        for ((quantity, x), nominal) in parameters.free().zip(x).zip(&nominal) {
            residuals.push((x - nominal) / trust(quantity));
        }
        residuals.iter().all(|r| r.is_finite()).then_some(residuals)
    };
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut fits: Vec<_> = (0..TRIES)
        .map(|attempt| {
            let mut drawn = |quantity: Quantity, x: f64| {
                // Uniform with the standard deviation of the trust.
                let uniform = random.random_range(-1.0..1.0) * 3.0_f64.sqrt();
                if attempt == 0 || !quantity.positive() {
                    x
                } else {
                    x + uniform * trust(quantity)
                }
            };
            let start: Vec<f64> = parameters
                .free()
                .zip(&nominal)
                .map(|(quantity, x)| drawn(quantity, *x))
                .collect();
            fit(&residuals, &start, 1e-4, PATIENCE)
        })
        .filter(|fit| fit.cost.is_finite())
        .collect();
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    // Starts that ended in the same place are one.
    fits.dedup_by(|a, b| {
        let pairs = a.coordinates.iter().zip(&b.coordinates);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 0.02
    });
    fits.iter()
        .take(STARTS)
        .map(|fit| parameters.machine(&fit.coordinates))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// The continued fraction is the transfer function of the state-space model.
    #[test]
    fn the_continued_fraction_is_the_state_space_model() {
        let chain = Chain {
            viscous: 0.3,
            ground: vec![0.0, 0.2, 0.1],
            ..Chain::of_table_1(300.0, 0.1)
        };
        for omega in [3.0, 75.0, 163.0, 400.0] {
            let s = C::new(0.0, omega);
            let matrix = DMatrix::identity(8, 8) * s - chain.a().map(C::from);
            let state = matrix.lu().solve(&chain.b().map(C::from)).unwrap();
            // A period so short that holding delays by half of it, and differences do not matter.
            let period = 1e-5;
            let found = model_response(&chain, omega, period);
            let expected = s * s * state[0] * (-s * period / 2.0).exp();
            assert!((found / expected - 1.0).norm() < 1e-5, "{omega}");
        }
    }
}
