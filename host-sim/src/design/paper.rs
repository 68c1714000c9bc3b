//! The gains printed in the paper, on plants consistent with its Table I.
//!
//! The paper publishes neither stiffness nor damping. For a grid of both: is `A − B K` stable with
//! the printed `K`, the input being the current, and is `A − M C_f` stable with the printed `M`,
//! apart from the rigid motion, which eq. (17) cannot observe? Nothing is claimed beyond what is
//! computed here.

use crate::chain::Chain;
use crate::chain::load::relative_motion;
use crate::error::Result;
use crate::linear::eigen::eigenvalues;
use nalgebra::{DMatrix, DVector, RowDVector};
use serde::Serialize;

/// Printed feedback gain, A/m and A s/m, order `x_a v_a x_1 v_1 x_2 v_2 x_3 v_3`.
pub const K: [f64; 8] = [10.03, 2.12, 6.75, 1.43, 6.55, 1.43, 6.45, 1.42];
/// Printed observer gain, same order.
pub const M: [f64; 8] = [0.3, 0.1, 0.3, 0.3, 0.1, 0.2, 3.0, 3.0];

/// First step of the paper's experiments (Fig. 3), m.
pub const STEP: f64 = 0.03;

/// Stiffness of the grid, N/m.
pub const STIFFNESS: [f64; 7] = [1.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0];
/// Damping of the grid, N s/m.
pub const DAMPING: [f64; 7] = [0.01, 0.1, 0.3, 0.6, 1.0, 10.0, 100.0];

/// One plant of the grid.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    /// N/m.
    pub stiffness: f64,
    /// N s/m.
    pub damping: f64,
    /// Largest real part of the poles of `A − B K`, 1/s.
    pub regulator: f64,
    /// Largest real part of the poles of `A − M C_f`, rigid motion left out, 1/s.
    pub observer: f64,
}

/// The whole grid, row by row of stiffness.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when an eigenvalue iteration does not converge.
pub fn grid() -> Result<Vec<Point>> {
    let slowest = |matrix: &DMatrix<f64>| -> Result<f64> {
        Ok(eigenvalues(matrix)?
            .iter()
            .map(|pole| pole.re)
            .fold(f64::NEG_INFINITY, f64::max))
    };
    let mut points = Vec::new();
    for stiffness in STIFFNESS {
        for damping in DAMPING {
            let chain = Chain::of_table_1(stiffness, damping);
            let closed = chain.a() - chain.b() * RowDVector::from_row_slice(&K);
            let (relative, lift) = relative_motion(&chain);
            let corrected = chain.a() - DVector::from_row_slice(&M) * chain.reaction_force();
            points.push(Point {
                stiffness,
                damping,
                regulator: slowest(&closed)?,
                observer: slowest(&(relative * corrected * lift))?,
            });
        }
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against `NumPy`'s eigenvalues of the whole 8 x 8 matrices (largest real part beside the double
    /// zero): an independent eigenvalue routine and assembly.
    #[test]
    fn printed_gains_behave_as_computed_elsewhere() {
        for (stiffness, damping, observer) in [
            (10.0, 0.1, 1.9950393445681875),
            (10.0, 0.6, -2.414780253862019),
            (30.0, 1.0, -0.7404534043667284),
            (300.0, 0.1, 45.68798387113688),
            (300.0, 10.0, -15.790080196671067),
            (300.0, 100.0, -2.9999511973367916),
        ] {
            let grid = grid().unwrap();
            let mut points = grid.iter();
            let point = points
                .find(|p| (p.stiffness, p.damping) == (stiffness, damping))
                .unwrap();
            assert!(
                (point.observer - observer).abs() < 1e-6 * observer.abs(),
                "{point:?}"
            );
        }
    }

    /// The printed K is unstable at k = 300, c = 0.1 and stable at c = 0.3, and from c = 0.6 on wherever
    /// k lies from 100 to 300 (`arso_core::theory`, (14)).
    #[test]
    fn printed_regulator_needs_damping() {
        for point in grid().unwrap() {
            let Point {
                stiffness, damping, ..
            } = point;
            if (stiffness, damping) == (300.0, 0.1) {
                assert!(point.regulator > 0.0);
            }
            if (stiffness, damping) == (300.0, 0.3) {
                assert!(point.regulator < 0.0);
            }
            if (100.0..=300.0).contains(&stiffness) && damping >= 0.6 {
                assert!(point.regulator < 0.0, "{point:?}");
            }
        }
    }

    /// The rigid motion that is left out: the characteristic polynomial of the whole is that of
    /// the relative motion times s².
    #[test]
    fn the_relative_motion_has_all_other_poles() {
        let chain = Chain::of_table_1(300.0, 0.1);
        let whole = chain.a() - DVector::from_row_slice(&M) * chain.reaction_force();
        let (relative, lift) = relative_motion(&chain);
        let reduced = relative * &whole * lift;
        let s = 37.0;
        let determinant = |matrix: &DMatrix<f64>| {
            let n = matrix.nrows();
            (DMatrix::identity(n, n) * s - matrix).determinant()
        };
        let ratio = determinant(&whole) / (determinant(&reduced) * s * s);
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
    }
}
