//! What the user gets: tables for people, JSON for machines, CSV of every step, plots.
//!
//! Every figure arrives here computed; a file for each thing that is reported (`design`, `experiments`,
//! `comparison`, `moves`, `bound`, `excitation`, `identification`, `learning`, `log`, `mcap`, `record`, `link`,
//! `paper`, `horizon`, `sweep`, `tune`), `csv` for a run, `plot` for drawing.

pub mod bound;
mod columns;
pub mod comparison;
pub mod csv;
pub mod design;
pub mod excitation;
pub mod experiments;
pub mod horizon;
pub mod identification;
pub mod learning;
mod lines;
pub mod link;
pub mod log;
pub mod mcap;
pub mod moves;
pub mod paper;
pub mod plot;
pub mod record;
pub mod run;
mod settled;
pub mod sweep;
mod table;
pub mod tune;

/// A time for a CSV file: in whole nanoseconds, because 0.1 + 0.2 has no place in a time column.
#[must_use]
pub fn time(seconds: f64) -> f64 {
    (seconds * 1e9).round() / 1e9
}
