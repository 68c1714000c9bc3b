//! What a machine has beside what every one has: a current that comes late, friction on its loads, a force
//! that is always there, more loads than the drive file has.
//!
//! At the end of a search each such thing is tried by how the innovations follow a little of it, after all
//! that the quantities in the fit could do about it. The one that would explain most is taken into the fit, if
//! that then errs less by far, and the others are tried again.

use super::estimate::{Residuals, closely};
use super::least_squares::{Fit, jacobian};
use super::{Log, Parameters, Quantity};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Chi square that one thing more must be expected to take away, and then take away.
const WORTH: f64 = 40.0;
/// The same as a share of all.
const SHARE: f64 = 0.01;
/// How much of a thing is tried, in coordinates.
const LITTLE: f64 = 0.05;
/// Things that are fitted of those that may be worth it.
const FITTED: usize = 3;
/// Things that one machine may have.
const MOST: usize = 4;

/// A search with what it needs, and where it ends.
pub(super) struct Structure {
    /// The quantities in the fit.
    pub(super) parameters: Parameters,
    /// Its ends, the best first.
    pub(super) ends: Vec<Fit>,
    /// What was added to what every machine has.
    pub(super) added: Vec<Quantity>,
}

/// Takes into a search what its records need.
///
/// * `force`: the motor's largest, N
pub(super) fn extended(logs: &[Log], force: f64, parameters: &Parameters, ends: Vec<Fit>) -> Structure {
    let mut structure = Structure {
        parameters: parameters.clone(),
        ends,
        added: Vec::new(),
    };
    while structure.added.len() < MOST {
        let Some(more) = once(logs, force, &structure) else {
            break;
        };
        structure = more;
    }
    structure
}

/// One thing more; none where none is worth it.
fn once(logs: &[Log], force: f64, structure: &Structure) -> Option<Structure> {
    let period = logs.first()?.period;
    let parameters = &structure.parameters;
    let best = structure.ends.first()?;
    let residuals = Residuals::new(force, period, parameters);
    let quantities = residuals.quantities();
    let slopes = jacobian(&|x: &[f64]| Some(residuals.of(logs, x)), &best.coordinates)?;
    let errors = DVector::from_vec(residuals.of(logs, &best.coordinates));
    let periods: usize = logs.iter().map(|log| log.current.len()).sum();
    let variance = 2.0 * best.cost / periods as f64;
    let worth = (WORTH * variance).max(SHARE * 2.0 * best.cost);
    let orthogonal = Orthogonal::to(&slopes)?;

    // Each with what is expected of it, and how much of it there would be.
    let mut candidates: Vec<(Quantity, f64, f64)> = parameters
        .extensions()
        .into_par_iter()
        .filter_map(|quantity| {
            let more = parameters.with(quantity);
            let residuals = Residuals::new(force, period, &more);
            let at = |amount: f64| {
                let mut x = best.coordinates.clone();
                x.insert(quantities, residuals.of_nothing(quantity) + amount);
                residuals.of(logs, &x)
            };
            let (without, with) = (at(0.0), at(LITTLE));
            let mut column = DVector::zeros(errors.len());
            for (row, (with, without)) in with.iter().zip(&without).enumerate().take(periods) {
                column[row] = (with - without) / LITTLE;
            }
            let column = orthogonal.part_of(&column);
            let size = column.norm_squared();
            let amount = -column.dot(&errors) / size;
            let expected = amount * amount * size;
            (expected > worth && (amount > 0.0 || quantity.signed()))
                .then_some((quantity, expected, amount))
        })
        .collect();
    candidates.sort_by(|a, b| b.1.total_cmp(&a.1));
    candidates
        .par_iter()
        .take(FITTED)
        .filter_map(|(quantity, _, amount)| {
            let more = parameters.with(*quantity);
            let residuals = Residuals::new(force, period, &more);
            let mut x = best.coordinates.clone();
            x.insert(
                quantities,
                residuals.of_nothing(*quantity) + amount.clamp(-1.0, 1.0),
            );
            let end = closely(logs, &residuals, &x);
            let gained = 2.0 * (best.cost - end.cost);
            let mut added = structure.added.clone();
            added.push(*quantity);
            (gained > worth).then_some(Structure {
                parameters: more,
                ends: vec![end],
                added,
            })
        })
        .min_by(|a, b| a.ends[0].cost.total_cmp(&b.ends[0].cost))
}

/// What is orthogonal to some columns.
struct Orthogonal {
    basis: DMatrix<f64>,
}

impl Orthogonal {
    /// None where the columns are none.
    fn to(columns: &DMatrix<f64>) -> Option<Self> {
        let basis = columns.clone().qr().q();
        basis.iter().all(|x| x.is_finite()).then_some(Self { basis })
    }

    fn part_of(&self, column: &DVector<f64>) -> DVector<f64> {
        column - &self.basis * self.basis.tr_mul(column)
    }
}
