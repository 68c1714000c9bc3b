//! Control core of a motor drive that positions a flexible load with no sensor on it.
//!
//! One control period is one straight corridor; a value passes each part once:
//!
//! ```text
//! encoder count -> position -> disturbance and reaction-force observer -> state observer
//!               -> regulator -> limiter -> current command
//! target -> reference of every mass + feed-forward current --^
//! ```
//!
//! | Module | What it is for | Equation of the paper |
//! |---|---|---|
//! | [`encoder`] | wrapping counts to metres | |
//! | [`disturbance`], [`reaction_force`] | the force observers | (19), (18) |
//! | [`observer`] | action-reaction state observer and its variants | (17) |
//! | [`regulator`] | constant-gain state feedback | (13) |
//! | [`moves`] | planned moves: references of every mass and the currents for them | |
//! | [`friction`], [`standstill`] | friction feed-forward; the rule for rest | |
//! | [`limits`] | limiting of the command | |
//! | [`controller`] | the corridor: [`Controller::step`] | |
//! | [`mode`], [`request`] | what the drive does; what is asked of it, and its answers | |
//! | [`link`] | the same on a wire | |
//! | [`fault`], [`protection`] | the faults, and what watches for them | |
//! | `direction_check` | a small motion that proves the signs | |
//! | `homing` | the drive finds its zero | |
//! | [`excitation`] | a current played in open loop, for identification | |
//! | [`settings`] | all that the core knows of a drive, plain data | |
//! | [`telemetry`] | one record per period | |
//! | [`record`] | the last moves, kept in memory | |
//! | [`indicator`] | vibration level for people, not for control | |
//! | [`filter`] | the filters that the force observers are made of | |
//! | [`theory`] | every equation as implemented, and where it departs from the print | (2) to (19) |
//!
//! A part is plain data with its coefficients, and `step` takes it over one period; what it remembers
//! from one period to the next is its `Memory`, kept by the mode that uses it. `N` is the number of load
//! masses, `S` the number of states of the observer. Everything is `f32`, nothing is allocated, and a
//! period always takes the same path of bounded length. Quantities cross the boundary as types of their
//! own ([`units`]). SI units throughout; for a rotary drive read kg m² for kg, rad for m and N m for N.
//!
//! ```
//! use arso_core::moves::plans::Plans;
//! use arso_core::observer::Anchored;
//! use arso_core::{Command, Controller, Counts, Current, Measurement, Refusal, Request, Settings};
//!
//! /// First command of a new drive: it waits for rest before it proves its signs.
//! fn first_command(
//!     settings: &Settings<3, Anchored<3, 9>>,
//!     plans: Plans<'_>,
//! ) -> Result<Command, Refusal> {
//!     let Ok(mut controller) = Controller::new(settings, plans) else {
//!         return Ok(Command::default());
//!     };
//!     controller.request(Request::Commission)?;
//!     // When it is ready: Request::Start, then Request::Move(Place(30_000)).
//!     Ok(controller.step(Measurement { count: Counts(0), current: Current(0.0), home: false }))
//! }
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub mod actuator;
pub mod amplifier;
mod check;
pub mod controller;
mod direction_check;
pub mod disturbance;
pub mod encoder;
pub mod excitation;
pub mod fault;
pub mod filter;
pub mod friction;
mod homing;
pub mod indicator;
pub mod limits;
pub mod link;
pub mod mode;
pub mod moves;
pub mod observer;
pub mod protection;
pub mod reaction_force;
pub mod record;
pub mod regulator;
pub mod request;
mod rest;
pub mod settings;
pub mod standstill;
pub mod telemetry;
#[doc = include_str!("theory.md")]
pub mod theory {}
pub mod units;

pub use check::SettingsError;
pub use controller::{Command, Controller, Measurement};
pub use excitation::Excitation;
pub use fault::Fault;
pub use indicator::Vibration;
pub use mode::Mode;
pub use request::{Homing, Refusal, Request};
pub use settings::Settings;
pub use telemetry::{Identity, Telemetry};
pub use units::{Counts, Current, Force, Place, Position, Velocity};
