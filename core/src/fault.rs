//! The faults: one table, one row each.
//!
//! A row has the number, the name, how the drive stops, what has happened, what to do about it, and the
//! setting that moves the limit where there is one. The numbers are stable: they appear in logs. A fault is
//! latched until `Stop` acknowledges it; a limit that merely acts (current limited) is no fault and shows
//! in the telemetry.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// How a fault stops the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// The amplifier is off in the period in which the fault is found.
    Off,
    /// The loop can be trusted: it brakes the machine to a stand, then the amplifier is off.
    Brake,
}

macro_rules! faults {
    ($($number:literal $name:ident $reaction:ident $sentence:literal, $remedy:literal, $setting:expr;)*) => {
        /// A fault that stops the drive.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
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

            /// How it stops the drive.
            #[must_use]
            pub const fn reaction(self) -> Reaction {
                match self { $(Self::$name => Reaction::$reaction,)* }
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
    1 NonFinite Off "a measurement, an estimate or the command is no number",
        "check gains and supply of the board; report it if they are in order", None;
    2 EncoderJump Off "more than a quarter of the counter's range in one period",
        "check the encoder's wiring and shielding", Some("encoder.counter_bits");
    3 Target Off "a move that cannot be made: no number, or too long to be counted in periods",
        "ask for another target", None;
    4 AppliedCurrent Off "more current applied than the limit allows: output and command disagree",
        "check the current output", Some("actuator.current_limit");
    5 Direction Off "a positive current moves the encoder backwards",
        "swap the encoder's phases or the motor's leads", None;
    6 NoMotion Off "current flows and the encoder does not move",
        "connect encoder, amplifier and motor, release what holds the actuator", None;
    7 NotAtRest Off "the actuator does not come to rest",
        "keep it from moving by itself while the drive starts", None;
    8 Travel Brake "the actuator left its travel (an excitation has no loop to brake with: off at once)",
        "excite with less current, ask for what is within the travel, or allow more",
        Some("protection.travel, excite --travel");
    9 EncoderStep Off "the encoder's motion changes by more in one period than any force can do",
        "check encoder, wiring and shielding; state the true mass", Some("protection.encoder_step");
    10 Velocity Off "the actuator is faster than it may be",
        "ask for slower moves, or allow more", Some("protection.velocity");
    11 FollowingError Brake "the actuator is farther from its reference than it may be",
        "ask for shorter steps, or allow more", Some("protection.following_error");
    12 ReactionForce Off "the load pulls harder at the actuator than it may",
        "look for a collision, or allow more", Some("protection.reaction_force");
    13 Disturbance Off "a force that the model does not have is larger than it may be",
        "look for a fault of encoder or amplifier and for friction, or allow more",
        Some("protection.disturbance");
    14 Unexpected Off "the force on the actuator changes in a way the model does not expect",
        "look for a fault of encoder or amplifier, or identify the load anew",
        Some("protection.innovation");
    15 Deflection Off "a spring is stretched farther than it may be",
        "look for a collision, or allow more", Some("protection.deflection");
    16 Stalled Off "the motor's force changes and the encoder stands still",
        "check the encoder, release what holds the actuator, declare its friction",
        Some("protection.stiction");
    17 Saturated Off "the current is at its limit for longer than a move can need",
        "look for what holds the actuator, or allow longer", Some("protection.saturation_time");
    18 Thermal Brake "the motor carries more current than it can for so long",
        "let it cool, move less often, or state its true rating", Some("protection.continuous_current");
    19 Timing Off "a control interrupt came late, early or not at all, or took too long",
        "report it: the processor does not keep its time", None;
    20 Amplifier Off "the amplifier reports a fault",
        "see the amplifier's own manual", None;
    21 Settings Off "the settings in the drive's memory are no longer those it started with",
        "reset the drive; look for what disturbs its memory if it comes again", None;
    22 TrackingError Off "the actuator is farther from its planned move than any machine near the description can be",
        "look for what pushes or holds it, for a fault of encoder or amplifier, or identify the load anew",
        Some("protection.tracking_error");
    23 Homing Brake "homing has found nothing: neither a stop nor the edge of the home switch",
        "check the direction of the approach and the home switch, begin nearer, or approach faster", None;
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
