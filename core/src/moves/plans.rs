//! Planned moves, as plain data that a design fills in.
//!
//! A [`Plan`] takes the chain from rest (or from a steady velocity) to rest (or to another one) and leaves
//! every spring at rest. The model is linear, so a plan that keeps all limits keeps them at every smaller
//! scale, and plans may be added up. There are two kinds:
//!
//! * a *displacement*, scaled by a distance in m: at rest before and after;
//! * a *change of velocity*, scaled by m/s: every mass has the new velocity afterwards. A change and, later,
//!   the opposite one make a move of any length.
//!
//! Everything is relative to where the plan leads (the resting place, or the line of the steady motion), so
//! that what comes after a plan is exactly zero. A row is
//!
//! ```text
//! feed_forward i_k     position x_a,k (two words)     deflection x_i,k - x_a,k of each load     k = 0 … n - 1
//! ```
//!
//! in whole numbers, in units that the plan has. Sixteen bits are enough but for the position: the observers
//! see the motion relative to the reference, and the reference must be as fine as the encoder. What is lost by
//! rounding is corrected by the feedback and adds up to nothing.

use crate::check::{SettingsError, positive};
use serde::{Deserialize, Serialize};

/// Words of a row: current, position and the deflection of each load.
#[must_use]
pub const fn row_words(loads: usize) -> usize {
    3 + loads
}

/// One plan; its units are per m for a displacement and per m/s for a change of velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Where its rows begin.
    pub first: u32,
    /// How many rows it has.
    pub knots: u16,
    /// Largest scale that keeps every limit, m or m/s.
    pub reach: f32,
    /// Unit of the current, A per m.
    pub feed_forward: f32,
    /// Unit of the position, m per m.
    pub position: f32,
    /// Unit of the deflections, m per m.
    pub deflection: f32,
}

/// The plans of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Plans<'p> {
    /// Control periods from one row to the next.
    pub stride: u16,
    /// Displacements, the shortest first, each of which reaches farther than the one before.
    pub displacements: &'p [Plan],
    /// The change of velocity.
    pub change: Plan,
    /// Distance that the actuator covers in it, m per m/s.
    pub run: f32,
    /// By how much a step of the current bends the motion, seen over the rows beside it: `k_f h² / 4 m_a` for a row
    /// of `h` seconds, m/A.
    pub bend: f32,
    /// All rows, word by word.
    #[serde(skip)]
    pub rows: &'p [i16],
    /// CRC-32 (ISO HDLC) of the rows, low byte first, from where they were made: the drive is known by its settings
    /// in serialised form, and has no time at its start to serialise all rows.
    pub checksum: u32,
}

impl Plans<'_> {
    /// Whether these are the same plans, in the same place.
    pub(crate) fn same(&self, copy: &Self) -> bool {
        (self.stride, self.change, self.run, self.bend)
            == (copy.stride, copy.change, copy.run, copy.bend)
            && core::ptr::eq(self.displacements, copy.displacements)
            && core::ptr::eq(self.rows, copy.rows)
    }

    /// Refuses plans that cannot be played.
    ///
    /// * `loads`: number of load masses
    ///
    /// # Errors
    /// [`SettingsError::Plans`], and what must be positive.
    pub fn check(&self, loads: usize) -> Result<(), SettingsError> {
        let rows = self.rows.len() / row_words(loads);
        positive("plans.stride", self.stride.into())?;
        positive("plans.run", self.run)?;
        positive("plans.bend", self.bend)?;
        let mut before = 0.0;
        for plan in self.displacements {
            plan.check(rows)?;
            if plan.reach <= before {
                return Err(SettingsError::Plans);
            }
            before = plan.reach;
        }
        self.change.check(rows)
    }
}

impl Plan {
    fn check(&self, rows: usize) -> Result<(), SettingsError> {
        positive("plans.knots", self.knots.into())?;
        positive("plans.reach", self.reach)?;
        positive("plans.feed_forward", self.feed_forward)?;
        positive("plans.position", self.position)?;
        positive("plans.deflection", self.deflection)?;
        let end = u64::from(self.first) + u64::from(self.knots);
        if end <= rows as u64 {
            Ok(())
        } else {
            Err(SettingsError::Plans)
        }
    }
}
