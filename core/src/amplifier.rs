//! Amplifier: from a current to the code of the converter that asks for it, and back.
//!
//! ```text
//! code = zero_code ± i / step        + or, where inverted, −
//! ```

use crate::check::{SettingsError, not_negative};
use crate::units::Current;
use serde::{Deserialize, Serialize};

/// How the amplifier reads the converter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Amplifier {
    /// Current per code, A; zero where there is no converter.
    pub step: f32,
    /// Code of no current.
    pub zero_code: u16,
    /// Whether a higher code is less current.
    pub inverted: bool,
}

impl Amplifier {
    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        not_negative("amplifier.step", self.step)
    }

    /// The code nearest to a current; what is no number is no current.
    ///
    /// * `codes`: how many the converter has; the code is within them
    #[must_use]
    pub fn code(&self, current: Current, codes: u16) -> u16 {
        let steps = current.0 / self.step;
        // To the nearest; the cast cuts, saturates, and makes zero of what is no number.
        let steps = if self.step > 0.0 {
            (steps + f32::copysign(0.5, steps)) as i32
        } else {
            0
        };
        let steps = if self.inverted {
            steps.saturating_neg()
        } else {
            steps
        };
        let code = i32::from(self.zero_code).saturating_add(steps);
        code.min(i32::from(codes) - 1).max(0) as u16
    }

    /// The current that a code asks for.
    #[must_use]
    pub fn current(&self, code: u16) -> Current {
        let steps = f32::from(code) - f32::from(self.zero_code);
        Current(if self.inverted { -steps } else { steps } * self.step)
    }

    /// Largest current that both signs reach, A.
    ///
    /// * `codes`: how many the converter has
    #[must_use]
    pub const fn reach(&self, codes: u16) -> f32 {
        let above = codes.saturating_sub(1).saturating_sub(self.zero_code);
        let steps = if above < self.zero_code {
            above
        } else {
            self.zero_code
        };
        steps as f32 * self.step
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn codes_as_the_boards_have_them() {
        let plain = Amplifier {
            step: 1e-3,
            zero_code: 2048,
            inverted: false,
        };
        let other = Amplifier {
            step: 2.5e-3,
            zero_code: 2100,
            inverted: true,
        };
        for (amplifier, current, code) in [
            (plain, 0.0, 2048),
            (plain, 0.5, 2548),
            (plain, -2.0, 48),
            (plain, 9.0, 4095),
            (plain, f32::NEG_INFINITY, 0),
            (plain, f32::NAN, 2048),
            (other, 0.0, 2100),
            (other, 4.0, 500),
            (other, -4.0, 3700),
            (other, f32::NAN, 2100),
            (Amplifier { step: 0.0, ..plain }, 1.0, 2048),
        ] {
            assert_eq!(amplifier.code(Current(current), 4096), code, "{current}");
        }
        assert!((plain.reach(4096) - 2.047).abs() < 1e-6);
        assert!((other.reach(4096) - 1995.0 * 2.5e-3).abs() < 1e-6);
        assert_eq!(
            Amplifier {
                zero_code: 5000,
                ..plain
            }
            .reach(4096),
            0.0
        );
    }

    proptest! {
        /// There and back is within half a step, wherever both signs reach; more current is never less.
        #[test]
        fn there_and_back(
            step in 1e-5_f32..1.0,
            zero_code in 1_u16..4095,
            inverted: bool,
            shares in prop::array::uniform2(-1.0_f32..=1.0),
        ) {
            let amplifier = Amplifier { step, zero_code, inverted };
            let currents = shares.map(|share| share * amplifier.reach(4096));
            let made = currents.map(|current| {
                amplifier.current(amplifier.code(Current(current), 4096)).0
            });
            for (asked, made) in currents.iter().zip(made) {
                prop_assert!((asked - made).abs() <= 0.5005 * step);
            }
            prop_assert_eq!(currents[0] < currents[1] && made[0] > made[1], false);
        }

        /// Whatever is asked: a code that the converter has.
        #[test]
        fn any_current_is_a_code(
            step: f32, zero_code: u16, inverted: bool, current: f32, codes in 1_u16..,
        ) {
            let amplifier = Amplifier { step, zero_code, inverted };
            prop_assert!(amplifier.code(Current(current), codes) < codes);
        }
    }
}
