//! The proof that a search has ended: from its end again until nothing moves, and from either side along what
//! is known least. Other ends that the records allow are kept, and where the searches from beside the result come to
//! lie that do not find back to it: they tell how far the truth may be.

use super::confidence::white;
use super::estimate::{Residuals, SAME, apart, closely, ranked};
use super::least_squares::{Fit, fit, jacobian};
use super::predict::Noise;
use super::{Log, Machine, Parameters};
use crate::error::{Error, Result};
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// Tolerance of the fits from where one ended.
const TOLERANCE: f64 = 1e-10;
/// Evaluations per coordinate after which one is given up.
const PATIENCE: usize = 3;
/// How far the last fit may move, in standard deviations, and how often one is tried.
const STILL: (f64, usize) = (0.05, 5);
/// How far a start beside the result is put along what is known least: standard deviations, but in
/// coordinates at least and at most.
const BESIDE: (f64, f64, f64) = (5.0, 0.03, 0.3);
/// How often the search may move on to a better end.
const MOVES: usize = 6;
/// Standard deviations within which a search from beside the result must come back to it.
const ASTRAY: f64 = 1.0;
/// Chi square by which an end must be better to be another.
const BETTER: f64 = 0.1;

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
    /// Other ends of the search.
    pub(super) rivals: Vec<Fit>,
    /// Ends of searches from beside it that have not come back: so far it may be from where it would end.
    pub(super) strays: Vec<Fit>,
}

impl Estimate {
    /// Variance of one innovation, counts².
    pub(super) fn variance(&self) -> f64 {
        let (rows, columns) = self.slopes.shape();
        2.0 * self.cost / rows.saturating_sub(columns).max(1) as f64
    }
}

/// Why nothing can be said of some quantities.
pub(super) fn undetermined() -> Error {
    Error::Identification(
        "the log does not determine the quantities at all: some have no effect on it".into(),
    )
}

/// The end of a search, once nothing moves any more.
///
/// * `ends`: the best first
///
/// # Errors
/// [`Error::Identification`] when there is none.
pub(super) fn settle(
    logs: &[Log],
    parameters: &Parameters,
    residuals: &Residuals<'_>,
    mut ends: Vec<Fit>,
) -> Result<Estimate> {
    let quantities = residuals.quantities();
    let all = |x: &[f64]| Some(residuals.of(logs, x));
    let slopes_at = |fit: &Fit| jacobian(&all, &fit.coordinates);
    // They may come from the beginning of the records.
    for end in &mut ends {
        *end = closely(logs, residuals, &end.coordinates);
    }
    let mut ends = ranked(ends, quantities);
    let mut best = ends.first().cloned().ok_or_else(undetermined)?;
    let mut slopes = slopes_at(&best).ok_or_else(undetermined)?;
    let mut strays = Vec::new();
    for _ in 0..MOVES {
        let before = best.clone();
        let mut still = false;
        for _ in 0..STILL.1 {
            let again = fit(&all, &best.coordinates, TOLERANCE, PATIENCE);
            let spread = white(&slopes, best.cost).ok_or_else(undetermined)?;
            still = within(STILL.0, &again, &best, &spread, quantities);
            if again.cost < best.cost {
                best = again;
                slopes = slopes_at(&best).ok_or_else(undetermined)?;
            }
            if still {
                break;
            }
        }
        if !still {
            // Where it was is as likely as where it is.
            ends.push(before);
        }
        let spread = white(&slopes, best.cost).ok_or_else(undetermined)?;
        let sides = from_either_side(logs, residuals, &best, &spread);
        let strayed = |end: &&Fit| !within(ASTRAY, end, &best, &spread, quantities);
        strays = sides.iter().filter(strayed).cloned().collect();
        ends.extend(sides);
        let variance = 2.0 * best.cost / slopes.nrows() as f64;
        let better = ends
            .iter()
            .filter(|end| 2.0 * (best.cost - end.cost) > BETTER * variance)
            .min_by(|a, b| a.cost.total_cmp(&b.cost))
            .cloned();
        let Some(better) = better else {
            break;
        };
        ends.push(std::mem::replace(&mut best, better));
        slopes = slopes_at(&best).ok_or_else(undetermined)?;
    }
    let elsewhere = |end: &Fit| {
        let (end, best) = (&end.coordinates, &best.coordinates);
        apart(&end[..quantities], &best[..quantities]) >= SAME
    };
    ends.retain(elsewhere);
    Ok(Estimate {
        machine: parameters.machine(&best.coordinates[..quantities]),
        noise: residuals.noise(&best.coordinates),
        errors: residuals.of(logs, &best.coordinates),
        coordinates: best.coordinates,
        slopes,
        cost: best.cost,
        rivals: ranked(ends, quantities),
        strays,
    })
}

/// Whether two ends are that near in every quantity, standard deviations.
///
/// * `spread`: covariance of the coordinates
fn within(limit: f64, a: &Fit, b: &Fit, spread: &DMatrix<f64>, quantities: usize) -> bool {
    (0..quantities).all(|i| {
        let distance = a.coordinates[i] - b.coordinates[i];
        distance.abs() < limit * spread[(i, i)].sqrt()
    })
}

/// Fits from two places beside an end, along what is known least of the quantities.
///
/// * `spread`: covariance of the coordinates
fn from_either_side(
    logs: &[Log],
    residuals: &Residuals<'_>,
    end: &Fit,
    spread: &DMatrix<f64>,
) -> Vec<Fit> {
    let quantities = residuals.quantities();
    let block = spread.view((0, 0), (quantities, quantities)).into_owned();
    let eigen = SymmetricEigen::new(block);
    let weakest = eigen.eigenvalues.imax();
    let direction = eigen.eigenvectors.column(weakest);
    let size = BESIDE.0 * eigen.eigenvalues[weakest].max(0.0).sqrt();
    let size = size.clamp(BESIDE.1, BESIDE.2) / direction.amax();
    [-size, size]
        .par_iter()
        .map(|size| {
            let mut x = end.coordinates.clone();
            for (x, direction) in x.iter_mut().zip(direction.iter()) {
                *x += size * direction;
            }
            closely(logs, residuals, &x)
        })
        .collect()
}
