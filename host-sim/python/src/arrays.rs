//! Matrices, poles and series as numpy arrays; what is serialised for JSON as dictionaries.

use nalgebra::{Complex, DMatrix};
use numpy::{Complex64, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use serde_json::Value;

/// A matrix, `(rows, columns)`.
pub(crate) fn matrix<'py>(py: Python<'py>, matrix: &DMatrix<f64>) -> Bound<'py, PyArray2<f64>> {
    table(
        py,
        (matrix.nrows(), matrix.ncols()),
        matrix.transpose().as_slice(),
    )
}

/// Numbers that stand row by row.
pub(crate) fn table<'py>(
    py: Python<'py>,
    shape: (usize, usize),
    rows: &[f64],
) -> Bound<'py, PyArray2<f64>> {
    let array = PyArray1::from_slice(py, rows);
    array
        .reshape([shape.0, shape.1])
        .unwrap_or_else(|_| PyArray2::zeros(py, [0, 0], false))
}

/// Poles, `(n,)`, complex.
pub(crate) fn poles<'py>(
    py: Python<'py>,
    poles: &[Complex<f64>],
) -> Bound<'py, PyArray1<Complex64>> {
    PyArray1::from_iter(
        py,
        poles.iter().map(|pole| Complex64::new(pole.re, pole.im)),
    )
}

/// What host-sim serialises, as dictionaries, lists, numbers and strings.
pub(crate) fn object<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(pythonize::pythonize(py, value)?)
}
