//! The fault campaign: everything that can break, at many instants of a motion and at rest, on the firmware
//! as flashed.
//!
//! ```text
//! ELF -> Stage: commission once, run to each instant, keep a snapshot
//!     -> for every fault and instant (workers): restore, inject, run, open the run switch -> Outcome
//!     -> Row per fault (summary) -> table, JSON (report)
//! ```
//!
//! Every run is independent of every other and of the thread it happens on; chance is seeded by fault and
//! instant. What the drive must do: switch off within [`GOAL_PERIODS`] periods of the fault or
//! [`GOAL_TRAVEL`] of travel, whichever is later, for every fault that removes control; never run away;
//! never stay energised once the run switch is open.
//!
//! Not in the list: a failure of the crystal, of which the virtual board has no model (its oscillators are
//! always ready).

pub mod faults;
pub mod flips;
pub mod inject;
pub mod outcome;
pub mod report;
pub mod run;
pub mod stage;
pub mod summary;
pub mod workers;

/// Periods from the fault within which the amplifier is to be off.
pub const GOAL_PERIODS: u32 = 5;
/// Travel of the actuator from the fault within which the amplifier is to be off, if that is later, m.
pub const GOAL_TRAVEL: f64 = 2e-3;
/// Faster than this the machine runs away, m/s.
pub const RUNAWAY_VELOCITY: f64 = 2.0;
/// Farther than this beyond the range of the motion it does so too, m.
pub const RUNAWAY_BEYOND: f64 = 20e-3;
