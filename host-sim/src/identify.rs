//! Identification: from a log of current and encoder to the masses, springs and friction behind it.
//!
//! ```text
//! CSV --log--> frequency response --least squares--> starts --prediction error--> machine,
//!                                                             intervals, fit, refusal
//! ```
//!
//! Current and encoder determine ratios to the force constant only, so something must be held: the force
//! constant, unless the user holds something else. Everything else is free. Every figure comes with its
//! standard deviation, and what the log does not determine is refused by name.

mod frequency;
mod least_squares;
mod log;
mod parameters;
mod predict;
mod write;

pub use frequency::{Point, model_response, response};
pub use log::Log;
pub use parameters::{Kind, Machine, Parameters, Quantity};
pub use predict::Noise;
pub use write::drive_file;

use crate::drive::Drive;
use crate::error::{Error, Result};
use least_squares::{fit, jacobian};
use nalgebra::{DMatrix, DVector};
use predict::{innovations, simulation};
use serde::Serialize;

/// One quantity, identified or held.
#[derive(Clone, Debug)]
pub struct Identified {
    /// Which.
    pub quantity: Quantity,
    /// Its value, SI.
    pub value: f64,
    /// Its standard deviation; zero when held.
    pub std: f64,
    /// Whether it was taken from the drive file.
    pub held: bool,
    /// What the drive file says.
    pub before: f64,
}

/// A quantity in JSON.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// SI.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Unit.
    pub unit: &'static str,
    /// Whether it was taken from the drive file.
    pub held: bool,
}

/// What was identified.
#[derive(Clone, Debug)]
pub struct Identification {
    /// Every quantity of the run.
    pub quantities: Vec<Identified>,
    /// The machine that results.
    pub machine: Machine,
    /// How much of the motion above half of the slowest mode's frequency a simulation with the
    /// recorded current explains without any correction: `100 (1 − ‖error‖ / ‖motion‖)`.
    pub fit_percent: f64,
    /// Position and simulated position above that frequency, m.
    pub fitted: Vec<(f64, f64)>,
    /// Innovations, m.
    pub innovations: Vec<f64>,
    /// Correlation of neighbouring innovations, by lag; near zero when the model misses nothing.
    pub correlation: Vec<f64>,
    /// Measured frequency response; empty for a rigid run.
    pub response: Vec<Point>,
}

/// How far the densities of noise may be from their first guess, as logarithms.
const RANGE: f64 = 10.0;
/// Standard deviation of the quantities before the log is seen: a factor of e to either side of the
/// drive file, a tenth of the motor's force for friction. Against what a log says this weighs nothing.
const ROUGH: f64 = 1.0;
/// Standard deviation of the noise's logarithms and the origin's counts before the log is seen.
const VAGUE: f64 = 5.0;
/// Samples of the log that tell starts apart.
const BEGINNING: usize = 2000;
/// Starts that are refined.
const STARTS: usize = 3;
/// Relative standard deviation from which a quantity counts as not determined: masses and stiffnesses,
/// dampings.
const UNDETERMINED: (f64, f64) = (0.25, 0.5);
/// Correlation from which two quantities cannot be told from each other.
const ALIKE: f64 = 0.98;
/// Lags over which the correlation of the innovations widens the intervals, in periods of the slowest
/// mode, and at most, samples.
const MEMORY: (f64, usize) = (1.0, 400);

/// Identifies what is not held.
///
/// # Errors
/// [`Error::Identification`] when the log does not determine a quantity, or no machine of this
/// structure explains it.
pub fn identify(drive: &Drive, log: &Log, parameters: &Parameters) -> Result<Identification> {
    let resolution = drive.encoder.resolution;
    let refused = |message: String| Error::Identification(message);
    let flexible = parameters.kind() == Kind::Excitation;
    let response = if flexible { response(log) } else { Vec::new() };
    let free = parameters.free().count();
    let starts = if flexible {
        if response.len() < free {
            return Err(refused(format!(
                "the motion answers the current at {} frequencies, {free} at least are needed for {free} \
                 unknowns: excite longer, stronger or over a wider band",
                response.len()
            )));
        }
        frequency::starts(parameters, &response, log.period, STARTS)
    } else {
        vec![parameters.start().clone()]
    };

    // Coordinates: the free quantities, both densities of noise, the origin in counts.
    let force = parameters.start().chain.force_constant * drive.actuator.current_limit;
    let guess = Noise {
        force: (1e-3 * force * log.period.sqrt() / resolution).ln(),
        wander: (0.1 * force / resolution).ln(),
    };
    // Bounded: beyond this the filter is a simulation, or follows every count.
    let bounded = |x: f64| RANGE * (x / RANGE).tanh();
    let nominal = parameters.coordinates(parameters.start());
    let residuals_of = |log: &Log, x: &[f64]| -> Option<Vec<f64>> {
        let noise = Noise {
            force: guess.force + bounded(x[free]),
            wander: guess.wander + bounded(x[free + 1]),
        };
        let machine = parameters.machine(&x[..free]);
        let innovations = innovations(log, &machine, noise, (x[free + 2], resolution));
        // A step of the search that cannot be judged is a bad one, not the end.
        let mut residuals = innovations.unwrap_or_else(|| vec![1e6; log.current.len()]);
        // Where the log says nothing, the drive file and the guess of the noise stand.
        let quantities = x[..free].iter().zip(&nominal);
        residuals.extend(quantities.map(|(x, nominal)| (x - nominal) / ROUGH));
        residuals.extend(x[free..].iter().map(|x| x / VAGUE));
        Some(residuals)
    };
    // The beginning of the log tells the starts apart, the whole of it refines the best.
    let beginning = log.beginning(BEGINNING);
    let first = |x: &[f64]| residuals_of(&beginning, x);
    let residuals = |x: &[f64]| residuals_of(log, x);
    let best = starts
        .iter()
        .map(|machine| {
            let mut start = parameters.coordinates(machine);
            start.extend([0.0; 3]);
            fit(&first, &start, 1e-3)
        })
        .filter(|fit| fit.cost.is_finite())
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
        .map(|start| fit(&residuals, &start.coordinates, 1e-7))
        .filter(|fit| fit.cost.is_finite())
        .ok_or_else(|| refused("no machine of this structure explains the log".into()))?;

    let x = best.coordinates;
    let machine = parameters.machine(&x[..free]);
    let failed = || refused("the fit cannot be judged: it is not finite".into());
    let errors = residuals(&x).ok_or_else(failed)?;
    let slopes = jacobian(&residuals, &x).ok_or_else(failed)?;
    let slowest = machine.chain.modes().first().map(|mode| mode.frequency_hz);
    let memory = slowest.map_or(MEMORY.1, |hz| (MEMORY.0 / hz / log.period) as usize);
    let memory = memory.clamp(10, MEMORY.1);
    let covariance = covariance(&slopes, &errors, memory).ok_or_else(|| {
        refused(
            "the log does not determine the quantities at all: some have no effect on it".into(),
        )
    })?;

    let free_quantities: Vec<Quantity> = parameters.free().collect();
    let quantities: Vec<Identified> = parameters
        .all
        .iter()
        .map(|(quantity, held)| {
            let index = free_quantities.iter().position(|free| free == quantity);
            let deviation = index.map_or(0.0, |i| covariance[(i, i)].max(0.0).sqrt());
            // Friction that is zero within its deviation may be found just below; it cannot be.
            let value = parameters.value(&machine, *quantity).max(0.0);
            Identified {
                quantity: *quantity,
                value,
                std: deviation * parameters.slope(&machine, *quantity),
                held: *held,
                before: parameters.value(parameters.start(), *quantity),
            }
        })
        .collect();
    require_determined(
        &quantities,
        &free_quantities,
        &covariance,
        &machine,
        &response,
    )?;

    let fitted = fitted(log, &machine, slowest.unwrap_or(1.0));
    let (mut error, mut motion) = (0.0, 0.0);
    for (measured, simulated) in &fitted {
        error += (measured - simulated).powi(2);
        motion += measured.powi(2);
    }
    Ok(Identification {
        quantities,
        machine,
        fit_percent: 100.0 * (1.0 - (error / motion).sqrt()),
        fitted,
        correlation: (0..=memory).map(|lag| correlation(&errors, lag)).collect(),
        innovations: errors[..log.current.len()]
            .iter()
            .map(|e| e * resolution)
            .collect(),
        response,
    })
}

/// Covariance of the coordinates: that of white innovations, and where they are not white the larger one
/// that follows from how they are correlated (Newey and West, Econometrica 55, 1987).
fn covariance(slopes: &DMatrix<f64>, errors: &[f64], memory: usize) -> Option<DMatrix<f64>> {
    let (rows, columns) = slopes.shape();
    // Each coordinate in units of its own effect, so that the inverse loses no figures.
    let sizes: Vec<f64> = slopes.column_iter().map(|column| column.norm()).collect();
    if sizes.iter().any(|size| !(*size > 0.0)) {
        return None;
    }
    let scaled = DMatrix::from_fn(rows, columns, |i, j| slopes[(i, j)] / sizes[j]);
    let inverse = (scaled.transpose() * &scaled).try_inverse()?;
    let variance = errors.iter().map(|e| e * e).sum::<f64>() / (rows - columns) as f64;
    let white = &inverse * variance;
    let scores = DMatrix::from_fn(rows, columns, |i, j| scaled[(i, j)] * errors[i]);
    let mut spread = scores.transpose() * &scores;
    for lag in 1..=memory.min(rows - 1) {
        let weight = 1.0 - lag as f64 / (memory + 1) as f64;
        let late = scores.rows(lag, rows - lag);
        let early = scores.rows(0, rows - lag);
        let product = late.transpose() * early * weight;
        spread += &product + product.transpose();
    }
    let coloured = &inverse * spread * &inverse;
    // Wider of the two, correlations as the white one has them.
    let widen = DVector::from_fn(columns, |i, _| {
        (coloured[(i, i)] / white[(i, i)]).max(1.0).sqrt() / sizes[i]
    });
    let result = DMatrix::from_fn(columns, columns, |i, j| white[(i, j)] * widen[i] * widen[j]);
    result
        .iter()
        .all(|value| value.is_finite())
        .then_some(result)
}

/// Correlation of the innovations with themselves, `lag` samples later.
fn correlation(errors: &[f64], lag: usize) -> f64 {
    let all: f64 = errors.iter().map(|e| e * e).sum();
    let pairs = errors.iter().zip(errors.iter().skip(lag));
    pairs.map(|(a, b)| a * b).sum::<f64>() / all
}

/// Refuses what the log does not determine, with the reason.
fn require_determined(
    quantities: &[Identified],
    free: &[Quantity],
    covariance: &DMatrix<f64>,
    machine: &Machine,
    response: &[Point],
) -> Result<()> {
    for identified in quantities
        .iter()
        .filter(|q| !q.held && q.quantity.positive())
    {
        let relative = identified.std / identified.value;
        let limit = match identified.quantity {
            Quantity::Damping(_) => UNDETERMINED.1,
            _ => UNDETERMINED.0,
        };
        // Written so that what is no number is refused.
        if relative <= limit {
            continue;
        }
        let name = identified.quantity.name();
        let index = free.iter().position(|q| *q == identified.quantity);
        let twin = index.and_then(|i| {
            let correlated = |j: usize| {
                (covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt()).abs()
            };
            (0..free.len())
                .filter(|j| *j != i)
                .map(|j| (j, correlated(j)))
                .max_by(|a, b| a.1.total_cmp(&b.1))
        });
        let highest = response
            .last()
            .map(|point| point.omega / std::f64::consts::TAU);
        let unexcited = machine
            .chain
            .modes()
            .into_iter()
            .find(|mode| highest.is_some_and(|highest| mode.frequency_hz > highest));
        let why = match (unexcited, twin) {
            (Some(mode), _) => format!(
                "the current excites nothing above {:.1} Hz, and a mode lies at {:.1} Hz",
                highest.unwrap_or(0.0),
                mode.frequency_hz
            ),
            (None, Some((j, correlated))) if correlated > ALIKE => format!(
                "it cannot be told from {other}: hold one of them (--hold {other})",
                other = free[j].name()
            ),
            _ => "it hardly shows in the motion: excite longer, stronger or where the modes are"
                .into(),
        };
        return Err(Error::Identification(format!(
            "the log does not determine {name} (standard deviation {:.0} % of it): {why}",
            100.0 * relative
        )));
    }
    Ok(())
}

/// Measured and purely simulated position, both without what is slower than half of `frequency`, Hz.
fn fitted(log: &Log, machine: &Machine, frequency: f64) -> Vec<(f64, f64)> {
    let pole = (-std::f64::consts::PI * frequency * log.period).exp();
    let fast = |signal: &[f64]| {
        // Two first-order high-pass filters, one after the other.
        let mut result = signal.to_vec();
        for _ in 0..2 {
            let (mut before, mut value) = (result[0], 0.0);
            for x in &mut result {
                value = pole * (value + *x - before);
                before = *x;
                *x = value;
            }
        }
        result
    };
    let (measured, simulated) = (fast(&log.position), fast(&simulation(log, machine)));
    measured.into_iter().zip(simulated).collect()
}

impl Identification {
    /// Each quantity for JSON, by its key in the drive file.
    #[must_use]
    pub fn entries(&self, drive: &Drive) -> std::collections::BTreeMap<String, Entry> {
        let units = drive.kind.units();
        let entries = self.quantities.iter().map(|identified| {
            let entry = Entry {
                value: identified.value,
                std: identified.std,
                unit: identified.quantity.unit(units),
                held: identified.held,
            };
            (identified.quantity.name(), entry)
        });
        entries.collect()
    }
}
