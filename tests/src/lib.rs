//! Independent truth for the tests of the drive.
#![forbid(unsafe_code)]

pub mod drives;
pub mod reference;
