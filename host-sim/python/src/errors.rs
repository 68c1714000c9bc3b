//! host-sim's errors as Python's exceptions, with the same sentence.

use host_sim::error::Error;
use pyo3::exceptions::{
    PyFileNotFoundError, PyIsADirectoryError, PyOSError, PyPermissionError, PyRuntimeError,
    PyTypeError, PyValueError,
};
use pyo3::prelude::*;
use std::borrow::Borrow;
use std::io::ErrorKind;

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
    let sentence = without_line(error.to_string());
    match error {
        Error::Read { source, .. } => match source.kind() {
            ErrorKind::NotFound => PyFileNotFoundError::new_err(sentence),
            ErrorKind::PermissionDenied => PyPermissionError::new_err(sentence),
            ErrorKind::IsADirectory => PyIsADirectoryError::new_err(sentence),
            _ => PyOSError::new_err(sentence),
        },
        error if error.exit_code() == 2 => PyValueError::new_err(sentence),
        _ => PyRuntimeError::new_err(sentence),
    }
}

/// Nobody sees the text that a dictionary is turned into: its lines say nothing.
fn without_line(sentence: String) -> String {
    let line = sentence.strip_prefix("dictionary:");
    let rest = line.map(|line| line.trim_start_matches(|c: char| c.is_ascii_digit()));
    match rest.filter(|rest| rest.starts_with(": ")) {
        Some(rest) => format!("dictionary{rest}"),
        None => sentence,
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

/// An argument that is something else than it may be.
pub(crate) fn no_such(argument: &Bound<'_, PyAny>, name: &str, allowed: &str) -> PyErr {
    let found = argument.get_type().name();
    let found = found.map_or_else(|_| "something else".into(), |name| name.to_string());
    PyTypeError::new_err(format!("`{name}`: must be {allowed}, not {found}"))
}
