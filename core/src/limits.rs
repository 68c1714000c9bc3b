//! Limiting of the command to what the amplifier takes.
//!
//! The command is clamped to the current limit and rounded to the step of the current output,
//! and what comes out here is what is applied: the observers are fed with it in the next period,
//! so saturation does not wind anything up. Their innovation itself is never clamped.

use crate::check::{SettingsError, not_negative, positive};
use crate::units::Current;
use serde::{Deserialize, Serialize};

/// What the current output can do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Largest magnitude of the current, A.
    pub current_limit: f32,
    /// Step of the current output, A; zero for a continuous one.
    pub current_resolution: f32,
}

/// A command that can be applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limited {
    /// The current to apply.
    pub current: Current,
    /// Whether the limit acted.
    pub limited: bool,
}

impl Limits {
    /// What limits a command, with its quotients ready.
    #[must_use]
    pub fn limiter(&self) -> Limiter {
        let (limit, resolution) = (self.current_limit, self.current_resolution);
        // A few rounding errors wide, so that a limit of 2 A is 2000 steps of 1 mA.
        let steps = libm::floorf(limit / resolution * (1.0 + 4.0 * f32::EPSILON));
        // More steps than `f32` can tell apart are none, and so is what is no number.
        let stepped = resolution > 0.0 && steps < MOST_STEPS;
        Limiter {
            limit,
            resolution,
            steps_per_ampere: if stepped { 1.0 / resolution } else { 0.0 },
            steps: if stepped { steps as i32 } else { 0 },
            // Their product may be a rounding beyond the limit.
            largest: (steps * resolution).min(limit),
        }
    }

    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        positive("limits.current_limit", self.current_limit)?;
        not_negative("limits.current_resolution", self.current_resolution)
    }
}

/// Steps of the output that `f32` can count.
const MOST_STEPS: f32 = 8_388_608.0;

/// Limits the commands of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limiter {
    limit: f32,
    resolution: f32,
    /// Zero for a continuous output.
    steps_per_ampere: f32,
    /// Whole steps within the limit, and what they are together, A.
    steps: i32,
    largest: f32,
}

impl Limiter {
    /// The same with another limit, A.
    pub(crate) fn with_limit(&self, current_limit: f32) -> Self {
        let limits = Limits {
            current_limit,
            current_resolution: self.resolution,
        };
        limits.limiter()
    }

    /// Largest current, A.
    pub(crate) fn limit(&self) -> f32 {
        self.limit
    }

    /// Clamps and rounds, halves away from zero; the result never exceeds the limit. `None`
    /// when the command is not finite, or the limits are none.
    #[inline]
    #[must_use]
    pub fn step(&self, command: Current) -> Option<Limited> {
        let Current(command) = command;
        if !command.is_finite() {
            return None;
        }
        let steps = command * self.steps_per_ampere;
        // The conversion cuts towards zero, and ends at the largest number there is.
        let steps = (steps + f32::copysign(0.5, steps)) as i32;
        let current = if self.steps_per_ampere == 0.0 {
            clamped(command, self.limit)
        } else if steps >= self.steps {
            self.largest
        } else if steps <= self.steps.wrapping_neg() {
            -self.largest
        } else {
            steps as f32 * self.resolution
        };
        // What cannot be compared is not within the limit.
        (current.abs() <= self.limit).then_some(Limited {
            current: Current(current),
            limited: command.abs() > self.limit,
        })
    }
}

/// A value within ± a bound; `f32::clamp` panics where the bound is negative or no number.
pub(crate) fn clamped(value: f32, bound: f32) -> f32 {
    if value > bound {
        bound
    } else if value < -bound {
        -bound
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: Limits = Limits {
        current_limit: 2.0,
        current_resolution: 1e-3,
    };

    #[test]
    fn rounds_half_away_from_zero_and_keeps_the_limit() {
        let limits = Limits {
            current_limit: 2.0,
            current_resolution: 0.25,
        };
        for (command, current, limited) in [
            (0.1, 0.0, false),
            (0.125, 0.25, false),
            (-0.125, -0.25, false),
            (1.99, 2.0, false),
            (2.3, 2.0, true),
            (-9.0, -2.0, true),
        ] {
            let result = limits.limiter().step(Current(command)).unwrap();
            assert_eq!(
                (result.current.0, result.limited),
                (current, limited),
                "{command}"
            );
        }
        // Three steps of 0.3 A are a rounding above 0.9 A.
        let third = Limits {
            current_limit: 0.9,
            current_resolution: 0.3,
        };
        assert_eq!(third.limiter().step(Current(5.0)).unwrap().current.0, 0.9);
        // A limit that is no whole number of steps is kept from below.
        let uneven = Limits {
            current_limit: 0.9,
            current_resolution: 0.4,
        };
        assert_eq!(uneven.limiter().step(Current(5.0)).unwrap().current.0, 0.8);
        assert_eq!(LIMITS.limiter().step(Current(5.0)).unwrap().current.0, 2.0);
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        for command in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(LIMITS.limiter().step(Current(command)), None);
        }
    }

    proptest! {
        /// Whatever the fields are: no panic, and never more than a limit that is one.
        #[test]
        fn any_limits_can_be_stepped(
            command in prop::num::f32::ANY,
            current_limit in prop::num::f32::ANY,
            current_resolution in prop::num::f32::ANY,
        ) {
            let limits = Limits { current_limit, current_resolution };
            if let Some(limited) = limits.limiter().step(Current(command)) {
                prop_assert!(limited.current.0.abs() <= current_limit);
            } else {
                let meant = command.is_finite() && limits.check().is_ok();
                // The steps of a tiny resolution may be no number.
                let steps = current_limit / current_resolution;
                prop_assert!(!meant || !steps.is_finite() || steps > 1e30);
            }
        }

        #[test]
        fn every_finite_command_is_within_the_limit_and_half_a_step(
            command in prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO,
        ) {
            let limited = LIMITS.limiter().step(Current(command)).unwrap();
            prop_assert!(limited.current.0.abs() <= LIMITS.current_limit);
            prop_assert_eq!(limited.limited, command.abs() > LIMITS.current_limit);
            let clamped = command.clamp(-2.0, 2.0);
            // Half a step and the rounding of a number up to 2.
            prop_assert!((limited.current.0 - clamped).abs() <= 0.5e-3 + 2.0 * f32::EPSILON);
        }
    }
}
