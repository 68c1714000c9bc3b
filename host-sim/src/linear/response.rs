//! The frequency response of a sampled system, at many frequencies.
//!
//! ```text
//! C (z 1 - A)^-1 B = (C Q) (z 1 - H)^-1 (Q' B),   A = Q H Q' with zeros below the first diagonal under H's own
//! ```
//!
//! `Q` is orthogonal and found once; what is left to solve at each `z` takes as many products as `H` has elements.

use nalgebra::{Complex, DMatrix, DVector, Hessenberg};

type C = Complex<f64>;

/// A system of one input, ready to be asked.
#[derive(Clone, Debug)]
pub struct Response {
    /// `H`.
    transition: DMatrix<f64>,
    /// `Q' B`.
    input: DVector<f64>,
    /// `C Q`.
    output: DMatrix<f64>,
}

impl Response {
    /// * `a`, n x n, and `b`, n: the system, `n` at least one
    /// * `outputs`: `C`, a row for each
    #[must_use]
    pub fn new(a: &DMatrix<f64>, b: &DVector<f64>, outputs: &DMatrix<f64>) -> Self {
        let (q, transition) = Hessenberg::new(a.clone()).unpack();
        Self {
            transition,
            input: q.tr_mul(b),
            output: outputs * q,
        }
    }

    /// Each output per input at `z`; none at a pole.
    #[must_use]
    pub fn at(&self, z: C) -> Option<DVector<C>> {
        let n = self.input.len();
        // What is eliminated from goes row by row.
        let mut rows: Vec<C> = Vec::with_capacity(n * n);
        for row in 0..n {
            let elements = self.transition.row(row);
            rows.extend(elements.iter().map(|element| C::from(-element)));
            rows[row * n + row] += z;
        }
        let mut right: Vec<C> = self.input.iter().map(|value| C::from(*value)).collect();
        for column in 0..n.saturating_sub(1) {
            let (above, below) = rows.split_at_mut((column + 1) * n);
            let (above, below) = (&mut above[column * n..], &mut below[..n]);
            if below[column].norm_sqr() > above[column].norm_sqr() {
                above.swap_with_slice(below);
                right.swap(column, column + 1);
            }
            if above[column] == C::ZERO {
                return None;
            }
            let factor = below[column] / above[column];
            for (below, above) in below[column + 1..].iter_mut().zip(&above[column + 1..]) {
                *below -= factor * above;
            }
            let eliminated = factor * right[column];
            right[column + 1] -= eliminated;
        }
        for row in (0..n).rev() {
            let elements = &rows[row * n..(row + 1) * n];
            if elements[row] == C::ZERO {
                return None;
            }
            let known = elements[row + 1..].iter().zip(&right[row + 1..]);
            let known: C = known.map(|(element, value)| element * value).sum();
            right[row] = (right[row] - known) / elements[row];
        }
        let outputs = self.output.row_iter().map(|row| {
            let products = row.iter().zip(&right);
            products.map(|(c, value)| value * *c).sum()
        });
        Some(DVector::from_iterator(self.output.nrows(), outputs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// What is found solves the equation it is to solve.
        #[test]
        fn the_response_is_that_of_the_system(
            elements in proptest::collection::vec(-1.0..1.0_f64, 7 * 8),
            angle in 0.01..3.1_f64,
        ) {
            let a = DMatrix::from_column_slice(7, 7, &elements[..49]);
            let b = DVector::from_column_slice(&elements[49..]);
            // Outside of where its poles can be.
            let z = C::from_polar(8.0, angle);
            let state = Response::new(&a, &b, &DMatrix::identity(7, 7)).at(z).unwrap();
            let missed = &state * z - a.map(C::from) * &state - b.map(C::from);
            prop_assert!(missed.norm() < 1e-12 * b.norm().max(1e-3), "{missed}");
        }
    }

    /// `1 / (z - a)`, and none where that has no end.
    #[test]
    fn a_pole_has_no_response() {
        let one = DVector::from_element(1, 1.0);
        let pole = DMatrix::from_element(1, 1, 0.5);
        let response = Response::new(&pole, &one, &DMatrix::identity(1, 1));
        assert_eq!(response.at(C::new(2.5, 0.0)).unwrap()[0], C::from(0.5));
        assert!(response.at(C::from(0.5)).is_none());
        // Two that integrate one another: both are at one.
        let double = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 1.0]);
        let response = Response::new(
            &double,
            &DVector::from_column_slice(&[0.5, 1.0]),
            &DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
        );
        assert!(response.at(C::from(1.0)).is_none());
        // (z + 1) / 2 (z - 1)^2
        assert!((response.at(C::from(3.0)).unwrap()[0] - 0.5).norm() < 1e-15);
    }
}
