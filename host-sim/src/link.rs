//! The host's end of the serial link: what is asked of a drive that is connected, and what it answers.
//!
//! ```text
//! name --port--> bytes --line--> frames --connection--> answers, telemetry
//!                                            |
//!                                            +--motion--> a machine that moves, waited for
//!                                            +--last_moves--> the moves in the drive's memory
//!                                            +--settings----> what it runs with
//! ```
//!
//! Messages and frames are the drive's own ([`arso_core::link`]). A question is repeated until it is answered,
//! and carried out once, whatever gets lost on the way. Lengths are metres, or radians, here, and whole counts
//! on the line.

mod connection;
mod last_moves;
mod line;
mod motion;
mod port;
mod settings;

pub use connection::{Connection, passed};
pub use motion::{Arrival, GoOn, LARGEST, fault_words, mode_name, require_possible};
pub use port::{BAUD, Port};
pub use settings::Pushed;
