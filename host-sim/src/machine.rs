//! What a machine is made of, as data, and how it moves.
//!
//! ```text
//! actuator, encoder, loads, friction, forces --chain_of--> Chain --motion--> state over time
//! ```
//!
//! The description of a drive, the simulated plant and the identification all speak of these parts.
//! Doc comments name the units of a linear machine; [`Kind::units`] has those of a rotary one.

mod actuator;
pub mod encoder;
mod force;
mod friction;
mod kind;
mod load;
pub mod motion;

pub use actuator::Actuator;
pub use encoder::Encoder;
pub use force::ExternalForce;
pub use friction::Friction;
pub use kind::{Kind, Units};
pub use load::{Load, chain_of};
pub use motion::Motion;
