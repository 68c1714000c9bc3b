//! Linear quadratic regulator for an input that is held over each period.
//!
//! The continuous index `∫ xᵀ Q x + R u² dt` under a held input is a discrete index with a cross term
//! between state and input (Van Loan); its Riccati equation gives the constant gain.

use super::{Result, dare, zoh};
use nalgebra::{DMatrix, DVector, RowDVector};

/// The gain, and how well it solves its Riccati equation.
#[derive(Clone, Debug)]
pub struct Regulator {
    /// `K` of `u = −K x`.
    pub gain: RowDVector<f64>,
    /// Residual of the Riccati equation, relative to its solution.
    pub residual: f64,
}

/// The regulator of `dx/dt = A x + B u` that makes the continuous index least, `u` held over `period`.
///
/// * `q`: diagonal of `Q`, `r` > 0
///
/// # Errors
/// [`NoSolution`](crate::error::NoSolution) when the Riccati equation has none.
pub fn dlqr(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    q: &[f64],
    r: f64,
    period: f64,
) -> Result<Regulator> {
    let states = b.len();
    // The input as a further state that does not change: its weight and the cross term fall out of one
    // integral.
    let mut augmented = DMatrix::zeros(states + 1, states + 1);
    augmented.view_mut((0, 0), (states, states)).copy_from(a);
    augmented.view_mut((0, states), (states, 1)).copy_from(b);
    let weights = q.iter().copied().chain([r]);
    let weights = DMatrix::from_diagonal(&DVector::from_iterator(states + 1, weights));
    let integral = zoh::cost_integral(&augmented, &weights, period);

    let (f, g) = zoh::zero_order_hold(a, b, period);
    let q = integral.view((0, 0), (states, states)).into_owned();
    let n = integral
        .view((0, states), (states, 1))
        .column(0)
        .into_owned();
    let r = integral[(states, states)];
    let solution = dare::solve(&f, &g, &q, &n, r)?;
    Ok(Regulator {
        gain: solution.gain,
        residual: solution.residual,
    })
}
