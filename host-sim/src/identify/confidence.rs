//! How far the figures can be trusted.
//!
//! The covariance of the fit takes errors that neighbouring samples share into account, but an encoder's
//! rounding is no noise: where the actuator creeps or stands, it errs the same way for as long. So records of
//! the identified machine are simulated and rounded, each from another place within a count, and the fit is
//! taken one step from where it is towards each of them. What spreads wider counts.

use super::Log;
use super::estimate::Residuals;
use super::predict::simulation;
use super::settle::Estimate;
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

/// Chi square by which another end of the search may be worse and still be the truth.
const POSSIBLE: f64 = 25.0;
/// Records that are simulated to see what rounding does to the figures.
const SIMULATED: u64 = 24;

/// Covariance of coordinates were the errors white, from their derivatives; none where some have no effect.
///
/// * `cost`: half the sum of squared errors
pub(super) fn white(slopes: &DMatrix<f64>, cost: f64) -> Option<DMatrix<f64>> {
    let (rows, columns) = slopes.shape();
    let variance = 2.0 * cost / rows.saturating_sub(columns).max(1) as f64;
    Some(inverse_of_normal(slopes)? * variance)
}

/// `(JᵀJ)⁻¹`, by columns in units of their own effect so that no figures are lost; none where some have none.
fn inverse_of_normal(slopes: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let sizes: Vec<f64> = slopes.column_iter().map(|column| column.norm()).collect();
    // Written so that what is no number is refused.
    if !sizes.iter().all(|size| *size > 0.0) {
        return None;
    }
    let mut scaled = slopes.clone();
    for (mut column, size) in scaled.column_iter_mut().zip(&sizes) {
        column /= *size;
    }
    let mut inverse = scaled.tr_mul(&scaled).try_inverse()?;
    for (i, size) in sizes.iter().enumerate() {
        inverse.row_mut(i).scale_mut(1.0 / size);
        inverse.column_mut(i).scale_mut(1.0 / size);
    }
    Some(inverse)
}

/// Covariance of the coordinates of a search, from three sides.
#[derive(Clone, Debug)]
pub(super) struct Covariance {
    /// Were the innovations white.
    white: DMatrix<f64>,
    /// From how they are correlated (Newey and West, Econometrica 55, 1987).
    coloured: DMatrix<f64>,
    /// What the encoder's rounding adds.
    rounding: DMatrix<f64>,
}

impl Covariance {
    /// None when some coordinates have no effect at all.
    ///
    /// * `memory`: over how many samples innovations are correlated
    pub(super) fn new(
        logs: &[Log],
        residuals: &Residuals<'_>,
        estimate: &Estimate,
        memory: usize,
    ) -> Option<Self> {
        let (slopes, errors) = (&estimate.slopes, &estimate.errors);
        let (rows, columns) = slopes.shape();
        let inverse = inverse_of_normal(slopes)?;
        let variance =
            errors.iter().map(|e| e * e).sum::<f64>() / rows.saturating_sub(columns).max(1) as f64;
        let scores = DMatrix::from_fn(rows, columns, |i, j| slopes[(i, j)] * errors[i]);
        let mut spread = scores.tr_mul(&scores);
        for lag in 1..=memory.min(rows - 1) {
            let weight = 1.0 - lag as f64 / (memory + 1) as f64;
            let late = scores.rows(lag, rows - lag);
            let early = scores.rows(0, rows - lag);
            let product = late.tr_mul(&early) * weight;
            spread += &product + product.transpose();
        }
        let result = Self {
            white: &inverse * variance,
            coloured: &inverse * spread * &inverse,
            rounding: rounding(logs, residuals, estimate, &inverse)?,
        };
        let all = [&result.white, &result.coloured, &result.rounding];
        all.iter()
            .all(|matrix| matrix.iter().all(|value| value.is_finite()))
            .then_some(result)
    }

    /// Standard deviation of something by its derivatives along the coordinates: the larger of what white
    /// and correlated innovations leave, the rounding, and no less than other ends of the search say.
    ///
    /// * `distances`: of those ends in this, and how unlikely each is ([`Rival::likelihood`])
    pub(super) fn deviation(
        &self,
        slope: &DVector<f64>,
        distances: impl Iterator<Item = (f64, f64)>,
    ) -> f64 {
        let along = |matrix: &DMatrix<f64>| slope.dot(&(matrix * slope)).max(0.0);
        let white = along(&self.white);
        let variance = white.max(along(&self.coloured)) + along(&self.rounding);
        let wider = if white > 0.0 { variance / white } else { 1.0 };
        // An end that is worse by d of chi square lies √d standard deviations away where all is linear.
        let others = distances
            .map(|(distance, likelihood)| (distance, likelihood / wider))
            .filter(|(_, likelihood)| *likelihood < POSSIBLE)
            .map(|(distance, likelihood)| distance / likelihood.max(1.0).sqrt());
        others.fold(variance.sqrt(), f64::max)
    }
}

/// Another end of a search.
#[derive(Clone, Debug)]
pub(super) struct Rival {
    /// Coordinates of its quantities.
    pub(super) coordinates: Vec<f64>,
    /// By how much its chi square is worse.
    pub(super) likelihood: f64,
}

/// The other ends of a search.
pub(super) fn rivals(estimate: &Estimate) -> Vec<Rival> {
    let variance = estimate.variance();
    let rivals = estimate.rivals.iter().map(|end| Rival {
        coordinates: end.coordinates.clone(),
        likelihood: (2.0 * (end.cost - estimate.cost) / variance).max(0.0),
    });
    // A search that has stopped on the way says nothing by how well it explains.
    let strays = estimate.strays.iter().map(|end| Rival {
        coordinates: end.coordinates.clone(),
        likelihood: 0.0,
    });
    rivals.chain(strays).collect()
}

/// Correlation of the innovations with themselves, `lag` samples later.
pub(super) fn correlation(errors: &[f64], lag: usize) -> f64 {
    let all: f64 = errors.iter().map(|e| e * e).sum();
    let pairs = errors.iter().zip(errors.iter().skip(lag));
    pairs.map(|(a, b)| a * b).sum::<f64>() / all
}

/// Covariance of the coordinates that the encoder's rounding gives: over records of the estimated machine
/// that are rounded anew.
///
/// * `inverse`: of the normal equations
fn rounding(
    logs: &[Log],
    residuals: &Residuals<'_>,
    estimate: &Estimate,
    inverse: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let machine = &estimate.machine;
    // The force that the filter found beside the current keeps the simulation where the record is.
    let pushes: Vec<Vec<f64>> = logs
        .iter()
        .map(|log| Some(residuals.prediction(log, machine, estimate.noise)?.wander))
        .collect::<Option<_>>()?;
    let tracks: Vec<Vec<f64>> = logs
        .iter()
        .zip(&pushes)
        .map(|(log, push)| simulation(log, machine, push))
        .collect();
    // What the innovations of a record say about each coordinate.
    let score = |logs: &[Log]| -> Option<DVector<f64>> {
        let mut errors = Vec::new();
        for log in logs {
            errors.extend(
                residuals
                    .prediction(log, machine, estimate.noise)?
                    .innovations,
            );
        }
        let errors = DVector::from_vec(errors);
        Some(estimate.slopes.rows(0, errors.len()).tr_mul(&errors))
    };
    let unrounded: Vec<Log> = logs
        .iter()
        .zip(&tracks)
        .map(|(log, track)| Log {
            position: track.clone(),
            ..log.clone()
        })
        .collect();
    let exact = score(&unrounded)?;
    let steps: Vec<DVector<f64>> = (0..SIMULATED)
        .into_par_iter()
        .map(|seed| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let rounded: Vec<Log> = logs
                .iter()
                .zip(&tracks)
                .map(|(log, track)| {
                    let place: f64 = random.random_range(-0.5..0.5);
                    let count = |x: &f64| (x / log.resolution + place).round() * log.resolution;
                    Log {
                        position: track.iter().map(count).collect(),
                        ..log.clone()
                    }
                })
                .collect();
            Some(inverse * (score(&rounded)? - &exact))
        })
        .collect::<Option<_>>()?;
    let size = inverse.nrows();
    Some(DMatrix::from_fn(size, size, |i, j| {
        steps.iter().map(|step| step[i] * step[j]).sum::<f64>() / SIMULATED as f64
    }))
}
