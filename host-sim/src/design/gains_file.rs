//! The gains as Rust source: `firmware/src/gains.rs`.

use super::Design;
use crate::machine::Units;
use arso_core::Gains;
use arso_core::observer::Form;
use std::fmt::Write;

/// The file for the firmware, complete. `origin` says where the drive was described.
#[must_use]
#[expect(
    clippy::too_many_lines,
    reason = "one template, read from top to bottom"
)]
pub fn source<const N: usize, const S: usize>(design: &Design, origin: &str) -> String {
    let gains: Gains<N, S> = design.gains();
    let form = match gains.observer.form {
        Form::Anchored => "Anchored",
        Form::Reaction => "Reaction",
    };
    let Gains {
        encoder,
        actuator,
        limits,
        motion,
        regulator,
        observer,
        ..
    } = &gains;
    let Units {
        mass,
        position,
        velocity,
        acceleration,
        jerk,
        force_constant,
        position_gain,
        velocity_gain,
        ..
    } = design.drive.kind.units();
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "//! Gains of the drive. GENERATED from {origin}; do not edit.\n\
         //!\n\
         //! `cargo run --release -- design [DRIVE.toml] --rust firmware/src/gains.rs`\n\
         \n\
         use arso_core::Gains;\n\
         use arso_core::disturbance::Actuator;\n\
         use arso_core::gains::{{EncoderGains, ObserverGains}};\n\
         use arso_core::limits::Limits;\n\
         use arso_core::observer::Form;\n\
         use arso_core::reference::MotionLimits;\n\
         use arso_core::regulator::{{MassGain, Regulator}};\n\
         \n\
         /// Number of load masses.\n\
         pub const LOADS: usize = {N};\n\
         \n\
         /// Number of states of the observer.\n\
         pub const STATES: usize = {S};\n\
         \n\
         /// All that the core knows of the drive.\n\
         #[rustfmt::skip]\n\
         pub const GAINS: Gains<LOADS, STATES> = Gains {{\n\
         {I}sample_time: {:?}, // s\n\
         {I}encoder: EncoderGains {{ resolution: {:?}, counter_bits: {} }}, // {position}\n\
         {I}actuator: Actuator {{\n\
         {I}{I}mass: {:?}, // {mass}\n\
         {I}{I}force_constant: {:?}, // {force_constant}\n\
         {I}{I}mass_deviation: {:?}, // {mass}\n\
         {I}{I}force_constant_deviation: {:?}, // {force_constant}\n\
         {I}}},\n\
         {I}disturbance_cutoff: {:?}, // rad/s\n\
         {I}reaction_force_cutoff: {:?}, // rad/s\n\
         {I}observer: ObserverGains {{\n\
         {I}{I}form: Form::{form},\n\
         {I}{I}transition: [\n",
        gains.sample_time,
        encoder.resolution,
        encoder.counter_bits,
        actuator.mass,
        actuator.force_constant,
        actuator.mass_deviation,
        actuator.force_constant_deviation,
        gains.disturbance_cutoff,
        gains.reaction_force_cutoff,
    );
    for row in &observer.transition {
        let _ = writeln!(text, "{I}{I}{I}{row:?},");
    }
    let _ = write!(
        text,
        "{I}{I}],\n\
         {I}{I}input: {:?},\n\
         {I}{I}output: {:?},\n\
         {I}{I}correction: {:?},\n\
         {I}}},\n\
         {I}regulator: Regulator {{ // {position_gain}, {velocity_gain}\n\
         {I}{I}actuator: MassGain {{ position: {:?}, velocity: {:?} }},\n\
         {I}{I}loads: [\n",
        observer.input,
        observer.output,
        observer.correction,
        regulator.actuator.position,
        regulator.actuator.velocity,
    );
    for load in &regulator.loads {
        let _ = writeln!(
            text,
            "{I}{I}{I}MassGain {{ position: {:?}, velocity: {:?} }},",
            load.position, load.velocity
        );
    }
    let _ = write!(
        text,
        "{I}{I}],\n\
         {I}}},\n\
         {I}limits: Limits {{ current_limit: {:?}, current_resolution: {:?} }}, // A\n\
         {I}motion: MotionLimits {{\n\
         {I}{I}velocity: {:?}, // {velocity}\n\
         {I}{I}acceleration: {:?}, // {acceleration}\n\
         {I}{I}jerk: {:?}, // {jerk}\n\
         {I}{I}total_mass: {:?}, // {mass}\n\
         {I}}},\n\
         }};\n",
        limits.current_limit,
        limits.current_resolution,
        motion.velocity,
        motion.acceleration,
        motion.jerk,
        motion.total_mass,
    );
    text
}

/// One level of indentation.
const I: &str = "    ";
