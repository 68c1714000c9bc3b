//! Quantities as types, so that counts cannot pass for metres nor amperes for newtons.
//!
//! The number inside is in the SI unit named; arithmetic is done on it in the open.

/// Raw reading of the encoder's counter, as the hardware delivers it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts(pub u32);

/// Position, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position(pub f32);

/// Velocity, m/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity(pub f32);

/// Current, A.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Current(pub f32);

/// Force, N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Force(pub f32);
