//! Nonlinear least squares: Levenberg and Marquardt from a crate, derivatives by central differences.
//!
//! The differences are narrow: a record of 24 s tells a mass to a part in a million, and over more than
//! that the residuals bend. A slope that is wrong in its fourth figure hides the directions in which a chain of
//! six loads is known least, by ratios of a million, and the search ends beside the minimum.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::DMatrix;
use nalgebra_034::storage::Owned;
use nalgebra_034::{DMatrix as CrateMatrix, DVector as CrateVector, Dyn};
use rayon::prelude::*;

/// Width of the differences, in coordinates that are logarithms or of the order of one.
const WIDTH: f64 = 1e-6;

/// Where a fit ended.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// The coordinates.
    pub(super) coordinates: Vec<f64>,
    /// Half the sum of squared residuals there.
    pub(super) cost: f64,
}

struct Problem<'a, F> {
    coordinates: CrateVector<f64>,
    residuals: &'a F,
}

/// Derivatives of the residuals, a column for each coordinate, in parallel.
pub(super) fn jacobian<F>(residuals: &F, at: &[f64]) -> Option<DMatrix<f64>>
where
    F: Fn(&[f64]) -> Option<Vec<f64>> + Sync,
{
    let column = |i: usize| -> Option<Vec<f64>> {
        let moved = |by: f64| {
            let mut point = at.to_vec();
            point[i] += by;
            residuals(&point)
        };
        let (above, below) = (moved(WIDTH)?, moved(-WIDTH)?);
        Some(
            above
                .iter()
                .zip(&below)
                .map(|(a, b)| (a - b) / (2.0 * WIDTH))
                .collect(),
        )
    };
    let all: Vec<Vec<f64>> = (0..at.len())
        .into_par_iter()
        .map(column)
        .collect::<Option<_>>()?;
    let rows = all.first()?.len();
    Some(DMatrix::from_vec(rows, at.len(), all.concat()))
}

impl<F> LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_, F>
where
    F: Fn(&[f64]) -> Option<Vec<f64>> + Sync,
{
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, coordinates: &CrateVector<f64>) {
        self.coordinates.copy_from(coordinates);
    }

    fn params(&self) -> CrateVector<f64> {
        self.coordinates.clone()
    }

    fn residuals(&self) -> Option<CrateVector<f64>> {
        (self.residuals)(self.coordinates.as_slice()).map(CrateVector::from_vec)
    }

    fn jacobian(&self) -> Option<CrateMatrix<f64>> {
        let jacobian = jacobian(self.residuals, self.coordinates.as_slice())?;
        let (rows, columns) = jacobian.shape();
        Some(CrateMatrix::from_vec(
            rows,
            columns,
            jacobian.data.as_vec().clone(),
        ))
    }
}

/// The coordinates of least residuals near a start.
///
/// * `residuals`: none where they cannot be computed
/// * `patience`: evaluations of the residuals, per coordinate, after which it is given up
pub(super) fn fit<F>(residuals: &F, start: &[f64], tolerance: f64, patience: usize) -> Fit
where
    F: Fn(&[f64]) -> Option<Vec<f64>> + Sync,
{
    let problem = Problem {
        coordinates: CrateVector::from_column_slice(start),
        residuals,
    };
    let solver = LevenbergMarquardt::new()
        .with_patience(patience)
        .with_ftol(tolerance)
        .with_xtol(tolerance)
        .with_gtol(1e-12);
    let (problem, report) = solver.minimize(problem);
    Fit {
        coordinates: problem.coordinates.as_slice().to_vec(),
        cost: if report.objective_function.is_finite() {
            report.objective_function
        } else {
            f64::INFINITY
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An exponential through noiseless points: the parameters come back.
    #[test]
    fn an_exponential_is_found() {
        let residuals = |p: &[f64]| {
            let points = (0..30).map(f64::from);
            Some(
                points
                    .map(|t| p[0].exp() * (-p[1].exp() * t).exp() - 2.0 * (-0.1 * t).exp())
                    .collect(),
            )
        };
        let found = fit(&residuals, &[0.0, -1.0], 1e-12, 30);
        assert!((found.coordinates[0] - 2.0_f64.ln()).abs() < 1e-8);
        assert!((found.coordinates[1] - 0.1_f64.ln()).abs() < 1e-8);
        assert!(found.cost < 1e-15);
    }

    /// Where one direction weighs a million times another and the residuals bend along it, the slope along
    /// the other is still the one in closed form.
    #[test]
    fn what_weighs_little_is_seen_beside_what_weighs_much() {
        let times: Vec<f64> = (1..=20).map(|k| f64::from(k) / 20.0).collect();
        let residuals = |p: &[f64]| {
            let bend = |t: f64| 1e6 * (100.0 * (p[0] + 2.0 * p[1]) * t).sin();
            let little = |t: f64| 200.0 * (p[0] - p[1]) * t * t;
            Some(times.iter().map(|t| bend(*t) + little(*t)).collect())
        };
        // Along (2, -1) the large part does not change.
        let slopes = jacobian(&residuals, &[0.001, 0.002]).unwrap();
        for (row, t) in slopes.row_iter().zip(&times) {
            let found = 2.0 * row[0] - row[1];
            assert!((found - 600.0 * t * t).abs() < 6.0, "{found} at {t}");
        }
    }
}
