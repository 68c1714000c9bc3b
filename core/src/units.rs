//! Quantities as types, so that counts cannot pass for metres nor amperes for newtons.
//!
//! The number inside is in the SI unit named; arithmetic is done on it in the open. It is an `f32`
//! unless the analysis on the PC says otherwise.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Raw reading of the encoder's counter, as the hardware delivers it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts(pub u32);

/// Position of the actuator in whole counts from zero: exact, however far away that is.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Schema,
)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Place(pub i64);

impl Place {
    /// Counts from another place to this one; what is half of all places away wraps.
    #[must_use]
    pub const fn counts_from(self, other: Self) -> i64 {
        self.0.wrapping_sub(other.0)
    }
}

/// A whole number of counts; the processor converts 32 bits by itself, and these are mostly within them.
#[inline]
pub(crate) fn whole(counts: i64) -> f32 {
    i32::try_from(counts).map_or_else(|_| far(counts), |near| near as f32)
}

#[cold]
#[inline(never)]
fn far(counts: i64) -> f32 {
    counts as f32
}

/// Position relative to a [`Place`] that is said where it stands, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Position(pub f32);

/// Velocity, m/s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Velocity<T = f32>(pub T);

/// Current, A.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Current<T = f32>(pub T);

/// Force, N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Force<T = f32>(pub T);

/// The part of the axis that the actuator may use, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Travel {
    /// Its lower end.
    pub lowest: Place,
    /// Its upper end.
    pub highest: Place,
}

impl Travel {
    /// Whether a place is in it.
    #[must_use]
    pub fn contains(&self, place: Place) -> bool {
        (self.lowest..=self.highest).contains(&place)
    }
}
