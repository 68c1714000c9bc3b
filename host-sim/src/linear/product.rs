//! Products of small matrices whose size is known where it counts: a simulation spends its time here, and a
//! loop of known length is several times faster.

use nalgebra::{DMatrix, DVector, RowDVector, SMatrixView, SVectorView};

/// `y = A x + s b` for a square `A`, the product first.
///
/// # Panics
/// When the sizes differ.
pub fn product_and(
    a: &DMatrix<f64>,
    x: &DVector<f64>,
    (s, b): (f64, &DVector<f64>),
    y: &mut DVector<f64>,
) {
    match a.nrows() {
        2 => fixed::<2>(a, x, (s, b), y),
        4 => fixed::<4>(a, x, (s, b), y),
        5 => fixed::<5>(a, x, (s, b), y),
        6 => fixed::<6>(a, x, (s, b), y),
        7 => fixed::<7>(a, x, (s, b), y),
        8 => fixed::<8>(a, x, (s, b), y),
        9 => fixed::<9>(a, x, (s, b), y),
        10 => fixed::<10>(a, x, (s, b), y),
        11 => fixed::<11>(a, x, (s, b), y),
        12 => fixed::<12>(a, x, (s, b), y),
        13 => fixed::<13>(a, x, (s, b), y),
        14 => fixed::<14>(a, x, (s, b), y),
        _ => {
            y.gemv(1.0, a, x, 0.0);
            add(s, b, y);
        }
    }
}

fn fixed<const N: usize>(
    a: &DMatrix<f64>,
    x: &DVector<f64>,
    (s, b): (f64, &DVector<f64>),
    y: &mut DVector<f64>,
) {
    let a = SMatrixView::<f64, N, N>::from_slice(a.as_slice());
    let x = SVectorView::<f64, N>::from_slice(x.as_slice());
    let b = SVectorView::<f64, N>::from_slice(b.as_slice());
    let mut sum = [0.0; N];
    for column in 0..N {
        for row in 0..N {
            sum[row] += a[(row, column)] * x[column];
        }
    }
    for row in 0..N {
        sum[row] += s * b[row];
    }
    y.as_mut_slice().copy_from_slice(&sum);
}

/// `c · x`, term after term.
#[must_use]
pub fn dot(c: &RowDVector<f64>, x: impl Iterator<Item = f64>) -> f64 {
    c.iter().zip(x).map(|(c, x)| c * x).sum()
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

    /// Of every size that a chain has, with a disturbance and without, and of another: as the library has it.
    #[test]
    fn every_size_is_the_librarys_product() {
        for n in 1..=15 {
            let a = DMatrix::from_fn(n, n, |i, j| (1.0 + i as f64).sin() * (2.0 + j as f64).cos());
            let x = DVector::from_fn(n, |i, _| (0.3 * i as f64).cos());
            let b = DVector::from_fn(n, |i, _| 1.0 / (1.0 + i as f64));
            let mut y = DVector::from_element(n, 5.0);
            product_and(&a, &x, (-0.7, &b), &mut y);
            assert!((&y - (&a * &x - 0.7 * &b)).amax() < 1e-14);
            add(0.5, &x, &mut y);
            assert!((y - (&a * &x - 0.7 * &b + 0.5 * &x)).amax() < 1e-14);
            let row = b.transpose();
            assert!((dot(&row, x.iter().copied()) - (row * x).x).abs() < 1e-14);
        }
    }
}
