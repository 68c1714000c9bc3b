//! Nothing but dependencies: see `Cargo.toml`.
//!
//! Cargo compiles a crate once for each set of features that it is asked for with, and everything above it as well.
//! Builds, tests (whose own dependencies ask for more) and the Python package (which maturin builds alone) would so
//! make host-sim three times. With the features here asked for everywhere they share one.
#![forbid(unsafe_code)]
