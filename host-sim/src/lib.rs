//! Design and simulation of a motor drive for a flexible load with no sensor on it.
//!
//! ```text
//! drive.toml --drive--> machine, chain --design--> gains --corridor--> the control core (f32)
//!                         |                                      |  current, count
//!                         +------------------> plant <--simulate--+
//!                                                     |
//!                                  metrics -> report (table, JSON, CSV, SVG)
//! ```
//!
//! The crate is a house of floors; a module imports from the floors below it, never upwards:
//!
//! | floor | what it is |
//! |---|---|
//! | [`cli`] | the command line: parses, and words flags |
//! | [`report`] | everything that is shown: tables, JSON, CSV, plots |
//! | [`link`] | a drive that is connected: what is asked of it, and what it answers |
//! | [`sweep`] | many plants and drives, drawn or on a grid, under many laws |
//! | [`excite`], [`identify`], [`compare`], [`capture`] | what is done with a drive, each by itself |
//! | [`simulate`] | the closed loop: plant, the control core ([`simulate::corridor`]), scenarios, metrics |
//! | [`design`] | from a drive to gains, and what is to be said of them |
//! | [`drive`] | the description of a drive, read and checked; knows no design |
//! | [`machine`] | what a machine is made of, and how it moves |
//! | [`chain`] | the paper's chain: eqs. (8) to (12), (14) to (16); knows no file |
//! | [`linear`] | matrices by the names of the textbooks; knows no drive |
//! | [`error`], [`output`] | the ground: sentences, files, numbers |
//!
//! The program `host-sim` is a thin command line over this library; the tests use it too.
#![forbid(unsafe_code)]

pub mod capture;
pub mod chain;
pub mod cli;
pub mod compare;
pub mod design;
pub mod drive;
pub mod error;
pub mod excite;
pub mod identify;
pub mod linear;
pub mod link;
pub mod machine;
pub mod output;
pub mod report;
pub mod simulate;
pub mod sweep;
