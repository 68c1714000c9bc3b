//! Pole placement for one input, or by duality one output.
//!
//! With `A X − X Λ = b gᵀ` and `k X = gᵀ` the closed loop `A − b k` has the eigenvectors `X` and the
//! poles `Λ` (Bhattacharyya and de Souza, Systems & Control Letters 1, 1982). For one input the gain is
//! unique and any `g` without zeros gives it; each column of `X` is one solve.

use super::Result;
use super::eigen::eigenvalues;
use crate::error::NoSolution;
use nalgebra::{Complex, DMatrix, DVector};

/// Largest distance of a pole that was asked for from one that the gain gives.
const ACCURACY: f64 = 1e-7;

/// Gain `k` with which `A − b k` has the given poles, n of them, closed under conjugation.
///
/// # Errors
/// [`NoSolution`] when the poles cannot be placed, or not accurately: a pole that `b` cannot move,
/// one that is asked for twice, or one that `A` has already; and
/// where many poles must move far, so that rounding moves them as well.
pub fn place(a: &DMatrix<f64>, b: &DVector<f64>, poles: &[Complex<f64>]) -> Result<DVector<f64>> {
    let n = b.len();
    let failed = || NoSolution("the poles cannot be placed accurately".into());
    let (a_complex, b_complex) = (a.map(Complex::from), b.map(Complex::from));
    let mut vectors = DMatrix::<Complex<f64>>::zeros(n, n);
    let mut weights = DVector::<Complex<f64>>::zeros(n);
    for (j, pole) in poles.iter().enumerate() {
        let shifted = &a_complex - DMatrix::<Complex<f64>>::identity(n, n) * *pole;
        let vector = shifted.lu().solve(&b_complex).ok_or_else(failed)?;
        let size = vector.norm();
        vectors.set_column(j, &(vector / Complex::from(size)));
        weights[j] = Complex::from(1.0 / size);
    }
    let gain = vectors
        .transpose()
        .lu()
        .solve(&weights)
        .ok_or_else(failed)?;
    let gain = gain.map(|value| value.re);
    let found = eigenvalues(&(a - b * gain.transpose()))?;
    let distance = |pole: &Complex<f64>| {
        let distances = found.iter().map(|other| (other - pole).norm());
        distances.fold(f64::INFINITY, f64::min)
    };
    // Written so that what is no number is refused.
    if poles.iter().all(|pole| distance(pole) <= ACCURACY) {
        Ok(gain)
    } else {
        Err(failed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Double integrator, sampled: the gain that puts both poles at p follows from comparing
    /// coefficients, and Ackermann's formula says the same for distinct ones.
    #[test]
    fn double_integrator_in_closed_form() {
        let t = 0.1;
        let a = DMatrix::from_row_slice(2, 2, &[1.0, t, 0.0, 1.0]);
        let b = DVector::from_row_slice(&[t * t / 2.0, t]);
        let (p, q) = (0.5, 0.8);
        let gain = place(&a, &b, &[Complex::from(p), Complex::from(q)]).unwrap();
        // z² + (k_1 t²/2 + k_2 t − 2) z + (k_1 t²/2 − k_2 t + 1)
        let (sum, product) = (p + q, p * q);
        let k_1 = (1.0 - sum + product) / (t * t);
        let k_2 = (3.0 - sum - product) / (2.0 * t);
        assert!((gain[0] - k_1).abs() < 1e-9 * k_1, "{gain}");
        assert!((gain[1] - k_2).abs() < 1e-9 * k_2, "{gain}");
    }

    #[test]
    fn what_cannot_be_moved_is_refused() {
        let a = DMatrix::from_row_slice(2, 2, &[0.9, 0.0, 0.0, 0.5]);
        let b = DVector::from_row_slice(&[0.0, 1.0]);
        assert!(place(&a, &b, &[Complex::from(0.1), Complex::from(0.2)]).is_err());
    }
}
