//! The tables and keys of a drive or plant file as TOML has them, before any value is looked at. What is said
//! of a key here is what an editor shows that knows the JSON schema ([`schema`]).

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};
use std::ops::Range;
use toml::Spanned;

/// A drive or a plant. SI units; for a rotary drive read kg m^2 for kg, rad for m, N m for N.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFile {
    /// Linear (when absent) or rotary.
    #[schemars(with = "Option<String>", extend("enum" = ["linear", "rotary"]))]
    pub(super) kind: Option<Spanned<String>>,
    /// The actuator.
    pub(super) actuator: RawActuator,
    /// How the amplifier reads the board's converter.
    pub(super) amplifier: Option<RawAmplifier>,
    /// The encoder on the actuator.
    pub(super) encoder: RawEncoder,
    /// One table per load mass, from the actuator outwards, 1 to 6.
    #[serde(default)]
    #[schemars(with = "Vec<RawLoad>")]
    pub(super) load: Vec<Spanned<RawLoad>>,
    /// Friction on the actuator; none when absent.
    pub(super) friction: Option<RawFriction>,
    /// Sampling and observers.
    pub(super) control: Option<RawControl>,
    /// How the state observer is designed.
    pub(super) observer: Option<RawObserver>,
    /// The performance index, eq. (2): position and velocity, or energy alone, or `settling_time` alone; weights
    /// that follow from the drive when absent.
    #[schemars(with = "Option<RawCost>")]
    pub(super) cost: Option<Spanned<RawCost>>,
    /// The feedback gain itself, instead of `[cost]`: position and velocity of every mass.
    #[schemars(with = "Option<RawGain>")]
    pub(super) gain: Option<Spanned<RawGain>>,
    /// Limits of planned moves, each left to the design when absent.
    #[serde(rename = "move")]
    pub(super) motion: Option<RawMotion>,
    /// Limits of a running drive, each derived from drive and gains when absent.
    pub(super) protection: Option<RawProtection>,
    /// One table per force from outside; plant files only.
    #[serde(default)]
    #[schemars(with = "Vec<RawForce>")]
    pub(super) force: Vec<Spanned<RawForce>>,
}

/// A number that knows where it stands.
pub(super) type Number = Spanned<f64>;

/// What moves.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawActuator {
    /// kg: moving mass of the actuator, `m_an`.
    #[schemars(with = "f64")]
    pub(super) mass: Number,
    /// N/A: `k_fn`.
    #[schemars(with = "f64")]
    pub(super) force_constant: Number,
    /// A: largest current.
    #[schemars(with = "f64")]
    pub(super) current_limit: Number,
    /// A: step of the current output; 0 or absent: continuous.
    #[schemars(with = "Option<f64>")]
    pub(super) current_resolution: Option<Number>,
    /// N: force by which the motor holds the machine where it stands, against gravity, positive as a positive
    /// current; 0 when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) holding_force: Option<Number>,
    /// Whether a brake holds the actuator while the amplifier is off; false when absent.
    pub(super) brake: Option<bool>,
    /// kg: identified minus nominal mass, Delta `m` of (18).
    #[schemars(with = "Option<f64>")]
    pub(super) mass_deviation: Option<Number>,
    /// N/A: identified minus nominal force constant, Delta `k_f` of (18).
    #[schemars(with = "Option<f64>")]
    pub(super) force_constant_deviation: Option<Number>,
    /// s: by which the force comes late behind the command, beside the control period itself; 0 when absent, at
    /// most 4 control periods in a drive file.
    #[schemars(with = "Option<f64>")]
    pub(super) delay: Option<Number>,
    /// s: time constant of the force's first-order lag behind the command; 0 when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) lag: Option<Number>,
    /// N: amplitude of the force that draws the actuator to multiples of the pitch; 0 when absent; plant files only.
    #[schemars(with = "Option<f64>")]
    pub(super) cogging: Option<Number>,
    /// m: in which it repeats.
    #[schemars(with = "Option<f64>")]
    pub(super) cogging_pitch: Option<Number>,
}

/// How the amplifier reads the board's converter.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawAmplifier {
    /// Code of the converter at no current; 2048, the middle of twelve bits, when absent.
    #[schemars(with = "Option<i64>")]
    pub(super) zero_code: Option<Spanned<i64>>,
    /// Whether a higher code is less current; false when absent.
    pub(super) inverted: Option<bool>,
}

/// What is measured.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEncoder {
    /// m: per count, after x4 decoding.
    #[schemars(with = "f64")]
    pub(super) resolution: Number,
    /// Width of the counter: 2 to 32; 16 or 32 for the firmware.
    #[schemars(with = "i64", range(min = 2, max = 32))]
    pub(super) counter_bits: Spanned<i64>,
    /// m: amplitude of what the encoder reads too much, a sine of the position; 0 when absent; plant files only.
    #[schemars(with = "Option<f64>")]
    pub(super) eccentricity: Option<Number>,
    /// m: in which it repeats.
    #[schemars(with = "Option<f64>")]
    pub(super) eccentricity_pitch: Option<Number>,
    /// m rms: Gaussian noise of the encoder before it rounds, the same in every run; 0 when absent; plant files only.
    #[schemars(with = "Option<f64>")]
    pub(super) noise: Option<Number>,
}

/// A load mass with spring and damper towards the actuator.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLoad {
    /// kg.
    #[schemars(with = "f64")]
    pub(super) mass: Number,
    /// N/m.
    #[schemars(with = "f64")]
    pub(super) stiffness: Number,
    /// N s/m.
    #[schemars(with = "f64")]
    pub(super) damping: Number,
    /// N s/m: viscous friction against the ground; 0 when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) viscous: Option<Number>,
    /// N: Coulomb friction against the ground, in the simulated plant; 0 when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) coulomb: Option<Number>,
    /// m: total gap within which spring and damper carry nothing; 0 when absent; plant files only.
    #[schemars(with = "Option<f64>")]
    pub(super) backlash: Option<Number>,
}

/// Sampling and observers.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawControl {
    /// s: control period.
    #[schemars(with = "f64")]
    pub(super) sample_time: Number,
    /// rad/s: `g_dist`, eq. (19).
    #[schemars(with = "f64")]
    pub(super) disturbance_cutoff: Number,
    /// rad/s: `g_reac`, eq. (18).
    #[schemars(with = "f64")]
    pub(super) reaction_force_cutoff: Number,
    /// The state observer: anchored, or reaction, eq. (17) as printed, which drifts under friction.
    #[schemars(with = "String", extend("enum" = ["anchored", "reaction"]))]
    pub(super) observer: Spanned<String>,
}

/// Weights of the performance index, eq. (2).
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCost {
    /// 1/A^2: R.
    #[schemars(with = "f64")]
    pub(super) current: Number,
    /// 1/m^2: diagonal of Q, one entry per mass, actuator first.
    #[schemars(with = "Option<Vec<f64>>")]
    pub(super) position: Option<Spanned<Vec<Number>>>,
    /// s^2/m^2: diagonal of Q, one entry per mass, actuator first.
    #[schemars(with = "Option<Vec<f64>>")]
    pub(super) velocity: Option<Spanned<Vec<Number>>>,
    /// Instead of both: stiffness attached to each mass and the mass itself, times this.
    #[schemars(with = "Option<f64>")]
    pub(super) energy: Option<Number>,
    /// s: instead of position, velocity or energy: to 2 % of a step, with the true state fed back.
    #[schemars(with = "Option<f64>")]
    pub(super) settling_time: Option<Number>,
    /// s/m^2: diagonal of H, for the finite horizon alone; 0 when absent.
    #[schemars(with = "Option<Vec<f64>>")]
    pub(super) terminal_position: Option<Spanned<Vec<Number>>>,
    /// s^3/m^2: diagonal of H, for the finite horizon alone; 0 when absent.
    #[schemars(with = "Option<Vec<f64>>")]
    pub(super) terminal_velocity: Option<Spanned<Vec<Number>>>,
}

/// The feedback gain, against absolute positions and velocities.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawGain {
    /// A/m, one entry per mass, actuator first; the sum must be above 0.
    #[schemars(with = "Vec<f64>")]
    pub(super) position: Spanned<Vec<Number>>,
    /// A s/m, one entry per mass, actuator first.
    #[schemars(with = "Vec<f64>")]
    pub(super) velocity: Spanned<Vec<Number>>,
}

/// How the state observer is designed.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawObserver {
    /// kalman (when absent) or poles.
    #[schemars(with = "Option<String>", extend("enum" = ["kalman", "poles"]))]
    pub(super) design: Option<Spanned<String>>,
    /// Whether the disturbance on the actuator is estimated and compensated; true when absent.
    pub(super) disturbance: Option<bool>,
    /// How many times faster than the regulator's slowest pole; 2 when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) speed: Option<Number>,
    /// 1: random force on each load over the noise of the measured force.
    #[schemars(with = "Option<f64>")]
    pub(super) load_force_ratio: Option<Number>,
    /// 1/s: random walk of the disturbance over the noise of the measured force.
    #[schemars(with = "Option<f64>")]
    pub(super) disturbance_rate: Option<Number>,
}

/// Limits of a planned move.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMotion {
    /// Of the actuator, m/s.
    #[schemars(with = "Option<f64>")]
    pub(super) velocity: Option<Number>,
    /// Of the actuator, m/s^2; none when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) acceleration: Option<Number>,
    /// Of the actuator, m/s^3; none when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) jerk: Option<Number>,
    /// Most that each spring may be stretched or compressed, from the actuator outwards, m; none when absent.
    #[schemars(with = "Option<Vec<f64>>")]
    pub(super) deflection: Option<Spanned<Vec<Number>>>,
    /// Share of the current limit that planned moves may use, above 0 and up to 1; 0.97 when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) current_share: Option<Number>,
    /// Most bytes of the table of plans in the drive's memory; 65536 when absent.
    #[schemars(with = "Option<i64>")]
    pub(super) table: Option<Spanned<i64>>,
    /// How far from its target the actuator may come to rest, m; 50 um or 5 counts when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) settling_tolerance: Option<Number>,
}

/// Friction on the actuator.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFriction {
    /// N: fed forward by the drive, and in the simulated plant.
    #[schemars(with = "Option<f64>")]
    pub(super) coulomb: Option<Number>,
    /// N: of motion backwards, in the simulated plant; as coulomb when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) coulomb_backward: Option<Number>,
    /// N: most that holds at rest, in the simulated plant; backwards as much more than in motion; coulomb when absent.
    #[serde(rename = "static")]
    #[schemars(with = "Option<f64>")]
    pub(super) at_rest: Option<Number>,
    /// m/s: at which of what holds at rest beyond coulomb a share of 1/e is left; 5e-3 when absent.
    #[schemars(with = "Option<f64>")]
    pub(super) stribeck_velocity: Option<Number>,
    /// N s/m: in the design and in the simulated plant.
    #[schemars(with = "Option<f64>")]
    pub(super) viscous: Option<Number>,
}

/// A force from outside.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawForce {
    /// 0 for the actuator, 1 for the first load, and so on.
    #[schemars(with = "i64")]
    pub(super) mass: Spanned<i64>,
    /// s.
    #[schemars(with = "f64")]
    pub(super) start: Number,
    /// s.
    #[schemars(with = "f64")]
    pub(super) duration: Number,
    /// N, or N m.
    #[schemars(with = "f64")]
    pub(super) newton: Number,
}

/// Limits of a running drive.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawProtection {
    /// Change of the actuator's motion that the current does not explain, m per period.
    #[schemars(with = "Option<f64>")]
    pub(super) encoder_step: Option<Number>,
    /// Of the actuator, m/s.
    #[schemars(with = "Option<f64>")]
    pub(super) velocity: Option<Number>,
    /// Distance of the actuator from its reference, m.
    #[schemars(with = "Option<f64>")]
    pub(super) following_error: Option<Number>,
    /// N.
    #[schemars(with = "Option<f64>")]
    pub(super) reaction_force: Option<Number>,
    /// Force on the actuator that the observer may find, N.
    #[schemars(with = "Option<f64>")]
    pub(super) disturbance: Option<Number>,
    /// Force that the model does not expect, N.
    #[schemars(with = "Option<f64>")]
    pub(super) innovation: Option<Number>,
    /// Distance of the actuator from a planned move, at rest, m.
    #[schemars(with = "Option<f64>")]
    pub(super) tracking_error: Option<Number>,
    /// Of every spring, m.
    #[schemars(with = "Option<f64>")]
    pub(super) deflection: Option<Number>,
    /// Most by which friction can hold the actuator, N.
    #[schemars(with = "Option<f64>")]
    pub(super) stiction: Option<Number>,
    /// How long the current may be at its limit, s.
    #[schemars(with = "Option<f64>")]
    pub(super) saturation_time: Option<Number>,
    /// What the motor can carry for ever, A.
    #[schemars(with = "Option<f64>")]
    pub(super) continuous_current: Option<Number>,
    /// In which the motor heats up, s.
    #[schemars(with = "Option<f64>")]
    pub(super) thermal_time: Option<Number>,
    /// Lower and upper end of where the actuator may be, m from zero, once zero is known.
    #[schemars(with = "Option<[f64; 2]>")]
    pub(super) travel: Option<Spanned<Vec<Number>>>,
}

/// Keys of a plant file alone.
const PLANT_ONLY: [(&str, &str); 6] = [
    ("RawActuator", "cogging"),
    ("RawActuator", "cogging_pitch"),
    ("RawLoad", "backlash"),
    ("RawEncoder", "eccentricity"),
    ("RawEncoder", "eccentricity_pitch"),
    ("RawEncoder", "noise"),
];

impl RawFile {
    /// Where it first says what only a plant file can say: the table or key, and its place.
    pub(super) fn plant_only(&self) -> Option<(&'static str, Range<usize>)> {
        let (actuator, encoder) = (&self.actuator, &self.encoder);
        let keys = [
            ("actuator.cogging", &actuator.cogging),
            ("actuator.cogging_pitch", &actuator.cogging_pitch),
            ("encoder.eccentricity", &encoder.eccentricity),
            ("encoder.eccentricity_pitch", &encoder.eccentricity_pitch),
            ("encoder.noise", &encoder.noise),
        ];
        let loads = self.load.iter().map(|load| &load.get_ref().backlash);
        let keys = keys
            .into_iter()
            .chain(loads.map(|key| ("load.backlash", key)));
        let spans = keys.filter_map(|(name, key)| Some((name, key.as_ref()?.span())));
        let forces = self.force.iter().map(|force| ("[[force]]", force.span()));
        spans.chain(forces).min_by_key(|(_, span)| span.start)
    }
}

/// JSON schema of a drive file, or of a plant file.
#[must_use]
pub fn schema(plant: bool) -> Value {
    let mut schema = schemars::schema_for!(RawFile).to_value();
    schema["title"] = json!(if plant { "plant file" } else { "drive file" });
    schema["properties"]["load"]["minItems"] = json!(1);
    schema["properties"]["load"]["maxItems"] = json!(super::MAX_LOADS);
    let mut required = vec!["actuator", "encoder", "load"];
    if !plant {
        required.push("control");
        if let Some(properties) = schema["properties"].as_object_mut() {
            properties.remove("force");
        }
        if let Some(definitions) = schema["$defs"].as_object_mut() {
            definitions.remove("RawForce");
        }
        for (table, key) in PLANT_ONLY {
            if let Some(properties) = schema["$defs"][table]["properties"].as_object_mut() {
                properties.remove(key);
            }
        }
    }
    schema["required"] = json!(required);
    schema
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Keys of a schema, in the words of the README: `table.key`.
    fn keys(schema: &Value) -> Vec<String> {
        let mut keys = Vec::new();
        for (table, of) in schema["properties"].as_object().unwrap() {
            let text = of.to_string();
            let name = text
                .split("#/$defs/")
                .nth(1)
                .and_then(|rest| rest.split('"').next());
            let Some(name) = name else {
                keys.push(table.clone());
                continue;
            };
            for (key, of) in schema["$defs"][name]["properties"].as_object().unwrap() {
                assert!(of["description"].is_string(), "{table}.{key}");
                keys.push(format!("{table}.{key}"));
            }
        }
        keys
    }

    /// The README explains every key, and the schema has every key that the README explains.
    #[test]
    fn the_readme_explains_every_key() {
        let readme = include_str!("../../../README.md");
        let begin = readme.find("| key | unit | meaning |").unwrap();
        let end = readme.find("### The CSV files").unwrap();
        let rows = readme[begin..end]
            .lines()
            .filter(|line| line.starts_with("| `"));
        let names = rows.flat_map(|row| {
            let cell = row.split('|').nth(1).unwrap();
            cell.split('`').skip(1).step_by(2).map(str::to_owned)
        });
        let mut explained: Vec<String> = names.collect();
        let mut known = keys(&schema(true));
        explained.sort();
        known.sort();
        assert_eq!(explained, known);
    }

    #[test]
    fn a_drive_file_has_no_force_and_needs_no_cost() {
        let drive = schema(false);
        assert!(drive["properties"].get("force").is_none());
        let plant = schema(true);
        for (table, key) in PLANT_ONLY {
            let has = |schema: &Value| schema["$defs"][table]["properties"].get(key).is_some();
            assert!(has(&plant) && !has(&drive), "{table}.{key}");
        }
        assert_eq!(
            drive["required"],
            json!(["actuator", "encoder", "load", "control"])
        );
        assert_eq!(drive["additionalProperties"], json!(false));
        let observer = &drive["$defs"]["RawControl"]["properties"]["observer"];
        assert_eq!(observer["enum"], json!(["anchored", "reaction"]));
    }
}
