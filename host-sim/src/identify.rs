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

mod confidence;
mod drive_file;
mod estimate;
mod frequency;
mod least_squares;
mod log;
mod parameters;
mod predict;

pub use drive_file::drive_file;
pub use frequency::{Point, model_response, response};
pub use log::{Columns, Log};
pub use parameters::{Experiment, Machine, Parameters, Quantity};

use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::output::Progress;
use confidence::{correlation, covariance, require_determined};
use estimate::{Estimate, estimate};
use predict::simulation;

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
    /// Control periods at the end of the log that were left out.
    pub left_out: usize,
    /// Innovations, m.
    pub innovations: Vec<f64>,
    /// Correlation of neighbouring innovations, by lag; near zero when the model misses nothing.
    pub correlation: Vec<f64>,
    /// Measured frequency response; empty for a rigid run.
    pub response: Vec<Point>,
}

/// Lags over which the correlation of the innovations widens the intervals, in periods of the slowest
/// mode, and at most, samples.
const MEMORY: (f64, usize) = (1.0, 400);

/// Least fit, %: with less the figures are those of some other machine.
const LEAST_FIT: f64 = 50.0;

/// Share of the energy exchanged below which a current has given nothing: what rounding makes of a machine
/// without friction.
const NOTHING: f64 = 0.01;

/// Identifies what is not held.
///
/// * `progress`: told of each fit as its turn comes
///
/// # Errors
/// [`Error::Identification`] when the log does not determine a quantity, or no machine of this
/// structure explains it; [`Error::Input`] when one does with the current's sign reversed.
pub fn identify(
    drive: &Drive,
    log: &Log,
    parameters: &Parameters,
    progress: &Progress<'_>,
) -> Result<Identification> {
    let message = match explain(drive, log, parameters, progress) {
        Err(Error::Identification(message)) if log.work < NOTHING => message,
        explained => return explained,
    };
    // Wiring is named where it explains the whole log, and nothing less.
    if explain(drive, &log.reversed(), parameters, progress).is_ok() {
        return Err(Error::Input {
            place: log.name.clone(),
            message: "the encoder counts against the current: swap the encoder's phases or the motor's leads"
                .into(),
        });
    }
    if log.work > -NOTHING {
        return Err(Error::Identification(message));
    }
    Err(Error::Identification(format!(
        "{message}; and the motion gives energy to the current, which it cannot from rest: the log begins with \
         the load deflected or moving, or something else pushes the machine"
    )))
}

/// The machine behind a log, if there is one.
fn explain(
    drive: &Drive,
    log: &Log,
    parameters: &Parameters,
    progress: &Progress<'_>,
) -> Result<Identification> {
    let resolution = drive.encoder.resolution;
    let refused = |message: String| Error::Identification(message);
    let flexible = parameters.experiment() == Experiment::Excitation;
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
        frequency::starts(parameters, &response, log.period)
    } else {
        vec![parameters.start().clone()]
    };

    let Estimate {
        machine,
        errors,
        slopes,
    } = estimate(drive, log, parameters, &starts, progress)?;
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
    let fit_percent = 100.0 * (1.0 - f64::sqrt(error / motion));
    if fit_percent.is_nan() || fit_percent < LEAST_FIT {
        return Err(refused(format!(
            "the best machine of this structure explains {fit_percent:.0} % of the motion, {LEAST_FIT} % at \
             least are needed: is the log of this drive, and of this `experiment`?"
        )));
    }
    Ok(Identification {
        quantities,
        machine,
        fit_percent,
        fitted,
        left_out: log.left_out,
        correlation: (0..=memory).map(|lag| correlation(&errors, lag)).collect(),
        innovations: errors[..log.current.len()]
            .iter()
            .map(|e| e * resolution)
            .collect(),
        response,
    })
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
