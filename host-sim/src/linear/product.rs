//! Products of small matrices whose size is known where it counts: a simulation spends its time here, and a
//! loop of known length is several times faster.

use nalgebra::{DMatrix, DVector, SMatrixView, SVector, SVectorView};

/// `y = A x` for a square `A`.
///
/// # Panics
/// When the sizes differ.
pub fn product(a: &DMatrix<f64>, x: &DVector<f64>, y: &mut DVector<f64>) {
    match a.nrows() {
        2 => fixed::<2>(a, x, y),
        4 => fixed::<4>(a, x, y),
        6 => fixed::<6>(a, x, y),
        8 => fixed::<8>(a, x, y),
        10 => fixed::<10>(a, x, y),
        12 => fixed::<12>(a, x, y),
        14 => fixed::<14>(a, x, y),
        _ => y.gemv(1.0, a, x, 0.0),
    }
}

fn fixed<const N: usize>(a: &DMatrix<f64>, x: &DVector<f64>, y: &mut DVector<f64>) {
    let a = SMatrixView::<f64, N, N>::from_slice(a.as_slice());
    let x = SVectorView::<f64, N>::from_slice(x.as_slice());
    let mut sum = SVector::<f64, N>::zeros();
    for column in 0..N {
        for row in 0..N {
            sum[row] += a[(row, column)] * x[column];
        }
    }
    y.fixed_rows_mut::<N>(0).copy_from(&sum);
}

/// `y += s x`.
///
/// # Panics
/// When the sizes differ.
pub fn add(s: f64, x: &DVector<f64>, y: &mut DVector<f64>) {
    for (y, x) in y.as_mut_slice().iter_mut().zip(x.as_slice()) {
        *y += s * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of every size that a chain has, and of another: as the library has it.
    #[test]
    fn every_size_is_the_librarys_product() {
        for n in [1, 2, 3, 4, 6, 8, 10, 12, 14] {
            let a = DMatrix::from_fn(n, n, |i, j| (1.0 + i as f64).sin() * (2.0 + j as f64).cos());
            let x = DVector::from_fn(n, |i, _| (0.3 * i as f64).cos());
            let mut y = DVector::from_element(n, 5.0);
            product(&a, &x, &mut y);
            assert!((&y - &a * &x).amax() < 1e-14);
            add(0.5, &x, &mut y);
            assert!((y - (&a * &x + 0.5 * &x)).amax() < 1e-14);
        }
    }
}
