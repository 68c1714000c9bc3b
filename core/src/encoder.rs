//! Encoder: wrapping counts to position.
//!
//! The counter of the hardware is 2 to 32 bits wide and wraps. Each reading is compared with
//! the one before, modulo the width, and the difference is added to a 64-bit total: wrapping costs
//! nothing, and that total is the [`Place`] of the actuator. Metres are `f32` and always relative to a
//! place near by, so that the drive is as exact a million turns from zero as at zero. The first reading is
//! taken as a signed number, so that a drive started left of the index is at a negative position; what
//! is zero is unknown until the position has been set.

use crate::check::{SettingsError, positive};
use crate::units::{Counts, Place, Position, whole};
use serde::{Deserialize, Serialize};

/// The encoder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Encoder {
    /// Distance per count after x4 decoding, m.
    pub resolution: f32,
    /// Width of the counter, 2 to 32 bits.
    pub counter_bits: u32,
}

/// What has been counted so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Memory {
    last: u32,
    place: Place,
    started: bool,
    set: bool,
}

impl Memory {
    /// Where the actuator was at the last reading.
    pub(crate) const fn place(&self) -> Place {
        self.place
    }

    /// The actuator stands there; zero is known from now on.
    pub(crate) const fn set(&mut self, place: Place) {
        self.place = place;
        self.set = true;
    }

    /// Whether zero is known.
    pub(crate) const fn is_set(&self) -> bool {
        self.set
    }
}

/// What one reading says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Where the actuator is.
    pub place: Place,
    /// Distance since the reading before, m; zero for the first.
    pub displacement: f32,
    /// Whether the counter moved by more than a quarter of its range since the reading before,
    /// so that its direction is no longer certain.
    pub jump: bool,
}

impl Encoder {
    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        positive("encoder.resolution", self.resolution)?;
        if (2..=32).contains(&self.counter_bits) {
            Ok(())
        } else {
            Err(SettingsError::CounterBits)
        }
    }

    /// One reading.
    pub fn step(&self, memory: &mut Memory, count: Counts) -> Reading {
        let difference = if memory.started {
            self.signed(count.0.wrapping_sub(memory.last))
        } else {
            0
        };
        if memory.started {
            memory.place.0 = memory.place.0.wrapping_add(i64::from(difference));
        } else {
            // A position that was set before the first reading is that of this reading.
            if !memory.set {
                memory.place = Place(i64::from(self.signed(count.0)));
            }
            memory.started = true;
        }
        memory.last = count.0;
        Reading {
            place: memory.place,
            displacement: difference as f32 * self.resolution,
            jump: difference.unsigned_abs() > 1_u32.wrapping_shl(self.counter_bits.wrapping_sub(2)),
        }
    }

    /// Distance from one place to another.
    #[must_use]
    pub fn distance(&self, from: Place, to: Place) -> Position {
        Position(whole(to.counts_from(from)) * self.resolution)
    }

    /// Position from zero; `f32`, and so to 1 part in 2²⁴ of that distance.
    #[must_use]
    pub fn position(&self, place: Place) -> Position {
        self.distance(Place(0), place)
    }

    /// The place nearest to a position from zero; what is no number is zero.
    #[must_use]
    pub fn place(&self, position: Position) -> Place {
        // The cast saturates.
        Place(libm::roundf(position.0 / self.resolution) as i64)
    }

    /// The lowest `counter_bits` of a number as two's complement.
    fn signed(self, number: u32) -> i32 {
        let unused = 32_u32.wrapping_sub(self.counter_bits);
        (number.wrapping_shl(unused) as i32).wrapping_shr(unused)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn first_reading_is_signed() {
        for (bits, raw, expected) in [
            (16, 0_u32, 0),
            (16, 2000, 2000),
            (16, 0xFFFF, -1),
            (16, 0x8000, -32768),
            (32, 0xFFFF_FFFE, -2),
        ] {
            let encoder = Encoder {
                resolution: 1.0,
                counter_bits: bits,
            };
            let reading = encoder.step(&mut Memory::default(), Counts(raw));
            assert_eq!(reading.place, Place(expected));
            assert_eq!(reading.displacement, 0.0);
            assert!(!reading.jump);
        }
    }

    #[test]
    fn a_jump_beyond_a_quarter_of_the_range_is_flagged() {
        for (step, jump) in [
            (16384_u32, false),
            (16385, true),
            (49151, true),
            (49152, false),
        ] {
            let encoder = Encoder {
                resolution: 1e-6,
                counter_bits: 16,
            };
            let mut memory = Memory::default();
            encoder.step(&mut memory, Counts(0));
            assert_eq!(encoder.step(&mut memory, Counts(step)).jump, jump, "{step}");
        }
    }

    proptest! {
        /// Any path of steps below half the range is followed exactly, however often it wraps.
        #[test]
        fn wrapping_is_invisible(
            bits in prop::sample::select(&[16_u32, 24, 32]),
            start in -1000_i64..1000,
            steps in prop::collection::vec(-30_000_i64..30_000, 1..200),
        ) {
            let encoder = Encoder { resolution: 1.0, counter_bits: bits };
            let mut memory = Memory::default();
            let modulus = 1_i64 << bits;
            let mut truth = start;
            encoder.step(&mut memory, Counts(truth.rem_euclid(modulus) as u32));
            for step in steps {
                truth += step;
                let reading = encoder.step(&mut memory, Counts(truth.rem_euclid(modulus) as u32));
                prop_assert_eq!(reading.place, Place(truth));
                prop_assert_eq!(reading.displacement, step as f32);
            }
        }

        /// Bits above the counter's width are ignored and nothing overflows.
        #[test]
        fn any_reading_is_taken(bits in 0_u32..40, raw in prop::collection::vec(any::<u32>(), 1..50)) {
            let encoder = Encoder { resolution: 1e-6, counter_bits: bits };
            let mut memory = Memory::default();
            for count in raw {
                let reading = encoder.step(&mut memory, Counts(count));
                prop_assert!(reading.displacement.is_finite());
                prop_assert!(encoder.distance(Place(i64::MIN), reading.place).0.is_finite());
            }
        }
    }
}
