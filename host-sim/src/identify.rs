//! Identification: from a log of current and encoder to the masses, springs and friction behind it.
//!
//! ```text
//! files --log--> records --starts--> machines --estimate--> the best of them --structure--> what else there is
//!       --settle--> until nothing moves --confidence, figures--> intervals, modes, what is not known
//!       --neighbours--> is the number of loads right?          --remarks--> words
//! ```
//!
//! Current and encoder determine ratios to the force constant only, so something must be held: the force
//! constant, unless the user holds something else. Everything else is free. Every figure comes with its
//! standard deviation; what the records do not determine is not given.

mod confidence;
mod drift;
mod drive_file;
mod estimate;
mod figures;
mod frequency;
mod least_squares;
mod log;
mod neighbours;
mod parameters;
mod predict;
mod remarks;
mod settle;
mod starts;
mod structure;

pub use drift::{Drift, drift};
pub use drive_file::drive_file;
pub use figures::{Figure, Unit};
pub use frequency::{Point, model_response, response};
pub use log::{Columns, Log};
pub use parameters::{Experiment, Machine, Parameters, Quantity, Ripple, RippleKind};

use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::output::{Progress, significant};
use confidence::{Covariance, Rival, correlation, rivals};
use estimate::{Residuals, search};
use log::{intervals, period};
use nalgebra::DVector;
use predict::simulation;
use remarks::{common_factor, ripple};
use settle::{Estimate, settle, undetermined};
use starts::starts;
use structure::{Structure, extended};

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
    /// Whether the record determines it; what it does not is as the drive file and the modes have it.
    pub known: bool,
    /// What the drive file says.
    pub before: f64,
}

/// What was identified.
#[derive(Clone, Debug)]
pub struct Identification {
    /// Every quantity of the run.
    pub quantities: Vec<Identified>,
    /// What is known of the whole, beside its parts.
    pub figures: Vec<Figure>,
    /// The machine that results.
    pub machine: Machine,
    /// How much of the motion above half of the slowest mode's frequency a simulation with the
    /// recorded current explains without any correction: `100 (1 − ‖error‖ / ‖motion‖)`.
    pub fit_percent: f64,
    /// Root mean square of the innovations, counts.
    pub error_rms: f64,
    /// What else should be said of it, a sentence each.
    pub remarks: Vec<String>,
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

/// Relative standard deviation from which a quantity counts as not known. Masses and stiffnesses: three of
/// it are the 30 % that a design is compared over; dampings: three of it reach down to none.
const UNKNOWN: (f64, f64) = (0.1, 1.0 / 3.0);
/// What of each record the search sees before it is sure of the structure: rows at least, and periods of the
/// drive file's slowest mode.
const SHORT: (f64, f64) = (3000.0, 30.0);
/// Correlation of innovations within some samples up to which they count as white.
const WHITE: f64 = 0.15;
const NEAR: usize = 10;
/// How many figures of the whole must be known for anything to be designed: its acceleration, and the first
/// mode.
const FIRST: usize = 2;

/// Share of the energy exchanged up to which a current has given nothing: what rounding makes of a machine
/// without friction.
const NOTHING: f64 = 0.01;
/// Share of the squared error that is left where the current's sign is the other one, for the wiring to be
/// named.
const REVERSED: f64 = 0.5;

/// Identifies what is not held.
///
/// * `logs`: records of the same machine
/// * `progress`: told of each fit as its turn comes
///
/// # Errors
/// [`Error::Identification`] when the logs do not determine the machine, or no machine of this
/// structure explains them; [`Error::Input`] when one does with the current's sign reversed.
pub fn identify(
    drive: &Drive,
    logs: &[Log],
    parameters: &Parameters,
    progress: &Progress<'_>,
) -> Result<Identification> {
    let found = Found::new(drive, logs, parameters, progress)?;
    let judged = found.judge().and_then(|identification| {
        found.require_loads(&identification)?;
        Ok(identification)
    });
    let message = match judged {
        Err(Error::Identification(message)) => message,
        judged => return judged,
    };
    // Wiring is named where it explains what nothing else does.
    let reversed: Vec<Log> = logs.iter().map(Log::reversed).collect();
    if logs.iter().all(|log| log.work < NOTHING)
        && let Ok(other) = Found::new(drive, &reversed, parameters, progress)
        && other.estimate.cost < REVERSED * found.estimate.cost
        && other.judge().is_ok()
    {
        return Err(Error::Input {
            place: logs.first().map_or_else(String::new, |log| log.name.clone()),
            message: "the encoder counts against the current: swap the encoder's phases or the motor's leads"
                .into(),
        });
    }
    Err(Error::Identification(message))
}

/// What a search for the machine behind some records found.
struct Found<'a> {
    drive: &'a Drive,
    logs: &'a [Log],
    /// The quantities that the records need.
    parameters: Parameters,
    /// What of them not every machine has.
    added: Vec<Quantity>,
    /// Of the record that excites most frequencies.
    response: Vec<Point>,
    estimate: Estimate,
}

impl<'a> Found<'a> {
    fn new(
        drive: &'a Drive,
        logs: &'a [Log],
        parameters: &Parameters,
        progress: &Progress<'_>,
    ) -> Result<Self> {
        let response = match parameters.experiment() {
            Experiment::Excitation => logs
                .iter()
                .map(response)
                .max_by_key(Vec::len)
                .unwrap_or_default(),
            _ => Vec::new(),
        };
        let short: Vec<Log> = logs
            .iter()
            .map(|log| {
                let rows = parameters.rows(SHORT.1, log.period);
                log.beginning(rows.max(SHORT.0) as usize)
            })
            .collect();
        let search = |parameters: &Parameters, beside: &Machine, found: Option<Machine>| {
            let mut starts = starts(parameters, beside, &response, period(logs));
            starts.extend(found);
            let residuals = Residuals::new(&short, parameters);
            search(&short, parameters, &residuals, &starts, progress)
        };
        let mut structure = Structure {
            ends: search(parameters, parameters.start(), None)?,
            parameters: parameters.clone(),
            added: Vec::new(),
        };
        progress(2, 4, "what else there is");
        // What is taken in moves everything else: the search begins again.
        while let Some(more) = extended(&short, &structure) {
            structure = more;
            let Some(end) = structure.ends.first() else {
                break;
            };
            let count = structure.parameters.free().count();
            let found = structure.parameters.machine(&end.coordinates[..count]);
            structure.ends = search(&structure.parameters, &found, Some(found.clone()))?;
        }
        progress(3, 4, "until nothing moves");
        let estimate = loop {
            let residuals = Residuals::new(logs, &structure.parameters);
            let ends = structure.ends.clone();
            let estimate = settle(logs, &structure.parameters, &residuals, ends)?;
            // What was taken in while the rest was still wrong may turn out to be nothing.
            match structure.without_nothing(&estimate) {
                Some(less) => structure = less,
                None => break estimate,
            }
        };
        Ok(Self {
            drive,
            logs,
            parameters: structure.parameters,
            added: structure.added,
            response,
            estimate,
        })
    }

    /// Refuses a number of loads that explains the records worse than its neighbour does.
    fn require_loads(&self, identification: &Identification) -> Result<()> {
        let coloured = identification
            .correlation
            .iter()
            .skip(1)
            .take(NEAR)
            .any(|correlation| correlation.abs() > WHITE);
        if self.parameters.experiment() != Experiment::Excitation || !coloured {
            return Ok(());
        }
        let more = neighbours::one_more(self.logs, &self.parameters, &self.estimate);
        let Some(left) = more else {
            return Ok(());
        };
        let loads = self.drive.loads.len();
        Err(Error::Identification(format!(
            "a machine with {} loads predicts the record better, with errors of {} counts instead of {}: \
             give the drive file {} [[load]] tables",
            loads + 1,
            significant(left.sqrt() * identification.error_rms, 2),
            significant(identification.error_rms, 2),
            loads + 1,
        )))
    }

    /// What should be said beside the figures.
    fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        for log in self.logs {
            remarks.extend(log.remarks.iter().map(|remark| match self.logs.len() {
                1 => remark.clone(),
                _ => format!("{}: {remark}", log.name),
            }));
        }
        let (machine, units) = (&self.estimate.machine, self.drive.kind.units());
        remarks.extend(self.added.iter().map(|quantity| match *quantity {
            Quantity::Backlash(load) => format!(
                "the spring before load {} has a gap of {} {}: its stiffness is that outside of the gap",
                load + 1,
                significant(1e6 * machine.backlash[load], 3),
                units.micro_position,
            ),
            Quantity::Ripple(_) => ripple(machine, units),
            _ => format!(
                "the record needs {}, which the drive file does not have: identified with the others",
                quantity.name()
            ),
        }));
        remarks
    }

    /// That not all of its parts are known, in words.
    fn not_known(&self, quantities: &[Identified]) -> Option<String> {
        if quantities.iter().all(|quantity| quantity.known) {
            return None;
        }
        let as_well = neighbours::one_less(self.logs, &self.parameters, &self.estimate);
        let fewer = if as_well {
            format!(
                "; a machine with {} loads explains the record as well",
                self.drive.loads.len() - 1
            )
        } else {
            String::new()
        };
        Some(format!(
            "not all of its parts are known from this record, but what is given of the whole is{fewer}"
        ))
    }

    /// Every quantity with what is known of it.
    fn quantities(&self, covariance: &Covariance, rivals: &[Rival]) -> Vec<Identified> {
        let (parameters, estimate) = (&self.parameters, &self.estimate);
        let machine = &estimate.machine;
        let free_quantities: Vec<Quantity> = parameters.free().collect();
        let size = estimate.coordinates.len();
        parameters
            .all
            .iter()
            .filter(|(quantity, _)| quantity.of_a_drive())
            .map(|(quantity, held)| {
                let index = free_quantities.iter().position(|free| free == quantity);
                let deviation = index.map_or(0.0, |i| {
                    let distances = rivals.iter().map(|rival| {
                        let distance = rival.coordinates[i] - estimate.coordinates[i];
                        (distance.abs(), rival.likelihood)
                    });
                    covariance.deviation(&unit(size, i), distances)
                });
                // Friction that is zero within its deviation may be found just below; it cannot be.
                let value = parameters.value(machine, *quantity);
                let value = if quantity.signed() {
                    value
                } else {
                    value.max(0.0)
                };
                let std = deviation * parameters.slope(machine, *quantity);
                let limit = match quantity {
                    Quantity::Damping(_) => UNKNOWN.1,
                    _ => UNKNOWN.0,
                };
                Identified {
                    quantity: *quantity,
                    value,
                    std,
                    held: *held,
                    known: *held || !quantity.positive() || std <= limit * value,
                    before: parameters.value(parameters.start(), *quantity),
                }
            })
            .collect()
    }

    /// What is known at the end of a search.
    fn judge(&self) -> Result<Identification> {
        let refused = |message: String| Error::Identification(message);
        let (logs, parameters, estimate) = (self.logs, &self.parameters, &self.estimate);
        let residuals = Residuals::new(logs, parameters);
        let resolution = self.drive.encoder.resolution;
        let machine = estimate.machine.clone();
        let slowest = machine
            .chain()
            .modes()
            .first()
            .map(|mode| mode.frequency_hz);
        let memory = slowest.map_or(MEMORY.1, |hz| (MEMORY.0 / hz / period(logs)) as usize);
        let memory = memory.clamp(10, MEMORY.1);
        let covariance =
            Covariance::new(logs, &residuals, estimate, memory).ok_or_else(undetermined)?;
        let rivals = rivals(estimate);
        let quantities = self.quantities(&covariance, &rivals);
        let figures = figures::figures(parameters, &estimate.coordinates, &covariance, &rivals);
        if let Some(figure) = figures.iter().take(FIRST).find(|figure| !figure.known()) {
            return Err(refused(format!(
                "the log does not determine {} ({} +- {}): the motion is too small, too short or too slow \
                 for it",
                figure.name,
                significant(figure.value, 4),
                significant(3.0 * figure.std, 2),
            )));
        }
        let mut fitted = Vec::new();
        for log in logs {
            fitted.extend(self::fitted(log, &machine, slowest.unwrap_or(1.0)));
        }
        let (mut error, mut motion) = (0.0, 0.0);
        for (measured, simulated) in &fitted {
            error += (measured - simulated).powi(2);
            motion += measured.powi(2);
        }
        let fit_percent = 100.0 * (1.0 - f64::sqrt(error / motion));
        if fit_percent.is_nan() || fit_percent < LEAST_FIT {
            return Err(refused(format!(
                "the best machine of this structure explains {fit_percent:.0} % of the motion, \
                 {LEAST_FIT} % at least are needed: is the log of this drive, and of this `experiment`?"
            )));
        }
        let mut remarks = self.remarks();
        remarks.extend(self.not_known(&quantities));
        remarks.extend(common_factor(&quantities));
        let periods = intervals(logs);
        let innovations = &estimate.errors[..periods];
        let square: f64 = innovations.iter().map(|error| error * error).sum();
        Ok(Identification {
            quantities,
            figures,
            machine,
            fit_percent,
            error_rms: (square / periods as f64).sqrt(),
            remarks,
            fitted,
            left_out: logs.iter().map(|log| log.left_out).sum(),
            correlation: (0..=memory)
                .map(|lag| correlation(innovations, lag))
                .collect(),
            innovations: innovations.iter().map(|e| e * resolution).collect(),
            response: self.response.clone(),
        })
    }
}

/// A slope that is one coordinate.
fn unit(size: usize, index: usize) -> DVector<f64> {
    DVector::from_fn(size, |i, _| f64::from(u8::from(i == index)))
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
    let (measured, simulated) = (fast(&log.position), fast(&simulation(log, machine, &[])));
    measured.into_iter().zip(simulated).collect()
}
