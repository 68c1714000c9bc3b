//! The search: the machine whose predictions err least, and the proof that there is no other.
//!
//! ```text
//! starts --noise held, beginning of the record--> ranked --noise free, whole record--> best
//!        --again from where it ended, until nothing moves--> --from either side along what is known least-->
//! ```
//!
//! The coordinates of the search are the free quantities and both densities of noise. While the starts are
//! told apart the noise is held where the filter follows what is slower than the load: a filter whose noise
//! is free explains a wrong machine as noise, and the search ends there.

use super::least_squares::{Fit, fit, jacobian};
use super::predict::{Gain, Noise, Prediction, predict};
use super::{Log, Machine, Parameters};
use crate::error::{Error, Result};
use crate::output::Progress;
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// How far the densities of noise may be from where they are held, as logarithms.
const RANGE: f64 = 14.0;
/// Bandwidth of the filter while the noise is held, over the slowest mode of the drive file.
const HELD: f64 = 0.3;
/// The random force then, over the one that alone would have that bandwidth.
const QUIET: f64 = 0.1;
/// Standard deviation of the quantities before the log is seen: a factor of e to either side of the
/// drive file, a tenth of the motor's force for friction. Against what a log says this weighs nothing.
const QUANTITY_DEVIATION: f64 = 1.0;
/// Standard deviation of the noise's logarithms before the log is seen.
const NOISE_DEVIATION: f64 = 5.0;
/// What of a record tells starts apart: periods of the drive file's slowest mode, and samples at most.
const BEGINNING: (f64, f64) = (8.0, 2000.0);
/// Starts that are fitted more closely before they are ranked.
const PROMISING: usize = 5;
/// Starts that are followed to the end, as many as end within a factor of the best.
const FOLLOWED: (usize, f64) = (3, 4.0);
/// Coordinates nearer than this are the same place.
const SAME: f64 = 0.02;
/// Tolerances of the fits: that tell starts apart, that rank them, to the whole log, from where one ended.
const TOLERANCE: [f64; 4] = [3e-2, 1e-3, 1e-6, 1e-10];
/// How far the last fit may move, in standard deviations, and how often one is tried.
const STILL: (f64, usize) = (0.05, 8);
/// How far a start beside the result is put along what is known least: standard deviations, but in
/// coordinates at least and at most.
const BESIDE: (f64, f64, f64) = (5.0, 0.03, 0.3);

/// Where a search ended.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    /// The machine.
    pub(super) machine: Machine,
    /// Where in the coordinates of the search.
    pub(super) coordinates: Vec<f64>,
    /// Densities of the noise.
    pub(super) noise: Noise,
    /// Its innovations in counts, followed by what is known beforehand.
    pub(super) errors: Vec<f64>,
    /// Their derivatives, a column for each coordinate.
    pub(super) slopes: DMatrix<f64>,
    /// Half the sum of squares.
    pub(super) cost: f64,
    /// Whether another fit from there moves nothing.
    pub(super) still: bool,
    /// Other ends of the search: coordinates and half the sum of squares.
    pub(super) rivals: Vec<Fit>,
}

/// The innovations of a log in counts, over the coordinates of the search.
pub(super) struct Residuals<'a> {
    parameters: &'a Parameters,
    /// Coordinates of the drive file.
    nominal: Vec<f64>,
    held: Noise,
    resolution: f64,
}

impl<'a> Residuals<'a> {
    pub(super) fn new(resolution: f64, period: f64, parameters: &'a Parameters) -> Self {
        let mass = parameters.start().chain.mass.iter().sum::<f64>();
        // Of a double integrator seen in white noise, driven by a random force or by its integral.
        let rate = HELD * parameters.rate();
        Self {
            parameters,
            nominal: parameters.coordinates(parameters.start()),
            held: Noise {
                force: (QUIET * mass * rate.powi(2) * period.sqrt()).ln(),
                wander: (mass * rate.powi(3) * period.sqrt()).ln(),
            },
            resolution,
        }
    }

    pub(super) fn resolution(&self) -> f64 {
        self.resolution
    }

    fn noise(&self, x: &[f64]) -> Noise {
        // Bounded: beyond this the filter is a simulation, or follows every count.
        let bounded = |x: f64| RANGE * (x / RANGE).tanh();
        Noise {
            force: self.held.force + bounded(x[0]),
            wander: self.held.wander + bounded(x[1]),
        }
    }

    /// What the filter makes of a log.
    pub(super) fn prediction(&self, log: &Log, machine: &Machine, noise: Noise) -> Option<Prediction> {
        let gain = Gain::new(machine, noise, log.period)?;
        predict(log, machine, &gain, self.resolution)
    }

    /// Over the quantities, the noise held: by a filter that is made for another machine.
    fn held(&self, logs: &[Log], gains: &[Gain], x: &[f64]) -> Vec<f64> {
        let machine = self.parameters.machine(x);
        let found = logs.iter().zip(gains);
        let found = found.map(|(log, gain)| predict(log, &machine, gain, self.resolution));
        self.residuals(logs, found, x, &[])
    }

    /// Over the quantities and the noise.
    pub(super) fn of(&self, logs: &[Log], x: &[f64]) -> Vec<f64> {
        let (quantities, noise) = x.split_at(self.nominal.len());
        let machine = self.parameters.machine(quantities);
        let densities = self.noise(noise);
        let found = logs
            .iter()
            .map(|log| self.prediction(log, &machine, densities));
        self.residuals(logs, found, quantities, noise)
    }

    fn residuals(
        &self,
        logs: &[Log],
        found: impl Iterator<Item = Option<Prediction>>,
        quantities: &[f64],
        noise: &[f64],
    ) -> Vec<f64> {
        let mut residuals = Vec::new();
        for (log, found) in logs.iter().zip(found) {
            // A step of the search that cannot be judged is a bad one, not the end.
            residuals.extend(
                found.map_or_else(|| vec![1e6; log.current.len()], |found| found.innovations),
            );
        }
        // Where the log says nothing, the drive file and the guess of the noise stand.
        let quantities = quantities.iter().zip(&self.nominal);
        residuals.extend(quantities.map(|(x, nominal)| (x - nominal) / QUANTITY_DEVIATION));
        residuals.extend(noise.iter().map(|x| x / NOISE_DEVIATION));
        residuals
    }
}

/// Largest distance of two places in one coordinate.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The best first, no place twice.
fn ranked(mut fits: Vec<Fit>, quantities: usize) -> Vec<Fit> {
    fits.retain(|fit| fit.cost.is_finite());
    fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut kept: Vec<Fit> = Vec::new();
    for fit in fits {
        let known = |other: &Fit| {
            apart(
                &fit.coordinates[..quantities],
                &other.coordinates[..quantities],
            ) < SAME
        };
        if !kept.iter().any(known) {
            kept.push(fit);
        }
    }
    kept
}

/// Covariance of white errors, from their derivatives.
fn white(slopes: &DMatrix<f64>, cost: f64) -> Option<DMatrix<f64>> {
    let (rows, columns) = slopes.shape();
    let normal = slopes.transpose() * slopes;
    Some(normal.try_inverse()? * (2.0 * cost / rows.saturating_sub(columns).max(1) as f64))
}

/// The machine that explains a log best.
///
/// # Errors
/// [`Error::Identification`] when none of this structure does.
pub(super) fn estimate(
    logs: &[Log],
    parameters: &Parameters,
    residuals: &Residuals<'_>,
    starts: &[Machine],
    progress: &Progress<'_>,
) -> Result<Estimate> {
    let failed = || Error::Identification("no machine of this structure explains the log".into());
    let quantities = residuals.nominal.len();
    let periods: usize = logs.iter().map(|log| log.current.len()).sum();
    let beginning: Vec<Log> = logs
        .iter()
        .map(|log| {
            let rows = BEGINNING.0 * std::f64::consts::TAU / (parameters.rate() * log.period);
            log.beginning(rows.min(BEGINNING.1) as usize)
        })
        .collect();
    let all = |x: &[f64]| Some(residuals.of(logs, x));
    let roughly = |x: &[f64], tolerance: f64| -> Option<Fit> {
        let machine = parameters.machine(x);
        let gains: Vec<Gain> = beginning
            .iter()
            .map(|log| Gain::new(&machine, residuals.held, log.period))
            .collect::<Option<_>>()?;
        let first = |x: &[f64]| Some(residuals.held(&beginning, &gains, x));
        Some(fit(&first, x, tolerance))
    };
    progress(0, 4, "starts");
    let fits = starts
        .par_iter()
        .filter_map(|machine| roughly(&parameters.coordinates(machine), TOLERANCE[0]))
        .collect();
    let fits = ranked(fits, quantities)
        .par_iter()
        .take(PROMISING)
        .filter_map(|start| roughly(&start.coordinates, TOLERANCE[1]))
        .collect();
    progress(1, 4, "whole log");
    let followed = ranked(fits, quantities);
    let fits: Vec<Fit> = followed
        .par_iter()
        .take(FOLLOWED.0)
        .filter(|start| start.cost <= FOLLOWED.1 * followed[0].cost)
        .map(|start| {
            let mut x = start.coordinates.clone();
            x.extend([0.0; 2]);
            fit(&all, &x, TOLERANCE[2])
        })
        .collect();
    progress(2, 4, "once more");
    let mut ends = ranked(fits, quantities);
    let mut slopes;
    let mut still;
    let mut rounds = 0;
    loop {
        // From where it ended, until nothing moves.
        still = false;
        let mut best = ends.first().cloned().ok_or_else(failed)?;
        slopes = jacobian(&all, &best.coordinates).ok_or_else(failed)?;
        let mut deviations = white(&slopes, best.cost).ok_or_else(failed)?;
        let before = best.clone();
        for _ in 0..STILL.1 {
            let again = fit(&all, &best.coordinates, TOLERANCE[3]);
            let moved = (0..quantities)
                .map(|i| {
                    (again.coordinates[i] - best.coordinates[i]).abs() / deviations[(i, i)].sqrt()
                })
                .fold(0.0, f64::max);
            if again.cost < best.cost {
                best = again.clone();
            }
            slopes = jacobian(&all, &best.coordinates).ok_or_else(failed)?;
            deviations = white(&slopes, best.cost).ok_or_else(failed)?;
            if moved < STILL.0 {
                still = true;
                break;
            }
        }
        ends[0] = best.clone();
        rounds += 1;
        if !still {
            // Where it was is as likely as where it is.
            ends.push(before);
        }
        if rounds > 3 {
            break;
        }
    progress(3, 4, "from either side");
        // Along what is known least, to either side.
        let block = deviations.view((0, 0), (quantities, quantities)).into_owned();
        let eigen = SymmetricEigen::new(block);
        let weakest = eigen.eigenvalues.imax();
        let direction = eigen.eigenvectors.column(weakest).into_owned();
        let size = BESIDE.0 * eigen.eigenvalues[weakest].max(0.0).sqrt();
        let size = size.clamp(BESIDE.1, BESIDE.2) / direction.amax();
        let sides: Vec<Fit> = [-size, size]
            .par_iter()
            .map(|size| {
                let mut x = best.coordinates.clone();
                for (x, direction) in x.iter_mut().zip(direction.iter()) {
                    *x += size * direction;
                }
                fit(&all, &x, TOLERANCE[2])
            })
            .collect();
        ends.extend(sides);
        ends = ranked(ends, quantities);
        // Not the same within what the record tells.
        let found = ends.first().ok_or_else(failed)?;
        let better = 2.0 * (best.cost - found.cost) > 0.1 * 2.0 * best.cost / periods as f64;
        if !better {
            let position = ends.iter().position(|end| {
                apart(
                    &end.coordinates[..quantities],
                    &best.coordinates[..quantities],
                ) < SAME
            });
            if let Some(position) = position {
                ends.remove(position);
            }
            ends.insert(0, best);
            break;
        }
    }
    let best = ends.remove(0);
    Ok(Estimate {
        machine: parameters.machine(&best.coordinates[..quantities]),
        noise: residuals.noise(&best.coordinates[quantities..]),
        errors: residuals.of(logs, &best.coordinates),
        coordinates: best.coordinates,
        slopes,
        cost: best.cost,
        still,
        rivals: ends,
    })
}
