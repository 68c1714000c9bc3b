//! The search: machines whose predictions err least.
//!
//! ```text
//! starts --much noise held, beginning of the record--> ranked --less and less of it--> ranked
//!        --little noise held, beginning of the record----------------------------------> as well
//!        --noise free, whole record--> ends
//! ```
//!
//! The coordinates of the search are the free quantities and both densities of noise. While the starts are
//! told apart the noise is held: a filter whose noise is free explains a wrong machine as noise, and the search
//! ends there. At first it is held so high that the filter forgets within a few samples: its errors then depend
//! on the machine smoothly. Over many periods of a vibration each mode that is off by a beat makes a minimum of
//! its own. In the end it is where the filter follows what is slower than the load.

use super::least_squares::{Fit, fit};
use super::log::period;
use super::predict::{Gain, Noise, Prediction, predict};
use super::{Log, Machine, Parameters};
use crate::error::{Error, Result};
use crate::output::Progress;
use rayon::prelude::*;

/// How far the densities of noise may be from where they are held, as logarithms.
const RANGE: f64 = 14.0;
/// Bandwidth of the filter while the noise is held, over the slowest mode of the drive file.
const HELD: f64 = 0.3;
/// The random force then, over the one that alone would have that bandwidth.
const QUIET: f64 = 0.1;
/// By how much more the random force is held at first, and then, as logarithms; the wander by its integral's
/// share.
const MORE: [f64; 3] = [8.0, 4.0, 0.0];
/// Where the beginning says little at first, starts are lost so that are found from little noise at once.
const HELD_ALONE: [f64; 1] = [0.0];
/// Loads up to which the search goes on from little noise in any case: what else a machine has is told better with
/// it.
const FEW: usize = 3;
/// Standard deviation of the quantities before the log is seen: a factor of e to either side of the
/// drive file, a tenth of the motor's force for friction. Against what a log says this weighs nothing.
const QUANTITY_DEVIATION: f64 = 1.0;
/// Standard deviation of the noise's logarithms before the log is seen.
const NOISE_DEVIATION: f64 = 5.0;
/// What of a record tells starts apart: periods of the drive file's slowest mode, and samples at most.
const BEGINNING: (f64, f64) = (8.0, 3000.0);
/// Starts that are fitted more closely before they are ranked.
const PROMISING: usize = 5;
/// Starts that are followed to the end, as many as end within a factor of the best.
const FOLLOWED: (usize, f64) = (3, 4.0);
/// Coordinates nearer than this are the same place.
pub(super) const SAME: f64 = 0.02;
/// Tolerances of the fits: that tell starts apart, that rank them, to the whole record.
const TOLERANCE: [f64; 3] = [3e-2, 1e-3, 1e-6];
/// Evaluations per coordinate after which these are given up: what is not found by then is followed on or
/// left.
const PATIENCE: usize = 2;

/// The innovations of a log in counts, over the coordinates of the search.
pub(super) struct Residuals<'a> {
    parameters: &'a Parameters,
    /// Coordinates of the drive file.
    nominal: Vec<f64>,
    /// Densities of the noise while it is held.
    pub(super) held: Noise,
}

impl<'a> Residuals<'a> {
    pub(super) fn new(logs: &[Log], parameters: &'a Parameters) -> Self {
        let period = period(logs);
        let mass = parameters.start().chain().mass.iter().sum::<f64>();
        // Of a double integrator seen in white noise, driven by a random force or by its integral.
        let rate = HELD * parameters.rate();
        Self {
            parameters,
            nominal: parameters.coordinates(parameters.start()),
            held: Noise {
                force: (QUIET * mass * rate.powi(2) * period.sqrt()).ln(),
                wander: (mass * rate.powi(3) * period.sqrt()).ln(),
            },
        }
    }

    /// How many coordinates are quantities; the others are the noise.
    pub(super) fn quantities(&self) -> usize {
        self.nominal.len()
    }

    /// Densities of the noise at some coordinates.
    pub(super) fn noise(&self, x: &[f64]) -> Noise {
        // Bounded: beyond this the filter is a simulation, or follows every count.
        let bounded = |x: f64| RANGE * (x / RANGE).tanh();
        let x = &x[self.nominal.len()..];
        Noise {
            force: self.held.force + bounded(x[0]),
            wander: self.held.wander + bounded(x[1]),
        }
    }

    /// Coordinates of more noise than is held, see [`Noise::more`].
    fn beyond(&self, more: f64) -> [f64; 2] {
        let noise = self.held.more(more);
        [
            noise.force - self.held.force,
            noise.wander - self.held.wander,
        ]
        .map(|x| RANGE * (x / RANGE).atanh())
    }

    /// What the filter makes of a log.
    pub(super) fn prediction(
        &self,
        log: &Log,
        machine: &Machine,
        noise: Noise,
    ) -> Option<Prediction> {
        let gain = Gain::new(log, machine, noise, self.parameters.force())?;
        predict(log, machine, &gain)
    }

    /// Over the quantities, the noise held: by a filter that is made for another machine.
    fn with_noise_held(&self, logs: &[Log], gains: &[Gain], x: &[f64]) -> Vec<f64> {
        let machine = self.parameters.machine(x);
        let found = logs.iter().zip(gains);
        let found = found.map(|(log, gain)| predict(log, &machine, gain));
        self.residuals(logs, found, x, &[])
    }

    /// Over the quantities and the noise.
    pub(super) fn of(&self, logs: &[Log], x: &[f64]) -> Vec<f64> {
        let (quantities, noise) = x.split_at(self.nominal.len());
        let machine = self.parameters.machine(quantities);
        let densities = self.noise(x);
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
pub(super) fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// The best first, no place twice.
pub(super) fn ranked(mut fits: Vec<Fit>, quantities: usize) -> Vec<Fit> {
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

/// Where the searches from some starts end, the best first.
///
/// # Errors
/// [`Error::Identification`] when none of this structure explains the records.
pub(super) fn search(
    logs: &[Log],
    parameters: &Parameters,
    residuals: &Residuals<'_>,
    starts: &[Machine],
    progress: &Progress<'_>,
) -> Result<Vec<Fit>> {
    let quantities = residuals.quantities();
    let beginning: Vec<Log> = logs
        .iter()
        .map(|log| {
            let rows = parameters.rows(BEGINNING.0, log.period);
            log.beginning(rows.min(BEGINNING.1) as usize)
        })
        .collect();
    let roughly = |x: &[f64], tolerance: f64, more: f64| -> Option<Fit> {
        let machine = parameters.machine(x);
        let noise = residuals.held.more(more);
        let gains: Vec<Gain> = beginning
            .iter()
            .map(|log| Gain::new(log, &machine, noise, parameters.force()))
            .collect::<Option<_>>()?;
        let first = |x: &[f64]| Some(residuals.with_noise_held(&beginning, &gains, x));
        Some(fit(&first, x, tolerance, PATIENCE))
    };
    let few = parameters.start().chain().loads() <= FEW;
    let starts: Vec<Vec<f64>> = starts
        .iter()
        .map(|machine| parameters.coordinates(machine))
        .collect();
    // The promising of the starts, followed from the first of some levels of noise through the others, at which
    // they go on with the whole records.
    let promising = |levels: &[f64]| -> Vec<Fit> {
        let fits = starts
            .par_iter()
            .filter_map(|start| roughly(start, TOLERANCE[0], levels[0]))
            .collect();
        let less_and_less = |start: &Fit| -> Option<Vec<Fit>> {
            let mut x = start.coordinates.clone();
            let mut all = Vec::new();
            for more in levels {
                let mut fit = roughly(&x, TOLERANCE[1], *more)?;
                x.clone_from(&fit.coordinates);
                fit.coordinates.extend(residuals.beyond(*more));
                all.push(fit);
            }
            let last = if few { levels.len() - 1 } else { 0 };
            Some(all.split_off(last))
        };
        ranked(fits, quantities)
            .par_iter()
            .take(PROMISING)
            .filter_map(less_and_less)
            .flatten()
            .collect()
    };
    progress(0, 4, "starts");
    let mut fits = promising(&MORE);
    fits.extend(promising(&HELD_ALONE));
    progress(1, 4, "whole record");
    let followed = ranked(fits, quantities);
    let fits: Vec<Fit> = followed
        .par_iter()
        .take(FOLLOWED.0)
        .filter(|start| start.cost <= FOLLOWED.1 * followed[0].cost)
        .map(|start| closely(logs, residuals, &start.coordinates))
        .collect();
    let ends = ranked(fits, quantities);
    if ends.is_empty() {
        return Err(Error::Identification(
            "no machine of this structure explains the log".into(),
        ));
    }
    Ok(ends)
}

/// A fit to whole records, the noise free.
pub(super) fn closely(logs: &[Log], residuals: &Residuals<'_>, x: &[f64]) -> Fit {
    fit(
        &|x: &[f64]| Some(residuals.of(logs, x)),
        x,
        TOLERANCE[2],
        PATIENCE,
    )
}
