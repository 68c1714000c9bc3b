//! What a machine is made of, as data, and how it moves.
//!
//! ```text
//! actuator, encoder, loads, friction, forces --Mechanics--> chain and friction --motion--> state over time
//! ```
//!
//! The description of a drive, the simulated plant and the identification all speak of these parts.
//! Doc comments name the units of a linear machine; [`Kind::units`] has those of a rotary one.

mod actuator;
pub mod encoder;
mod force;
mod friction;
mod imperfections;
mod kind;
mod late;
mod load;
mod mechanics;
pub mod motion;

pub use actuator::Actuator;
pub use encoder::Encoder;
pub use force::ExternalForce;
pub use friction::{DryFriction, Friction};
pub use imperfections::{Imperfections, Wave};
pub use kind::{Kind, Units};
pub use load::{Load, chain_of};
pub use mechanics::Mechanics;
pub use motion::Motion;
