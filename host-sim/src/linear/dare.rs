//! Discrete algebraic Riccati equation by structure-preserving doubling.
//!
//! `X = Aᵀ X A − (Aᵀ X B + N)(R + Bᵀ X B)⁻¹(Bᵀ X A + Nᵀ) + Q`, single input. The doubling
//! algorithm (Chu, Fan, Lin, Wang, Int. J. Control 77, 2004) converges quadratically and keeps
//! its iterates symmetric and positive; it needs linear solves only, and poles next to the unit
//! circle (lightly damped chains) merely cost a few more doublings.

use super::Result;
use crate::error::NoSolution;
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

/// The triple `(A, G, H)` that doubling iterates: what an interval of time does to a quadratic
/// cost-to-go. With `P` at its end, at its beginning the cost is that of `H + Aᵀ P (I + G P)⁻¹ A`. `G` and
/// `H` are symmetric and not negative.
#[derive(Clone, Debug)]
pub struct DoublingTriple {
    /// `A`.
    pub a: DMatrix<f64>,
    /// `G`.
    pub g: DMatrix<f64>,
    /// `H`.
    pub h: DMatrix<f64>,
}

impl DoublingTriple {
    /// Twice the time, and what it adds to `H`; none when a linear solve fails.
    #[must_use]
    pub fn doubled(&self) -> Option<(Self, DMatrix<f64>)> {
        let Self { a, g, h } = self;
        let w = (DMatrix::identity(a.nrows(), a.nrows()) + g * h).lu();
        let step = w.solve(a)?;
        let grown = symmetric(&(a.transpose() * h * &step));
        let twice = Self {
            a: a * &step,
            g: symmetric(&(g + a * w.solve(g)? * a.transpose())),
            h: h + &grown,
        };
        Some((twice, grown))
    }

    /// Cost-to-go at the beginning from that at the end; none when a linear solve fails.
    #[must_use]
    pub fn before(&self, end: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let Self { a, g, h } = self;
        let w = (DMatrix::identity(a.nrows(), a.nrows()) + g * end).lu();
        Some(symmetric(&(h + a.transpose() * end * w.solve(a)?)))
    }
}

fn symmetric(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    (matrix + matrix.transpose()) * 0.5
}

/// Solves the equation for `n` states and one input.
///
/// * `a`: n x n, `b`: n x 1, `q`: n x n symmetric, `n`: n x 1 cross weight, `r` > 0
///
/// # Errors
/// [`NoSolution`] when the iteration does not converge to a finite solution.
pub fn solve(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    q: &DMatrix<f64>,
    n: &DVector<f64>,
    r: f64,
) -> Result<Solution> {
    let failed = |what: &str| NoSolution(format!("a Riccati equation has no solution: {what}"));
    // Completing the square removes the cross weight.
    let mut triple = DoublingTriple {
        a: a - b * n.transpose() / r,
        g: b * b.transpose() / r,
        h: q - n * n.transpose() / r,
    };
    let mut converged = false;
    for _ in 0..100 {
        let (twice, grown) = triple
            .doubled()
            .ok_or_else(|| failed("a step is singular"))?;
        triple = twice;
        if !triple.h.amax().is_finite() || !triple.g.amax().is_finite() {
            return Err(failed("it cannot be stabilised"));
        }
        if grown.amax() <= 1e-15 * triple.h.amax() {
            converged = true;
            break;
        }
    }
    if !converged {
        return Err(failed("the iteration does not converge"));
    }

    let h = triple.h;
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
