//! Control core of a motor drive that positions a flexible load with no sensor on it.
//!
//! One control step is one straight corridor; a value passes each room once:
//!
//! ```text
//! encoder count -> position -> disturbance and reaction-force observer -> state observer
//!               -> regulator -> limiter -> current command
//! target -> reference of every state + feed-forward current --^
//! ```
//!
//! | Module | What it is for | Equation of the paper |
//! |---|---|---|
//! | [`encoder`] | wrapping counts to metres | |
//! | [`disturbance`] | disturbance observer, reaction-force observer | (19), (18) |
//! | [`observer`] | action-reaction state observer and its variants | (17) |
//! | [`regulator`] | constant-gain state feedback | (13) |
//! | [`reference`](mod@reference) | steps and jerk-limited moves | |
//! | [`limits`] | limiting of the command | |
//! | [`supervisor`] | states and faults of the drive | |
//! | [`commissioning`] | a small motion that proves the signs | |
//! | [`excitation`] | a current played in open loop, for identification | |
//! | [`controller`] | the corridor: [`Controller::step`] | |
//! | [`gains`] | plain data that a design fills in | |
//! | [`telemetry`] | one record per step | |
//! | [`indicator`] | vibration level for people, not for control | |
//!
//! `N` is the number of load masses, `S` the number of states of the observer. Everything is
//! `f32`, nothing is allocated, and a step always takes the same path of bounded length.
//! Quantities cross the boundary as types of their own ([`units`]). SI units throughout; for a
//! rotary drive read kg m² for kg, rad for m and N m for N.
//!
//! ```
//! use arso_core::{Command, Controller, Counts, Current, Gains, GainsError, Measurement};
//! use arso_core::Request;
//!
//! /// First command of a new drive: it waits for rest before it proves its signs.
//! fn first_command(gains: &Gains<3, 9>) -> Result<Command, GainsError> {
//!     let mut controller = Controller::new(gains)?;
//!     controller.request(Request::Commission);
//!     // When it is ready: Request::Start, then Request::Step(Position(0.03)).
//!     Ok(controller.step(Measurement { count: Counts(0), current: Current(0.0) }))
//! }
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub mod commissioning;
pub mod controller;
pub mod disturbance;
pub mod encoder;
pub mod excitation;
pub mod gains;
pub mod indicator;
pub mod limits;
pub mod observer;
pub mod reference;
pub mod regulator;
pub mod supervisor;
pub mod telemetry;
pub mod units;

pub use controller::{Command, Controller, Measurement, Request};
pub use excitation::Excitation;
pub use gains::{Gains, GainsError};
pub use indicator::Vibration;
pub use supervisor::{Fault, State};
pub use telemetry::Telemetry;
pub use units::{Counts, Current, Force, Position, Velocity};
