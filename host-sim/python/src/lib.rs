//! The Python package `arso`: host-sim's drives, designs and simulations as Python objects and numpy arrays.
//!
//! ```text
//! TOML --description--> Drive, Plant --design--> Design --simulate--> Run
//!                                              +--compare, learn, bound, sweep--> dictionaries
//! ```
//!
//! A thin layer: it takes arguments apart, releases the interpreter while host-sim computes, and hands results
//! out, matrices and time series as arrays (`arrays`), all else as host-sim serialises it for JSON. Errors are
//! host-sim's sentences (`errors`). What needs python-control is written in Python (`arso/systems.py`).

// Docstrings are Python's, in the style of numpydoc; what can fail says so in them.
#![allow(
    clippy::missing_errors_doc,
    clippy::doc_markdown,
    clippy::doc_link_with_quotes
)]
// A drive's `drive` is host-sim's description of it.
#![allow(clippy::struct_field_names)]

mod arrays;
mod compare;
mod description;
mod design;
mod errors;
mod learn;
mod simulate;
mod sweep;

/// Bindings of host-sim; use the package `arso`.
#[pyo3::pymodule]
mod _arso {
    #[pymodule_export]
    use super::compare::{bound, compare};
    #[pymodule_export]
    use super::description::{Drive, Plant};
    #[pymodule_export]
    use super::design::{Design, design};
    #[pymodule_export]
    use super::errors::DriveFault;
    #[pymodule_export]
    use super::learn::{Learned, learn};
    #[pymodule_export]
    use super::simulate::{Run, simulate};
    #[pymodule_export]
    use super::sweep::{merge_sweep, read_sweep, sweep};
}
