//! Discrete algebraic Riccati equation by structure-preserving doubling.
//!
//! `X = Aᵀ X A − (Aᵀ X B + N)(R + Bᵀ X B)⁻¹(Bᵀ X A + Nᵀ) + Q`, single input. The doubling
//! algorithm (Chu, Fan, Lin, Wang, Int. J. Control 77, 2004) converges quadratically and keeps
//! its iterates symmetric and positive; it needs linear solves only, and poles next to the unit
//! circle (lightly damped chains) merely cost a few more doublings.

use crate::error::{Error, Result};
use nalgebra::{DMatrix, DVector, RowDVector};

/// The stabilising solution and the feedback that goes with it.
#[derive(Clone, Debug)]
pub struct Solution {
    /// `X`.
    pub x: DMatrix<f64>,
    /// `K = (R + Bᵀ X B)⁻¹ (Bᵀ X A + Nᵀ)`.
    pub gain: RowDVector<f64>,
    /// Largest entry of the equation's residual relative to the largest of `X`.
    pub residual: f64,
}

/// Solves the equation for `n` states and one input.
///
/// * `a`: n x n, `b`: n x 1, `q`: n x n symmetric, `n`: n x 1 cross weight, `r` > 0
///
/// # Errors
/// [`Error::Design`] when the iteration does not converge to a finite solution.
pub fn solve(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    q: &DMatrix<f64>,
    n: &DVector<f64>,
    r: f64,
) -> Result<Solution> {
    let failed = |what: &str| Error::Design(format!("a Riccati equation has no solution: {what}"));
    let size = a.nrows();
    let identity = DMatrix::<f64>::identity(size, size);

    // Completing the square removes the cross weight.
    let mut a_k = a - b * n.transpose() / r;
    let mut g = b * b.transpose() / r;
    let mut h = q - n * n.transpose() / r;
    let mut converged = false;
    for _ in 0..100 {
        let w = (&identity + &g * &h).lu();
        let step = w.solve(&a_k).ok_or_else(|| failed("a step is singular"))?;
        let w_g = w.solve(&g).ok_or_else(|| failed("a step is singular"))?;
        let grown = a_k.transpose() * &h * &step;
        g = &g + &a_k * w_g * a_k.transpose();
        g = (&g + g.transpose()) * 0.5;
        a_k = &a_k * &step;
        let change = grown.amax();
        h += grown;
        h = (&h + h.transpose()) * 0.5;
        if !h.amax().is_finite() || !g.amax().is_finite() {
            return Err(failed("it cannot be stabilised"));
        }
        if change <= 1e-15 * h.amax() {
            converged = true;
            break;
        }
    }
    if !converged {
        return Err(failed("the iteration does not converge"));
    }

    let weight = r + (b.transpose() * &h * b).x;
    let gain = (b.transpose() * &h * a + n.transpose()) / weight;
    let back = a.transpose() * &h * a - gain.transpose() * &gain * weight + q;
    let residual = (back - &h).amax() / h.amax();
    Ok(Solution {
        x: h,
        gain,
        residual,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scalar equation: x = a²x − (a x b + n)²/(r + b²x) + q is a quadratic in x.
    #[test]
    fn scalar_equation_in_closed_form() {
        for (a, b, q, n, r) in [
            (1.2, 0.5, 2.0, 0.3, 0.7),
            (0.9, 2.0, 0.1, 0.0, 5.0),
            (1.0, 0.01, 1.0, 0.0, 1.0),
        ] {
            let one = |x: f64| DMatrix::from_element(1, 1, x);
            let vector = |x: f64| DVector::from_element(1, x);
            let solution = solve(&one(a), &vector(b), &one(q), &vector(n), r).unwrap();
            // b² x² + (r − a² r + 2 a b n − b² q) x + n² − q r = 0, the positive root
            let (p2, p1, p0) = (
                b * b,
                r - a * a * r + 2.0 * a * b * n - b * b * q,
                n * n - q * r,
            );
            let x = (-p1 + (p1 * p1 - 4.0 * p2 * p0).sqrt()) / (2.0 * p2);
            assert!((solution.x[(0, 0)] / x - 1.0_f64).abs() < 1e-12);
            assert!(solution.residual < 1e-13);
            let gain = (b * x * a + n) / (r + b * b * x);
            assert!((solution.gain[0] / gain - 1.0_f64).abs() < 1e-12);
        }
    }

    #[test]
    fn an_unreachable_unstable_state_is_an_error() {
        let a = DMatrix::from_row_slice(2, 2, &[1.1, 0.0, 0.0, 0.5]);
        let b = DVector::from_row_slice(&[0.0, 1.0]);
        let q = DMatrix::identity(2, 2);
        assert!(solve(&a, &b, &q, &DVector::zeros(2), 1.0).is_err());
    }
}
