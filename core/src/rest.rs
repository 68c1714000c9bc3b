//! Whether the actuator is at rest, judged by what its encoder can tell apart and by its noise.
//!
//! It is at rest when it has stayed near one place for a while. How near, is a number of *grains* and five
//! times the noise of the encoder. A grain is a count or, where the encoder is finer than any motion that
//! matters, a thousandth of the distance by which the motor's largest force moves the bare actuator within
//! the period after it has acted for one: `F T² / 1000 m_a`. The noise is measured where the machine stands:
//! half the mean square of the differences between readings, which slow motion hardly adds to.

use crate::actuator::Actuator;
use crate::encoder::{Encoder, Reading};
use crate::limits::Limits;
use crate::units::Place;

/// Grains within which the encoder stands still.
const STILL: f32 = 2.5;
/// Grains within which it stays when the loop may be closed: what is slower is caught by the loop.
pub(crate) const SLOW: f32 = 50.0;
/// How long it must stand still, s.
const REST_TIME: f32 = 0.05;
/// Share of the motor's largest acceleration that makes a grain.
const GRAIN: f32 = 1e-3;
/// How many standard deviations the noise may be off.
const SIGMAS: f32 = 5.0;
/// Share of the last reading in the mean square.
const NEWEST: f32 = 1.0 / 32.0;

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rest {
    sample_time: f32,
    encoder: Encoder,
    /// Grains per m.
    per_metre: f32,
}

/// Where it was last seen to move, and for how many periods it has not.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory {
    anchor: Place,
    still: u32,
    /// Mean square of the differences between readings, grains².
    differences: f32,
}

impl Memory {
    /// It has been shown to be at rest there.
    pub(crate) fn proven(place: Place) -> Self {
        Self {
            anchor: place,
            still: u32::MAX,
            differences: 0.0,
        }
    }

    /// What cannot be the encoder's noise, as far as that is known, grains.
    pub(crate) fn beyond_noise(&self) -> f32 {
        SIGMAS * libm::sqrtf(0.5 * self.differences)
    }

    /// It is there, and all else that is known of it is its noise.
    pub(crate) fn moved_to(self, place: Place) -> Self {
        Self {
            anchor: place,
            still: 0,
            ..self
        }
    }
}

impl Rest {
    /// * `sample_time`: s
    pub(crate) fn new(
        encoder: &Encoder,
        actuator: &Actuator,
        limits: &Limits,
        sample_time: f32,
    ) -> Self {
        let acceleration =
            actuator.actual_force_constant() * limits.current_limit / actuator.actual_mass();
        let grain = (GRAIN * acceleration * sample_time * sample_time).max(encoder.resolution);
        Self {
            sample_time,
            encoder: *encoder,
            per_metre: 1.0 / grain,
        }
    }

    /// Distance from one place to another, in grains.
    pub(crate) fn grains(&self, from: Place, to: Place) -> f32 {
        self.encoder.distance(from, to).0 * self.per_metre
    }

    /// What so many grains are, m.
    /// Whether an actuator that moves at that velocity, m/s, is told from one that rests, with as much to spare.
    pub(crate) fn tells(&self, velocity: f32) -> bool {
        velocity * REST_TIME > 2.0 * self.metres(STILL)
    }

    pub(crate) fn metres(&self, grains: f32) -> f32 {
        grains / self.per_metre
    }

    /// One period: whether the actuator is at rest.
    pub(crate) fn step(&self, memory: &mut Memory, reading: &Reading) -> bool {
        self.within(memory, reading, STILL)
    }

    /// One period: whether the actuator is slow enough for the loop to be closed.
    pub(crate) fn may_start(&self, memory: &mut Memory, reading: &Reading) -> bool {
        self.within(memory, reading, SLOW)
    }

    /// The same for an actuator that moves by as many grains where it stands.
    pub(crate) fn within(&self, memory: &mut Memory, reading: &Reading, grains: f32) -> bool {
        let difference = reading.displacement * self.per_metre;
        memory.differences += NEWEST * (difference * difference - memory.differences);
        let beyond = self.grains(memory.anchor, reading.place).abs() - grains;
        let noise = 0.5 * memory.differences;
        // No noise makes a moving machine one at rest.
        let near = beyond <= 0.0
            || (beyond * beyond <= SIGMAS * SIGMAS * noise && beyond <= SLOW - grains);
        if near {
            memory.still = memory.still.saturating_add(1);
        } else {
            *memory = memory.moved_to(reading.place);
        }
        self.rested(memory)
    }

    /// Whether it was at rest in the last period.
    pub(crate) fn rested(&self, memory: &Memory) -> bool {
        memory.still as f32 * self.sample_time >= REST_TIME
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const T: f32 = 1e-3;

    fn rest(resolution: f32) -> Rest {
        let encoder = Encoder {
            resolution,
            counter_bits: 32,
        };
        let actuator = Actuator {
            mass: 0.059,
            force_constant: 6.43,
            mass_deviation: 0.0,
            force_constant_deviation: 0.0,
        };
        let limits = Limits {
            current_limit: 2.0,
            current_resolution: 1e-3,
        };
        Rest::new(&encoder, &actuator, &limits, T)
    }

    /// Whether an actuator that is at those counts, one after the other, is found to be at rest.
    fn rests(rest: &Rest, resolution: f32, counts: impl Iterator<Item = i64>) -> bool {
        let mut memory = Memory::default();
        let mut before = None;
        counts.into_iter().any(|count| {
            let reading = Reading {
                place: Place(count),
                displacement: (count - before.unwrap_or(count)) as f32 * resolution,
                jump: false,
            };
            before = Some(count);
            rest.step(&mut memory, &reading)
        })
    }

    /// A grain of the default drive: 0.218 µm, less than its count.
    #[test]
    fn a_grain_is_a_count_or_a_motion_that_matters() {
        let grain = 1e-3 * 6.43 * 2.0 / 0.059 * T * T;
        assert!((rest(1e-6).metres(1.0) / 1e-6 - 1.0).abs() < 1e-5);
        assert!((rest(1e-9).metres(1.0) / grain - 1.0).abs() < 1e-5);
        assert!((rest(1e-9).grains(Place(0), Place(1000)) - 1e-6 / grain).abs() < 1e-3);
    }

    proptest! {
        /// Gaussian noise (twelve uniform numbers) of up to 5 counts rms is rest, wherever that is.
        #[test]
        fn noise_is_rest(
            sigma in 0.0_f32..5.0,
            at in -(1_i64 << 40)..1 << 40,
            numbers in prop::collection::vec(prop::collection::vec(0.0_f32..1.0, 12), 2000),
        ) {
            let counts = numbers.iter().map(|twelve| {
                at + libm::roundf(sigma * (twelve.iter().sum::<f32>() - 6.0)) as i64
            });
            prop_assert!(rests(&rest(1e-6), 1e-6, counts));
        }

        /// What moves is not: at a steady velocity of 0.1 grains a period or more, or swinging so that it
        /// moves by 20 grains where it turns round, in the time for which rest is watched. What swings more
        /// slowly is at rest there.
        #[test]
        fn motion_is_none(
            velocity in 0.1_f64..1000.0,
            amplitude in 20.0_f64..1e4,
            hertz in 2.0_f64..40.0,
            resolution in prop::sample::select(&[1e-6_f32, 1e-9]),
        ) {
            let half = (core::f64::consts::PI * hertz * f64::from(REST_TIME)).min(core::f64::consts::PI);
            prop_assume!(amplitude * (1.0 - libm::cos(half)) >= 20.0);
            let rest = rest(resolution);
            let grain = f64::from(rest.metres(1.0) / resolution);
            let steady = (0..2000).map(|k| (f64::from(k) * velocity * grain) as i64);
            prop_assert!(!rests(&rest, resolution, steady));
            let swinging = (0..2000).map(|k| {
                let angle = core::f64::consts::TAU * hertz * f64::from(k) * 1e-3;
                (amplitude * grain * libm::sin(angle)) as i64
            });
            prop_assert!(!rests(&rest, resolution, swinging));
        }
    }
}
