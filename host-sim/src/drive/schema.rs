//! The tables and keys of a drive or plant file as TOML has them, before any value is looked at.

use serde::Deserialize;
use toml::Spanned;

/// The file as TOML has it, before any value is looked at.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFile {
    pub(super) kind: Option<Spanned<String>>,
    pub(super) actuator: RawActuator,
    pub(super) encoder: RawEncoder,
    #[serde(default)]
    pub(super) load: Vec<Spanned<RawLoad>>,
    pub(super) friction: Option<RawFriction>,
    pub(super) control: Option<RawControl>,
    pub(super) observer: Option<RawObserver>,
    pub(super) cost: Option<Spanned<RawCost>>,
    #[serde(rename = "move")]
    pub(super) motion: Option<RawMotion>,
    pub(super) protection: Option<RawProtection>,
    #[serde(default)]
    pub(super) force: Vec<Spanned<RawForce>>,
}

/// A number that knows where it stands.
pub(super) type Number = Spanned<f64>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawActuator {
    pub(super) mass: Number,
    pub(super) force_constant: Number,
    pub(super) current_limit: Number,
    pub(super) current_resolution: Option<Number>,
    pub(super) mass_deviation: Option<Number>,
    pub(super) force_constant_deviation: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEncoder {
    pub(super) resolution: Number,
    pub(super) counter_bits: Spanned<i64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLoad {
    pub(super) mass: Number,
    pub(super) stiffness: Number,
    pub(super) damping: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawControl {
    pub(super) sample_time: Number,
    pub(super) disturbance_cutoff: Number,
    pub(super) reaction_force_cutoff: Number,
    pub(super) observer: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCost {
    pub(super) current: Number,
    pub(super) position: Option<Spanned<Vec<Number>>>,
    pub(super) velocity: Option<Spanned<Vec<Number>>>,
    pub(super) energy: Option<Number>,
    pub(super) settling_time: Option<Number>,
    pub(super) terminal_position: Option<Spanned<Vec<Number>>>,
    pub(super) terminal_velocity: Option<Spanned<Vec<Number>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawObserver {
    pub(super) design: Option<Spanned<String>>,
    pub(super) disturbance: Option<bool>,
    pub(super) speed: Option<Number>,
    pub(super) load_force_ratio: Option<Number>,
    pub(super) disturbance_rate: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMotion {
    pub(super) velocity: Number,
    pub(super) acceleration: Number,
    pub(super) jerk: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFriction {
    pub(super) coulomb: Option<Number>,
    pub(super) viscous: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawForce {
    pub(super) mass: Spanned<i64>,
    pub(super) start: Number,
    pub(super) duration: Number,
    pub(super) newton: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawProtection {
    pub(super) encoder_step: Option<Number>,
    pub(super) velocity: Option<Number>,
    pub(super) following_error: Option<Number>,
    pub(super) reaction_force: Option<Number>,
    pub(super) disturbance: Option<Number>,
    pub(super) innovation: Option<Number>,
    pub(super) deflection: Option<Number>,
    pub(super) stiction: Option<Number>,
    pub(super) saturation_time: Option<Number>,
    pub(super) continuous_current: Option<Number>,
    pub(super) thermal_time: Option<Number>,
}
