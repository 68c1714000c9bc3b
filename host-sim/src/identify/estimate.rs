//! The end of an identification: the machine whose predictions err least.
//!
//! The coordinates of the search are the free quantities, both densities of noise and the position at the
//! first sample. The beginning of the log tells the starts apart, the whole of it refines the best.

use super::least_squares::{fit, jacobian};
use super::predict::{Noise, innovations};
use super::{Log, Machine, Parameters};
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::output::Progress;
use nalgebra::DMatrix;

/// How far the densities of noise may be from their first guess, as logarithms.
const RANGE: f64 = 10.0;
/// Standard deviation of the quantities before the log is seen: a factor of e to either side of the
/// drive file, a tenth of the motor's force for friction. Against what a log says this weighs nothing.
const QUANTITY_DEVIATION: f64 = 1.0;
/// Standard deviation of the noise's logarithms and the origin's counts before the log is seen.
const NOISE_DEVIATION: f64 = 5.0;
/// Samples of the log that tell starts apart.
const BEGINNING: usize = 2000;

/// Where the search ended.
pub(super) struct Estimate {
    /// The machine.
    pub(super) machine: Machine,
    /// Its innovations in counts, followed by what is known beforehand.
    pub(super) errors: Vec<f64>,
    /// Their derivatives, a column for each coordinate.
    pub(super) slopes: DMatrix<f64>,
}

/// The innovations of a log in counts, over the coordinates of the search.
struct Residuals<'a> {
    parameters: &'a Parameters,
    /// Coordinates of the drive file.
    nominal: Vec<f64>,
    guess: Noise,
    resolution: f64,
}

impl<'a> Residuals<'a> {
    fn new(drive: &Drive, parameters: &'a Parameters) -> Self {
        let resolution = drive.encoder.resolution;
        let force = parameters.start().chain.force_constant * drive.actuator.current_limit;
        let period = drive.control.sample_time;
        Self {
            parameters,
            nominal: parameters.coordinates(parameters.start()),
            guess: Noise {
                force: (1e-3 * force * period.sqrt() / resolution).ln(),
                wander: (0.1 * force / resolution).ln(),
            },
            resolution,
        }
    }

    fn of(&self, log: &Log, x: &[f64]) -> Vec<f64> {
        let (quantities, rest) = x.split_at(self.nominal.len());
        // Bounded: beyond this the filter is a simulation, or follows every count.
        let bounded = |x: f64| RANGE * (x / RANGE).tanh();
        let noise = Noise {
            force: self.guess.force + bounded(rest[0]),
            wander: self.guess.wander + bounded(rest[1]),
        };
        let machine = self.parameters.machine(quantities);
        let innovations = innovations(log, &machine, noise, (rest[2], self.resolution));
        // A step of the search that cannot be judged is a bad one, not the end.
        let mut residuals = innovations.unwrap_or_else(|| vec![1e6; log.current.len()]);
        // Where the log says nothing, the drive file and the guess of the noise stand.
        let quantities = quantities.iter().zip(&self.nominal);
        residuals.extend(quantities.map(|(x, nominal)| (x - nominal) / QUANTITY_DEVIATION));
        residuals.extend(rest.iter().map(|x| x / NOISE_DEVIATION));
        residuals
    }
}

/// The machine that explains a log best.
///
/// # Errors
/// [`Error::Identification`] when none of this structure does.
pub(super) fn estimate(
    drive: &Drive,
    log: &Log,
    parameters: &Parameters,
    starts: &[Machine],
    progress: &Progress<'_>,
) -> Result<Estimate> {
    let residuals = Residuals::new(drive, parameters);
    let beginning = log.beginning(BEGINNING);
    let first = |x: &[f64]| Some(residuals.of(&beginning, x));
    let all = |x: &[f64]| Some(residuals.of(log, x));
    let fits = starts.len() + 1;
    let best = starts
        .iter()
        .enumerate()
        .map(|(done, machine)| {
            progress(done, fits, "first fits");
            let mut start = parameters.coordinates(machine);
            start.extend([0.0; 3]);
            fit(&first, &start, 1e-3)
        })
        .filter(|fit| fit.cost.is_finite())
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
        .inspect(|_| progress(starts.len(), fits, "fit to the whole log"))
        .map(|start| fit(&all, &start.coordinates, 1e-7))
        .filter(|fit| fit.cost.is_finite());
    let failed = || Error::Identification("no machine of this structure explains the log".into());
    let x = best.ok_or_else(failed)?.coordinates;
    Ok(Estimate {
        machine: parameters.machine(&x[..residuals.nominal.len()]),
        errors: residuals.of(log, &x),
        slopes: jacobian(&all, &x).ok_or_else(failed)?,
    })
}
