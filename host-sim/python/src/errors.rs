//! host-sim's errors as Python's exceptions, with the same sentence.

use host_sim::error::Error;
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::borrow::Borrow;

pyo3::create_exception!(
    arso,
    DriveFault,
    PyRuntimeError,
    "The drive stopped itself in a run; the attribute ``run`` has the :class:`Run` up to its end."
);

/// What the caller can correct is a `ValueError`, a file that cannot be read an `OSError`, a failed run a
/// `RuntimeError`.
pub(crate) fn raised(error: impl Borrow<Error>) -> PyErr {
    let error = error.borrow();
    let sentence = error.to_string();
    match error {
        // With the number of the system, from which Python makes FileNotFoundError and its like.
        Error::Read { path, source } => match source.raw_os_error() {
            Some(number) => PyOSError::new_err((number, source.to_string(), path.clone())),
            None => PyOSError::new_err(sentence),
        },
        error if error.exit_code() == 2 => PyValueError::new_err(sentence),
        _ => PyRuntimeError::new_err(sentence),
    }
}

/// A parameter whose value cannot be used.
pub(crate) fn unusable(
    parameter: &'static str,
    value: impl std::fmt::Display,
    rule: impl Into<String>,
) -> PyErr {
    raised(Error::parameter(parameter, value, rule))
}
