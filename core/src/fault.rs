//! The faults: one table, one row each.
//!
//! A row has the number, the name, what has happened, what to do about it, and the setting that moves the
//! limit where there is one. The numbers are stable: they appear in logs. A fault switches the
//! amplifier off within the period in which it is found and is latched until `Stop` acknowledges it; a
//! limit that merely acts (current limited) is no fault and shows in the telemetry.

use serde::{Deserialize, Serialize};

macro_rules! faults {
    ($($number:literal $name:ident $sentence:literal, $remedy:literal, $setting:expr;)*) => {
        /// A fault that stops the drive.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[serde(rename_all = "snake_case")]
        #[repr(u8)]
        pub enum Fault {
            $(#[doc = $sentence] $name = $number,)*
        }

        impl Fault {
            /// All of them, by number.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Its name.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$name => stringify!($name),)* }
            }

            /// What has happened.
            #[must_use]
            pub const fn sentence(self) -> &'static str {
                match self { $(Self::$name => $sentence,)* }
            }

            /// What to do about it.
            #[must_use]
            pub const fn remedy(self) -> &'static str {
                match self { $(Self::$name => $remedy,)* }
            }

            /// The setting that moves its limit, by its key in the drive file.
            #[must_use]
            pub const fn setting(self) -> Option<&'static str> {
                match self { $(Self::$name => $setting,)* }
            }
        }
    };
}

faults! {
    1 NonFinite "a measurement, an estimate or the command is no number",
        "check gains and supply of the board; report it if they are in order", None;
    2 EncoderJump "more than a quarter of the counter's range in one period",
        "check the encoder's wiring and shielding", Some("encoder.counter_bits");
    3 Target "a move that cannot be made: no number, or too long to be counted in periods",
        "ask for another target", None;
    4 AppliedCurrent "more current applied than the limit allows: output and command disagree",
        "check the current output", Some("actuator.current_limit");
    5 Direction "a positive current moves the encoder backwards",
        "swap the encoder's phases or the motor's leads", None;
    6 NoMotion "current flows and the encoder does not move",
        "connect encoder, amplifier and motor, release what holds the actuator", None;
    7 NotAtRest "the actuator does not come to rest",
        "keep it from moving by itself while the drive starts", None;
    8 Travel "the actuator left the travel allowed to it while it was excited",
        "excite with less current or allow more travel", Some("excite --travel");
}

impl Fault {
    /// Its number.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers stand in logs of drives in the field.
    #[test]
    fn numbers_are_in_order_and_none_is_used_twice() {
        for (fault, number) in Fault::ALL.iter().zip(1_u8..) {
            assert_eq!(fault.number(), number);
            assert!(!fault.sentence().is_empty() && !fault.remedy().is_empty());
        }
    }
}
