//! The gains as Rust source: `firmware/src/gains.rs`.

use super::Design;
use super::plans::PlanTable;
use crate::machine::Units;
use arso_core::Settings;
use arso_core::moves::plans::row_words;
use arso_core::observer::{LinearObserver, StateObserver};
use arso_core::units::Travel;
use std::fmt::Write;

/// The file for the firmware, complete.
///
/// * `observer`, `name`: how the core makes the observer from its coefficients, and what it calls it
/// * `origin`: where the drive was described
#[must_use]
#[expect(
    clippy::too_many_lines,
    reason = "one template, read from top to bottom"
)]
pub fn gains_file<const N: usize, const S: usize, O: StateObserver<N>>(
    design: &Design,
    observer: impl FnOnce(LinearObserver<S>) -> O,
    name: &str,
    origin: &str,
    plans: &PlanTable,
) -> String {
    let LinearObserver {
        change,
        input,
        output,
        correction,
    } = design.coefficients::<S>();
    let settings: Settings<N, O> = design.settings(observer, &design.protection());
    let Settings {
        encoder,
        actuator,
        limits,
        protection,
        regulator,
        ..
    } = &settings;
    let Units {
        mass,
        position,
        velocity,
        force,
        force_constant,
        position_gain,
        velocity_gain,
        ..
    } = design.drive.kind.units();
    let kind = design.drive.kind.name();
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "//! Gains of the drive. GENERATED from {origin}; do not edit.\n\
         //!\n\
         //! `cargo run --release -- design [DRIVE.toml] --rust firmware/src/gains.rs`\n\
         \n\
         use arso_core::Settings;\n\
         use arso_core::actuator::Actuator;\n\
         use arso_core::amplifier::Amplifier;\n\
         use arso_core::encoder::Encoder;\n\
         use arso_core::friction::FrictionFeedForward;\n\
         use arso_core::limits::Limits;\n\
         use arso_core::moves::plans::{{Plan, Plans}};\n\
         use arso_core::observer::{{{name}, LinearObserver}};\n\
         use arso_core::protection::{{ModelError, ProtectionLimits}};\n\
         use arso_core::regulator::{{MassGain, Regulator}};\n\
         use arso_core::standstill::{{FrictionLearning, Standstill}};\n\
         \n\
         /// Linear or rotary: which units all numbers are in.\n\
         pub const KIND: &str = \"{kind}\";\n\
         \n\
         /// Number of load masses.\n\
         pub const LOADS: usize = {N};\n\
         \n\
         /// The state observer, with its number of states.\n\
         pub type Observer = {name}<LOADS, {S}>;\n\
         \n\
         /// All that the core knows of the drive.\n\
         #[rustfmt::skip]\n\
         pub const GAINS: Settings<LOADS, Observer> = Settings {{\n\
         {I}sample_time: {:?}, // s\n\
         {I}encoder: Encoder {{ resolution: {:?}, counter_bits: {} }}, // {position}\n\
         {I}actuator: Actuator {{\n\
         {I}{I}mass: {:?}, // {mass}\n\
         {I}{I}force_constant: {:?}, // {force_constant}\n\
         {I}{I}mass_deviation: {:?}, // {mass}\n\
         {I}{I}force_constant_deviation: {:?}, // {force_constant}\n\
         {I}}},\n\
         {I}amplifier: {:?}, // A per code\n\
         {I}disturbance_cutoff: {:?}, // rad/s\n\
         {I}reaction_force_cutoff: {:?}, // rad/s\n\
         {I}observer: {name}::new(LinearObserver::new(\n\
         {I}{I}[ // change over a period: transition less 1\n",
        settings.sample_time,
        encoder.resolution,
        encoder.counter_bits,
        actuator.mass,
        actuator.force_constant,
        actuator.mass_deviation,
        actuator.force_constant_deviation,
        settings.amplifier,
        settings.disturbance_cutoff,
        settings.reaction_force_cutoff,
    );
    for row in change.row_iter() {
        let row: Vec<f32> = row.iter().copied().collect();
        let _ = writeln!(text, "{I}{I}{I}{row:?},");
    }
    let _ = write!(
        text,
        "{I}{I}],\n\
         {I}{I}{:?}, // input\n\
         {I}{I}{:?}, // output\n\
         {I}{I}{:?}, // correction\n\
         {I})),\n\
         {I}regulator: Regulator {{ // {position_gain}, {velocity_gain}\n\
         {I}{I}actuator: MassGain {{ position: {:?}, velocity: {:?} }},\n\
         {I}{I}loads: [\n",
        input.as_slice(),
        output.as_slice(),
        correction.as_slice(),
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
    let travel = protection.travel.map_or_else(
        || "None".to_owned(),
        |Travel { lowest, highest }| {
            let path = "arso_core::units::Travel";
            let [lowest, highest] = [lowest, highest].map(|end| format!("arso_core::{end:?}"));
            format!("Some({path} {{ lowest: {lowest}, highest: {highest} }})")
        },
    );
    let _ = write!(
        text,
        "{I}{I}],\n\
         {I}}},\n\
         {I}limits: Limits {{ current_limit: {:?}, current_resolution: {:?} }}, // A\n\
         {I}total_mass: {:?}, // {mass}\n\
         {I}friction: {:?}, // {force}, {velocity}\n\
         {I}standstill: {:?}, // {position}, periods\n\
         {I}holding_force: {:?}, // {force}\n\
         {I}protection: ProtectionLimits {{\n\
         {I}{I}encoder_step: {:?}, // {position}\n\
         {I}{I}velocity: {:?}, // {velocity}\n\
         {I}{I}following_error: {:?}, // {position}\n\
         {I}{I}reaction_force: {:?}, // {force}\n\
         {I}{I}disturbance: {:?}, // {force}\n\
         {I}{I}innovation: {:?}, // {force}\n\
         {I}{I}tracking_error: {:?}, // {position}\n\
         {I}{I}model_error: {:?},\n\
         {I}{I}deflection: {:?}, // {position}\n\
         {I}{I}stiction: {:?}, // {force}\n\
         {I}{I}saturation_time: {:?}, // s\n\
         {I}{I}continuous_current: {:?}, // A\n\
         {I}{I}thermal_time: {:?}, // s\n\
         {I}{I}travel: {travel}, // counts from zero\n\
         {I}}},\n\
         }};\n",
        limits.current_limit,
        limits.current_resolution,
        settings.total_mass,
        settings.friction,
        settings.standstill,
        settings.holding_force,
        protection.encoder_step,
        protection.velocity,
        protection.following_error,
        protection.reaction_force,
        protection.disturbance,
        protection.innovation,
        protection.tracking_error,
        protection.model_error,
        protection.deflection,
        protection.stiction,
        protection.saturation_time,
        protection.continuous_current,
        protection.thermal_time,
    );
    let plans = plans.plans();
    let _ = write!(
        text,
        "\n\
         /// The planned moves.\n\
         #[rustfmt::skip]\n\
         pub static PLANS: Plans<'static> = Plans {{\n\
         {I}stride: {:?},\n\
         {I}displacements: &[\n",
        plans.stride
    );
    for plan in plans.displacements {
        let _ = writeln!(text, "{I}{I}{plan:?},");
    }
    let _ = write!(
        text,
        "{I}],\n\
         {I}change: {:?},\n\
         {I}run: {:?},\n\
         {I}bend: {:?},\n\
         {I}checksum: {:#010x},\n\
         {I}rows: &[\n",
        plans.change, plans.run, plans.bend, plans.checksum
    );
    for row in plans.rows.chunks(row_words(N)) {
        let words: Vec<String> = row.iter().map(|word| format!("{word},")).collect();
        let _ = writeln!(text, "{I}{I}{}", words.join(" "));
    }
    let _ = write!(text, "{I}],\n}};\n");
    text
}

/// One level of indentation.
const I: &str = "    ";
