//! Excitation: a current profile played in open loop, so that the machine can be identified.
//!
//! In closed loop the current follows the motion and what the machine does by itself is hidden
//! behind what the controller makes of it; here the current is known beforehand and the encoder
//! shows the machine's answer alone. One period of the profile is held in steps of the current
//! output and is played a number of times:
//!
//! ```text
//! play 1          play 2          ...   play n          amplifier off
//! profile[0..N]   profile[0..N]         profile[0..N]
//! ```
//!
//! No loop is closed, so no sign needs to be proven. What keeps the machine safe is its travel: an
//! actuator that gets farther from where it began than it is allowed to is a fault, and so is one that
//! does not seem to move at all, because then its travel is not known. The amplifier is then off and
//! nothing brakes: the machine coasts on.

use crate::fault::Fault;
use crate::units::{Current, Position};

/// What is played; written by the design program or built in memory.
///
/// Any value can be played: an empty profile or no repetition ends at once, a number that is not
/// finite is a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Excitation {
    /// One period of the current, in steps of `unit`; each is held over one control period.
    pub profile: &'static [i16],
    /// What one step is, A.
    pub unit: f32,
    /// How often the profile is played.
    pub repetitions: u16,
    /// Farthest the actuator may get from where it began, m.
    pub travel: f32,
}

/// How far it has come.
#[derive(Clone, Copy, Debug, Default)]
pub struct Memory {
    /// Next entry of the profile.
    next: usize,
    /// Repetitions that are done.
    done: u16,
    /// Where the actuator began.
    origin: Option<f32>,
    /// Where it has been in this half of the profile.
    lowest: f32,
    highest: f32,
}

impl Excitation {
    /// One period at a measured position: the current to apply, before any limit, or nothing when
    /// all has been played.
    ///
    /// * `least_motion`: what the actuator must move by in each half of the profile, m
    ///
    /// # Errors
    /// [`Fault::Travel`] beyond the travel allowed, [`Fault::NoMotion`] at the end of half a profile in
    /// which nothing moved, [`Fault::NonFinite`] where `unit` or `travel` is no number.
    pub fn step(
        &self,
        memory: &mut Memory,
        position: Position,
        least_motion: f32,
    ) -> Result<Option<Current>, Fault> {
        if !(self.unit.is_finite() && self.travel.is_finite()) {
            return Err(Fault::NonFinite);
        }
        let first = memory.origin.is_none();
        let origin = *memory.origin.get_or_insert(position.0);
        // What cannot be compared is not within the travel either.
        let within = (position.0 - origin).abs() <= self.travel;
        if !within {
            return Err(Fault::Travel);
        }
        if !first {
            memory.lowest = memory.lowest.min(position.0);
            memory.highest = memory.highest.max(position.0);
        }
        if memory.next == 0 || memory.next == self.profile.len() / 2 {
            if !first && memory.highest - memory.lowest < least_motion {
                return Err(Fault::NoMotion);
            }
            (memory.lowest, memory.highest) = (position.0, position.0);
        }
        if memory.done >= self.repetitions {
            return Ok(None);
        }
        let Some(steps) = self.profile.get(memory.next) else {
            return Ok(None);
        };
        memory.next += 1;
        if memory.next >= self.profile.len() {
            memory.next = 0;
            memory.done += 1;
        }
        Ok(Some(Current(f32::from(*steps) * self.unit)))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    const EXCITATION: Excitation = Excitation {
        profile: &[3, -1, -2],
        unit: 0.5,
        repetitions: 2,
        travel: 0.01,
    };

    fn play(excitation: Excitation, position: impl Fn(usize) -> f32) -> (Vec<f32>, Option<Fault>) {
        let (mut memory, mut played) = (Memory::default(), Vec::new());
        for k in 0..100 {
            match excitation.step(&mut memory, Position(position(k)), 0.0) {
                Ok(Some(current)) => played.push(current.0),
                Ok(None) => {
                    // The end is the end.
                    let after = excitation.step(&mut memory, Position(position(k)), 0.0);
                    assert_eq!(after, Ok(None));
                    return (played, None);
                }
                Err(fault) => return (played, Some(fault)),
            }
        }
        panic!("no end");
    }

    #[test]
    fn the_profile_is_played_as_often_as_asked() {
        let once = [1.5, -0.5, -1.0];
        assert_eq!(play(EXCITATION, |_| 0.3), ([once, once].concat(), None));
    }

    #[test]
    fn nothing_to_play_ends_at_once() {
        for excitation in [
            Excitation::default(),
            Excitation {
                profile: &[],
                ..EXCITATION
            },
            Excitation {
                repetitions: 0,
                ..EXCITATION
            },
        ] {
            assert_eq!(play(excitation, |_| 0.0), (vec![], None));
        }
    }

    /// Measured from where it began, in either direction, up to the last period.
    #[test]
    fn the_travel_is_a_limit() {
        for direction in [1.0, -1.0] {
            let moved = |k: usize| 0.5 + direction * 0.004 * k as f32;
            let (played, fault) = play(EXCITATION, moved);
            assert_eq!((played.len(), fault), (3, Some(Fault::Travel)));
        }
        let last = |k: usize| if k < 6 { 0.0 } else { 0.02 };
        assert_eq!(play(EXCITATION, last).1, Some(Fault::Travel));
        let negative = Excitation {
            travel: -1.0,
            ..EXCITATION
        };
        assert_eq!(play(negative, |_| 0.0), (vec![], Some(Fault::Travel)));
        let nan = play(EXCITATION, |k| if k == 2 { f32::NAN } else { 0.0 });
        assert_eq!((nan.0.len(), nan.1), (2, Some(Fault::Travel)));
    }

    /// An encoder that shows nothing, from the beginning or from some period on: found at the end of
    /// that half of the profile, or of the next.
    #[test]
    fn a_dead_encoder_is_a_fault() {
        let excitation = Excitation {
            profile: &[1; 20],
            ..EXCITATION
        };
        for (dies, found) in [(0, 10), (3, 20), (13, 30), (100, 40)] {
            let (mut memory, mut k) = (Memory::default(), 0_usize);
            let end = loop {
                let position = 1e-4 * k.min(dies) as f32;
                match excitation.step(&mut memory, Position(position), 1.5e-4) {
                    Ok(Some(_)) => k += 1,
                    end => break end,
                }
            };
            let expected = if dies == 100 {
                Ok(None)
            } else {
                Err(Fault::NoMotion)
            };
            assert_eq!((k, end), (found, expected), "{dies}");
        }
    }

    #[test]
    fn what_is_no_number_is_a_fault() {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for excitation in [
                Excitation {
                    unit: value,
                    ..EXCITATION
                },
                Excitation {
                    travel: value,
                    ..EXCITATION
                },
            ] {
                let end = play(excitation, |_| 0.0);
                assert_eq!(end, (vec![], Some(Fault::NonFinite)));
            }
        }
    }

    proptest! {
        /// Whatever is to be played: it ends after so many periods, and not before.
        #[test]
        fn the_length_is_profile_times_repetitions(
            profile in prop::collection::vec(any::<i16>(), 0..20),
            repetitions in 0_u16..20,
        ) {
            let length = profile.len() * usize::from(repetitions);
            let expected: Vec<f32> = profile.iter().map(|steps| f32::from(*steps)).collect();
            let excitation = Excitation {
                profile: Vec::leak(profile),
                unit: 1.0,
                repetitions,
                travel: 1.0,
            };
            let mut memory = Memory::default();
            for k in 0..length {
                let current = excitation.step(&mut memory, Position(0.0), 0.0).unwrap();
                prop_assert_eq!(current, Some(Current(expected[k % expected.len()])));
            }
            prop_assert_eq!(excitation.step(&mut memory, Position(0.0), 0.0), Ok(None));
        }
    }
}
