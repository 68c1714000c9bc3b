//! Rows `A x + s = b` of a cone programme, being written: what the solver takes as a sparse matrix.

use clarabel::algebra::CscMatrix;

/// The rows so far.
#[derive(Default)]
pub(super) struct Rows {
    row: Vec<usize>,
    column: Vec<usize>,
    value: Vec<f64>,
    right: Vec<f64>,
}

impl Rows {
    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.right.len()
    }

    /// One more row.
    ///
    /// * `entries`: column and value; `right`: `b`
    pub(super) fn add(&mut self, entries: impl IntoIterator<Item = (usize, f64)>, right: f64) {
        let row = self.right.len();
        for (column, value) in entries {
            if value != 0.0 {
                self.row.push(row);
                self.column.push(column);
                self.value.push(value);
            }
        }
        self.right.push(right);
    }

    /// Two rows: `|entries| <= bound`.
    pub(super) fn within(&mut self, entries: &[(usize, f64)], bound: f64) {
        for sign in [1.0, -1.0] {
            let entries = entries.iter();
            self.add(
                entries.map(|(column, value)| (*column, sign * value)),
                bound,
            );
        }
    }

    /// `A` and `b`.
    pub(super) fn into_matrix(self, unknowns: usize) -> (CscMatrix<f64>, Vec<f64>) {
        let (rows, right) = (self.right.len(), self.right);
        let a = CscMatrix::new_from_triplets(rows, unknowns, self.row, self.column, self.value);
        (a, right)
    }
}
