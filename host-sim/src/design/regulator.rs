//! Optimal constant gain, eqs. (2) to (13), for a sampled drive.
//!
//! The continuous index (2), `∫ xᵀ Q x + R i² dt`, under a current held over each period is a
//! discrete index with a cross term between state and current (Van Loan); its Riccati equation
//! gives the constant gain `K` that (14) tends to as the final time grows. The input is the
//! current, so `K` is in A/m and A s/m.

use super::{discretise, riccati};
use crate::drive::Cost;
use crate::error::Result;
use crate::model::Chain;
use nalgebra::{DMatrix, DVector, RowDVector};

/// Feedback gain `K`, order `x_a v_a x_1 v_1 …`, and the relative residual of its Riccati equation.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when the Riccati equation has no solution.
pub fn regulator(chain: &Chain, cost: &Cost, sample_time: f64) -> Result<(RowDVector<f64>, f64)> {
    let states = chain.states();
    // The current as a further state that does not change: its weight and the cross term fall
    // out of one integral.
    let mut a = DMatrix::zeros(states + 1, states + 1);
    a.view_mut((0, 0), (states, states)).copy_from(&chain.a());
    a.view_mut((0, states), (states, 1)).copy_from(&chain.b());
    let mut weights = cost.state_weights();
    weights.push(cost.current);
    let weights = DMatrix::from_diagonal(&DVector::from_vec(weights));
    let integral = discretise::cost_integral(&a, &weights, sample_time);

    let (f, g) = discretise::zero_order_hold(&chain.a(), &chain.b(), sample_time);
    let q = integral.view((0, 0), (states, states)).into_owned();
    let n = integral
        .view((0, states), (states, 1))
        .column(0)
        .into_owned();
    let r = integral[(states, states)];
    let solution = riccati::solve(&f, &g, &q, &n, r)?;
    Ok((solution.gain, solution.residual))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    /// THEORY: the default drive's gain, and the rigid-mode identity of the continuous case,
    /// (sum of position gains)² = (sum of weights) / R, which sampling approaches as the period
    /// shrinks: 1.85 A/m short at 1 ms, in proportion to it.
    #[test]
    fn gain_of_the_default_drive() {
        let drive = Drive::default_drive();
        let chain = Chain::new(&drive.actuator, &drive.loads, 0.0);
        let (gain, residual) = regulator(&chain, &drive.cost, 1e-3).unwrap();
        assert!(residual < 1e-12, "{residual:e}");
        // As printed there, to half of the last figure.
        let expected = [
            (59.0, 0.5),
            (1.1, 0.05),
            (-27.0, 0.5),
            (0.06, 0.005),
            (-6.9, 0.05),
            (0.16, 0.005),
            (2.2, 0.05),
            (0.21, 0.005),
        ];
        for (value, (expected, tolerance)) in gain.iter().zip(expected) {
            assert!((value - expected).abs() <= tolerance, "{value} {expected}");
        }
        let (fine, _) = regulator(&chain, &drive.cost, 1e-6).unwrap();
        let sum: f64 = fine.iter().step_by(2).sum();
        assert!((sum - 30.0).abs() < 2.5e-3, "{sum}");
    }
}
