//! What is broken around the board: each part of the rig that data passes through consults its fault here.
//!
//! ```text
//! control timer -> interrupt_line -> processor -> converter -> amplifier -> plant
//! log buffer -> log_host                 ^                                    |
//!                                        +---- decoder <---- encoder_line <---+
//! ```
//!
//! Nothing is broken by default, and a rig with nothing broken computes to the last bit what it would
//! compute without this module. Chance is seeded when a fault begins.

pub mod amplifier;
pub mod encoder_line;
pub mod interrupt_line;
pub mod log_host;

pub use amplifier::{Amplifier, AmplifierFault, Scale};
pub use encoder_line::{EncoderFault, EncoderLine};
pub use interrupt_line::{InterruptFault, InterruptLine};
pub use log_host::LogHost;
