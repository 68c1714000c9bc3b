//! The drive's program, without a processor.
//!
//! ```text
//! control interrupt, every control period, nothing can delay it:
//!     read encoder -> Controller::step -> current output -> record into a queue
//! idle loop, in what time is left:
//!     switches or link -> requests into a queue; records and outcomes out of their queues -> defmt, link
//! ```
//!
//! The two share nothing but lock-free queues ([`drive`]). What a board must be able to do is in
//! [`board`]; a board is a folder there and a binary in `bin/`, which owns interrupts and priorities.
//! What happens between encoder and current is `arso_core::Controller`, the same that the simulation
//! runs.
#![cfg(target_os = "none")]
#![no_std]
#![forbid(unsafe_code)]

pub mod board;
pub mod drive;
mod excitation;
mod gains;
mod identity;
mod keeping;
mod log;
pub mod settings;
mod switches;
