//! From continuous to sampled, exactly (Van Loan, IEEE Trans. Automatic Control 23, 1978).

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
#[must_use]
pub fn cost_integral(a: &DMatrix<f64>, q: &DMatrix<f64>, period: f64) -> DMatrix<f64> {
    let n = a.nrows();
    let mut block = DMatrix::zeros(2 * n, 2 * n);
    block.view_mut((0, 0), (n, n)).copy_from(&-a.transpose());
    block.view_mut((0, n), (n, n)).copy_from(q);
    block.view_mut((n, n), (n, n)).copy_from(a);
    let e = (block * period).exp();
    let integral = e.view((n, n), (n, n)).transpose() * e.view((0, n), (n, n));
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
}
