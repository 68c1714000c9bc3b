//! What the user gets: tables for people, JSON for machines, CSV of every step, plots.

pub mod csv;
pub mod horizon;
pub mod identification;
pub mod log;
pub mod plot;
pub mod table;
