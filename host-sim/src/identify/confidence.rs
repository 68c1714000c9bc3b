//! How far the figures can be trusted: covariance of the fit, and what the log does not determine.

use super::{Identified, Machine, Point, Quantity};
use crate::error::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Relative standard deviation from which a quantity counts as not determined. Masses and stiffnesses:
/// three of it are the 30 % that a design is compared over; dampings: three of it reach down to none.
const UNDETERMINED: (f64, f64) = (0.1, 1.0 / 3.0);
/// Correlation from which two quantities cannot be told from each other.
const ALIKE: f64 = 0.98;

/// Covariance of the coordinates: that of white innovations, and where they are not white the larger one
/// that follows from how they are correlated (Newey and West, Econometrica 55, 1987).
pub(super) fn covariance(
    slopes: &DMatrix<f64>,
    errors: &[f64],
    memory: usize,
) -> Option<DMatrix<f64>> {
    let (rows, columns) = slopes.shape();
    // Each coordinate in units of its own effect, so that the inverse loses no figures.
    let sizes: Vec<f64> = slopes.column_iter().map(|column| column.norm()).collect();
    // Written so that what is no number is refused.
    if !sizes.iter().all(|size| *size > 0.0) {
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
pub(super) fn correlation(errors: &[f64], lag: usize) -> f64 {
    let all: f64 = errors.iter().map(|e| e * e).sum();
    let pairs = errors.iter().zip(errors.iter().skip(lag));
    pairs.map(|(a, b)| a * b).sum::<f64>() / all
}

/// Refuses what the log does not determine, with the reason.
pub(super) fn require_determined(
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
                "it cannot be told from {other}: hold one of them (`hold` {other})",
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
