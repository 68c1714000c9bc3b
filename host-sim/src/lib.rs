//! Design and simulation of a motor drive for a flexible load with no sensor on it.
//!
//! ```text
//! drive.toml --drive--> model --design--> gains --corridor--> the control core (f32)
//!                         |                                      |  current, count
//!                         +-----------------> plant <--simulate--+
//!                                                     |
//!                                  metrics -> report (table, JSON, CSV, SVG)
//! ```
//!
//! The program `host-sim` is a thin command line over this library; the tests use it too.
#![forbid(unsafe_code)]

pub mod capture;
pub mod cli;
pub mod compare;
pub mod corridor;
pub mod design;
pub mod drive;
pub mod error;
pub mod excite;
pub mod identify;
pub mod metrics;
pub mod model;
pub mod output;
pub mod plant;
pub mod report;
pub mod scenario;
pub mod simulate;
