//! Eigenvalues of a square matrix, and what is read from them.

use super::Result;
use crate::error::NoSolution;
use nalgebra::{Complex, DMatrix};

/// Eigenvalues of a square matrix.
///
/// # Errors
/// [`NoSolution`] when the iteration does not converge.
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>> {
    // Metres and newtons in one matrix are decades apart; the iteration wants rows like columns.
    let mut balanced = matrix.clone();
    nalgebra::linalg::balancing::balance_parlett_reinsch(&mut balanced);
    let n = matrix.nrows();
    // Entries count as zero against their neighbours on the diagonal: as sharply as rounding allows, or
    // else less so, or else, for eigenvalues of zero with too few eigenvectors (pure delays), with all
    // eigenvalues moved away from zero. The transpose has the same, and its iteration takes another way.
    let size = balanced.amax();
    let attempts = [(0.0, 1.0), (0.0, 16.0), (size, 16.0), (size, 256.0)];
    let ways = [balanced.clone(), balanced.transpose()];
    let each = ways
        .iter()
        .flat_map(|way| attempts.map(|attempt| (way, attempt)));
    let schur = each.into_iter().find_map(|(way, (shift, roundings))| {
        let moved = way + DMatrix::identity(n, n) * shift;
        let schur = nalgebra::Schur::try_new(moved, roundings * f64::EPSILON, 1000)?;
        Some((schur, shift))
    });
    let (schur, shift) =
        schur.ok_or_else(|| NoSolution("an eigenvalue iteration did not converge".into()))?;
    // Read off the blocks on the diagonal here: the crate's own reading takes the root of a negative
    // number where rounding makes a real pair of what stands in one block.
    let (_, t) = schur.unpack();
    let mut eigenvalues = Vec::with_capacity(n);
    let mut i = 0;
    while i < n {
        if i + 1 == n || t[(i + 1, i)] == 0.0 {
            eigenvalues.push(Complex::from(t[(i, i)]));
            i += 1;
            continue;
        }
        let mean = 0.5 * (t[(i, i)] + t[(i + 1, i + 1)]);
        let half = 0.5 * (t[(i, i)] - t[(i + 1, i + 1)]);
        let root = Complex::from(half * half + t[(i, i + 1)] * t[(i + 1, i)]).sqrt();
        eigenvalues.extend([root + mean, -root + mean]);
        i += 2;
    }
    for value in &mut eigenvalues {
        *value -= shift;
    }
    if eigenvalues.iter().all(|value| value.is_finite()) {
        Ok(eigenvalues)
    } else {
        Err(NoSolution("an eigenvalue is not finite".into()))
    }
}

/// Smallest distance between two of the eigenvalues, relative to the largest of them.
#[must_use]
pub fn separation(eigenvalues: &[Complex<f64>]) -> f64 {
    let largest = eigenvalues
        .iter()
        .map(|pole| pole.norm())
        .fold(0.0, f64::max);
    let pairs = eigenvalues.iter().enumerate();
    let distances = pairs.flat_map(|(i, a)| eigenvalues[..i].iter().map(move |b| (a - b).norm()));
    distances.fold(f64::INFINITY, f64::min) / largest
}

/// Largest magnitude of the eigenvalues.
///
/// # Errors
/// As [`eigenvalues`].
pub fn spectral_radius(matrix: &DMatrix<f64>) -> Result<f64> {
    let poles = eigenvalues(matrix)?;
    Ok(poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A double pole: rounding may make a real pair in one block of it, which must not become a root of
    /// something negative. Two lags of the same rate in a row, at many rates.
    #[test]
    fn double_eigenvalues_are_found() {
        for k in 1..2000 {
            let rate = f64::from(k) * 0.037;
            #[rustfmt::skip]
            let lags = DMatrix::from_row_slice(3, 3, &[
                -rate, 0.0, rate,
                rate, -rate, 0.0,
                0.0, 0.0, 0.0,
            ]);
            for value in eigenvalues(&lags).unwrap() {
                let distance = value.norm().min((value + rate).norm());
                assert!(distance < 1e-6 * rate, "{rate}: {value}");
            }
        }
    }
}
