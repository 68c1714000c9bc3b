//! From continuous to sampled, exactly: zero-order hold, and the integral of a quadratic cost over a
//! period (Van Loan).

use nalgebra::{DMatrix, DVector};

/// `F = e^{A T}` and `G = ∫ e^{A s} ds B` for an input held over `period`.
#[must_use]
pub fn zero_order_hold(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    period: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let n = a.nrows();
    let mut augmented = DMatrix::zeros(n + 1, n + 1);
    augmented.view_mut((0, 0), (n, n)).copy_from(a);
    augmented.view_mut((0, n), (n, 1)).copy_from(b);
    let e = (augmented * period).exp();
    (
        e.view((0, 0), (n, n)).into_owned(),
        e.view((0, n), (n, 1)).column(0).into_owned(),
    )
}

/// `∫₀ᵀ e^{Aᵀ s} Q e^{A s} ds` for a symmetric `Q`.
///
/// Van Loan's exponential (IEEE Trans. Automatic Control 23, 1978) grows as fast as `A` decays and then
/// loses all figures, so it is taken over a part of the period in which little grows; with `F` over
/// that part, the integral over twice the part is `W + Fᵀ W F`.
#[must_use]
pub fn cost_integral(a: &DMatrix<f64>, q: &DMatrix<f64>, period: f64) -> DMatrix<f64> {
    let n = a.nrows();
    let sums = a.row_iter().map(|row| row.lp_norm(1));
    let doublings = (sums.fold(0.0, f64::max) * period).log2().ceil().max(0.0) as i32;
    let mut block = DMatrix::zeros(2 * n, 2 * n);
    block.view_mut((0, 0), (n, n)).copy_from(&-a.transpose());
    block.view_mut((0, n), (n, n)).copy_from(q);
    block.view_mut((n, n), (n, n)).copy_from(a);
    let e = (block * (period / 2_f64.powi(doublings))).exp();
    let mut transition = e.view((n, n), (n, n)).into_owned();
    let mut integral = transition.transpose() * e.view((0, n), (n, n));
    for _ in 0..doublings {
        integral += transition.transpose() * &integral * &transition;
        transition = &transition * &transition;
    }
    (&integral + integral.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Double integrator: F, G and the integral of a weighted state, all polynomials of T.
    #[test]
    fn double_integrator_in_closed_form() {
        let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
        let b = DVector::from_row_slice(&[0.0, 2.0]);
        let t = 0.3_f64;
        let (f, g) = zero_order_hold(&a, &b, t);
        assert!((f - DMatrix::from_row_slice(2, 2, &[1.0, t, 0.0, 1.0])).amax() < 1e-14);
        assert!((g - DVector::from_row_slice(&[t * t, 2.0 * t])).amax() < 1e-14);
        let q = DMatrix::from_row_slice(2, 2, &[5.0, 0.0, 0.0, 7.0]);
        let expected = DMatrix::from_row_slice(
            2,
            2,
            &[
                5.0 * t,
                2.5 * t * t,
                2.5 * t * t,
                5.0 * t.powi(3) / 3.0 + 7.0 * t,
            ],
        );
        assert!((cost_integral(&a, &q, t) - expected).amax() < 1e-13);
    }

    /// What decays a thousand times within the period: `q (1 − e^{−2 λ T}) / (2 λ)`.
    #[test]
    fn fast_decay_in_closed_form() {
        for decay in [1e-3, 1.0, 1e3, 1e6] {
            let a = DMatrix::from_row_slice(1, 1, &[-decay]);
            let q = DMatrix::from_row_slice(1, 1, &[3.0]);
            let expected = 3.0 * -f64::exp_m1(-2.0 * decay) / (2.0 * decay);
            let found = cost_integral(&a, &q, 1.0)[(0, 0)];
            assert!((found / expected - 1.0).abs() < 1e-13, "{decay}: {found}");
        }
    }
}
