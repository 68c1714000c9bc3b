//! What a machine has beside what every one has: a current that comes late, friction on its loads, a force
//! that is always there, more loads than the drive file has.
//!
//! At the end of a search each such thing is tried by how the innovations follow a little of it, after all
//! that the quantities in the fit could do about it. The one that would explain most is taken into the fit, if
//! that then errs less by far, and the others are tried again.

use super::confidence::white;
use super::estimate::{Residuals, closely};
use super::least_squares::{Fit, jacobian};
use super::log::intervals;
use super::parameters::{RippleKind, RipplePart};
use super::settle::Estimate;
use super::{Experiment, Log, Parameters, Quantity};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Chi square that one thing more must be expected to take away, and then take away.
const WORTH: f64 = 40.0;
/// The same as a share of all.
const SHARE: f64 = 0.03;
/// Standard deviations that a thing must be away from none to be kept.
const SIGNIFICANT: f64 = 4.0;
/// How much of a thing is tried, in coordinates.
const LITTLE: f64 = 0.05;
/// Things that are fitted of those that may be worth it.
const FITTED: usize = 3;
/// Things that one machine may have.
const MOST: usize = 4;

/// Lengths that are tried for what repeats itself over the position: at least so many rows of the fastest
/// motion, at most this share of all of it, each shorter than the one before by a factor, and how many.
const ROWS: f64 = 5.0;
const LONGEST: f64 = 0.7;
const FINER: f64 = 1.05;
const PITCHES: usize = 60;

/// A search with what it needs, and where it ends.
pub(super) struct Structure {
    /// The quantities in the fit.
    pub(super) parameters: Parameters,
    /// Its ends, the best first.
    pub(super) ends: Vec<Fit>,
    /// What was added to what every machine has.
    pub(super) added: Vec<Quantity>,
}

impl Structure {
    /// The same without what an estimate has none of; none where there is no such thing.
    pub(super) fn without_nothing(&self, estimate: &Estimate) -> Option<Self> {
        let spread = white(&estimate.slopes, estimate.cost)?;
        let (position, quantity) = self.added.iter().find_map(|quantity| {
            let position = self.parameters.free().position(|free| free == *quantity)?;
            let nothing = self.parameters.coordinates(self.parameters.start())[position];
            let amount = estimate.coordinates[position] - nothing;
            let amount = if quantity.signed() {
                amount.abs()
            } else {
                amount
            };
            let little = SIGNIFICANT * spread[(position, position)].sqrt();
            let single = !matches!(quantity, Quantity::Ripple(_));
            (single && amount < little).then_some((position, *quantity))
        })?;
        let mut coordinates = estimate.coordinates.clone();
        coordinates.remove(position);
        let added = self.added.iter().filter(|added| **added != quantity);
        Some(Self {
            parameters: self.parameters.without(quantity),
            ends: vec![Fit {
                coordinates,
                cost: estimate.cost,
            }],
            added: added.copied().collect(),
        })
    }
}

/// One thing more; none where none is worth it.
pub(super) fn extended(logs: &[Log], structure: &Structure) -> Option<Structure> {
    if structure.added.len() >= MOST {
        return None;
    }
    let parameters = &structure.parameters;
    let best = structure.ends.first()?;
    let residuals = Residuals::new(logs, parameters);
    let quantities = residuals.quantities();
    let slopes = jacobian(&|x: &[f64]| Some(residuals.of(logs, x)), &best.coordinates)?;
    let errors = DVector::from_vec(residuals.of(logs, &best.coordinates));
    let periods = intervals(logs);
    let variance = 2.0 * best.cost / periods as f64;
    let worth = (WORTH * variance).max(SHARE * 2.0 * best.cost);
    let orthogonal = Orthogonal::to(&slopes)?;

    let mut trials: Vec<Trial> = parameters
        .extensions()
        .into_iter()
        .map(Trial::One)
        .collect();
    let whole = parameters.experiment() == Experiment::Excitation;
    if whole && parameters.start().ripple.is_none() {
        let pitches = pitches(logs);
        for kind in [RippleKind::Cogging, RippleKind::Eccentricity] {
            trials.extend(pitches.iter().map(|pitch| Trial::Ripple(kind, *pitch)));
        }
    }
    // Each with what is expected of it, and how much of it there would be.
    let mut candidates: Vec<(Trial, f64, Vec<f64>)> = trials
        .into_par_iter()
        .filter_map(|trial| {
            let (more, varied) = trial.added_to(parameters);
            let residuals = Residuals::new(logs, &more);
            let nothing: Vec<f64> = more.coordinates(more.start())[quantities..].to_vec();
            let at = |varied: Option<usize>| {
                let mut x = best.coordinates.clone();
                x.splice(quantities..quantities, nothing.iter().copied());
                if let Some(index) = varied {
                    x[quantities + index] += LITTLE;
                }
                residuals.of(logs, &x)
            };
            let without = at(None);
            let mut columns = DMatrix::zeros(errors.len(), varied);
            for (index, mut column) in columns.column_iter_mut().enumerate() {
                let with = at(Some(index));
                for row in 0..periods {
                    column[row] = (with[row] - without[row]) / LITTLE;
                }
            }
            let columns = orthogonal.part_of(&columns);
            let amounts = -(columns.tr_mul(&columns).try_inverse()? * columns.tr_mul(&errors));
            let expected = (&columns * &amounts).norm_squared();
            let possible = trial.signed() || amounts[0] > 0.0;
            let mut start = nothing;
            for (x, amount) in start.iter_mut().zip(amounts.iter()) {
                *x += amount.clamp(-1.0, 1.0);
            }
            (possible && expected > worth).then_some((trial, expected, start))
        })
        .collect();
    candidates.sort_by(|a, b| b.1.total_cmp(&a.1));
    // Of neighbouring pitches the best.
    let mut kept: Vec<(Trial, f64, Vec<f64>)> = Vec::new();
    for candidate in candidates {
        if !kept.iter().any(|other| other.0.like(&candidate.0)) {
            kept.push(candidate);
        }
    }
    kept.par_iter()
        .take(FITTED)
        .filter_map(|(trial, _, start)| {
            let (more, _) = trial.added_to(parameters);
            let residuals = Residuals::new(logs, &more);
            let mut x = best.coordinates.clone();
            x.splice(quantities..quantities, start.iter().copied());
            let end = closely(logs, &residuals, &x);
            let gained = 2.0 * (best.cost - end.cost);
            let mut added = structure.added.clone();
            added.push(trial.quantity());
            (gained > worth).then_some(Structure {
                parameters: more,
                ends: vec![end],
                added,
            })
        })
        .min_by(|a, b| a.ends[0].cost.total_cmp(&b.ends[0].cost))
}

/// Something to be tried.
#[derive(Clone, Copy, Debug)]
enum Trial {
    One(Quantity),
    /// Over a length, m.
    Ripple(RippleKind, f64),
}

impl Trial {
    /// The quantities with it, and how many of its own are varied at first.
    fn added_to(self, parameters: &Parameters) -> (Parameters, usize) {
        match self {
            Trial::One(quantity) => (parameters.with(quantity), 1),
            Trial::Ripple(kind, pitch) => (parameters.with_ripple(kind, pitch), 2),
        }
    }

    fn quantity(self) -> Quantity {
        match self {
            Trial::One(quantity) => quantity,
            Trial::Ripple(..) => Quantity::Ripple(RipplePart::Sine),
        }
    }

    fn signed(self) -> bool {
        self.quantity().signed()
    }

    /// Whether it is the same but for a length.
    fn like(&self, other: &Self) -> bool {
        match (self, other) {
            (Trial::One(a), Trial::One(b)) => a == b,
            (Trial::Ripple(a, _), Trial::Ripple(b, _)) => a == b,
            _ => false,
        }
    }
}

/// Lengths over which something may repeat itself: from some rows of the fastest motion to half of all.
fn pitches(logs: &[Log]) -> Vec<f64> {
    let positions = || logs.iter().flat_map(|log| log.position.iter().copied());
    let (low, high) = positions().fold((f64::MAX, f64::MIN), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    let steps = logs.iter().flat_map(|log| log.position.windows(2));
    let fastest = steps
        .map(|pair| (pair[1] - pair[0]).abs())
        .fold(0.0, f64::max);
    let (shortest, longest) = (ROWS * fastest, (high - low) * LONGEST);
    let mut pitches = vec![longest];
    while let Some(last) = pitches.last()
        && last / FINER > shortest
        && pitches.len() < PITCHES
    {
        pitches.push(last / FINER);
    }
    pitches
}

/// What is orthogonal to some columns.
struct Orthogonal {
    basis: DMatrix<f64>,
}

impl Orthogonal {
    /// None where the columns are none.
    fn to(columns: &DMatrix<f64>) -> Option<Self> {
        let basis = columns.clone().qr().q();
        basis
            .iter()
            .all(|x| x.is_finite())
            .then_some(Self { basis })
    }

    fn part_of(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        columns - &self.basis * self.basis.tr_mul(columns)
    }
}
