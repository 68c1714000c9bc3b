//! The file behind a [`Drive`](super::Drive) or [`PlantFile`](super::PlantFile): what TOML has, and the
//! check of every value, with a message that names file, line, key, value and what is allowed.

use super::{
    Actuator, Control, Cost, Encoder, ExternalForce, Friction, Kind, Load, MAX_LOADS, Motion,
    ObserverDesign, ObserverSettings, Units,
};
use crate::design::settling;
use crate::error::{Error, Result};
use crate::model::Chain;
use arso_core::observer::Form;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;

/// The paper's weights: each mass weighs in with the stiffness attached to it and with its mass,
/// so that the index counts potential and kinetic energy, times `scale`.
fn energy_weights(chain: &Chain, scale: f64) -> (Vec<f64>, Vec<f64>) {
    let stiffness = |element: usize| {
        let inner = element
            .checked_sub(1)
            .map_or(0.0, |spring| chain.stiffness[spring]);
        inner + chain.stiffness.get(element).copied().unwrap_or(0.0)
    };
    (
        (0..chain.mass.len())
            .map(|element| scale * stiffness(element))
            .collect(),
        chain.mass.iter().map(|mass| scale * mass).collect(),
    )
}

pub(super) fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|source| Error::Read {
        path: path.to_owned(),
        source,
    })
}

/// The file as TOML has it, before any value is looked at.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFile {
    kind: Option<Spanned<String>>,
    pub(super) actuator: RawActuator,
    pub(super) encoder: RawEncoder,
    #[serde(default)]
    load: Vec<Spanned<RawLoad>>,
    pub(super) friction: Option<RawFriction>,
    pub(super) control: Option<RawControl>,
    pub(super) observer: Option<RawObserver>,
    pub(super) cost: Option<Spanned<RawCost>>,
    #[serde(rename = "move")]
    pub(super) motion: Option<RawMotion>,
    #[serde(default)]
    pub(super) force: Vec<Spanned<RawForce>>,
}

type Number = Spanned<f64>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawActuator {
    mass: Number,
    force_constant: Number,
    current_limit: Number,
    current_resolution: Option<Number>,
    mass_deviation: Option<Number>,
    force_constant_deviation: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEncoder {
    resolution: Number,
    counter_bits: Spanned<i64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLoad {
    mass: Number,
    stiffness: Number,
    damping: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawControl {
    sample_time: Number,
    disturbance_cutoff: Number,
    reaction_force_cutoff: Number,
    observer: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCost {
    current: Number,
    position: Option<Spanned<Vec<Number>>>,
    velocity: Option<Spanned<Vec<Number>>>,
    energy: Option<Number>,
    settling_time: Option<Number>,
    terminal_position: Option<Spanned<Vec<Number>>>,
    terminal_velocity: Option<Spanned<Vec<Number>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawObserver {
    design: Option<Spanned<String>>,
    disturbance: Option<bool>,
    speed: Option<Number>,
    load_force_ratio: Option<Number>,
    disturbance_rate: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMotion {
    velocity: Number,
    acceleration: Number,
    jerk: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFriction {
    coulomb: Option<Number>,
    viscous: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawForce {
    mass: Spanned<i64>,
    start: Number,
    duration: Number,
    newton: Number,
}

/// Numbers beyond this are slips of the pen; within it nothing overflows in the design.
const LARGEST: f64 = 1e9;
const SMALLEST: f64 = 1e-9;

/// A file's text and name: turns spans into places.
pub(super) struct Source<'a> {
    text: &'a str,
    name: &'a str,
    kind: Kind,
}

impl<'a> Source<'a> {
    /// Reads a file as far as TOML and the kind of drive go.
    pub(super) fn open(text: &'a str, name: &'a str) -> Result<(Self, RawFile)> {
        let mut source = Self {
            text,
            name,
            kind: Kind::default(),
        };
        let raw: RawFile = toml::from_str(text).map_err(|error| {
            let message = error.message().trim().replace('\n', "; ");
            source.error(error.span(), message)
        })?;
        if let Some(kind) = &raw.kind {
            source.kind = source.one_of(
                "kind",
                kind,
                &[("linear", Kind::Linear), ("rotary", Kind::Rotary)],
            )?;
        }
        Ok((source, raw))
    }

    /// Linear or rotary.
    pub(super) fn kind(&self) -> Kind {
        self.kind
    }

    fn units(&self) -> &'static Units {
        self.kind.units()
    }

    /// A word that must be one of two or more.
    fn one_of<T: Copy>(
        &self,
        key: &str,
        word: &Spanned<String>,
        allowed: &[(&str, T)],
    ) -> Result<T> {
        let found = allowed.iter().find(|(name, _)| name == word.get_ref());
        found.map(|(_, value)| *value).ok_or_else(|| {
            let names: Vec<_> = allowed
                .iter()
                .map(|(name, _)| format!("\"{name}\""))
                .collect();
            let message = format!(
                "{key} = \"{}\": must be {}",
                word.get_ref(),
                names.join(" or ")
            );
            self.error(Some(word.span()), message)
        })
    }

    pub(super) fn error(&self, span: Option<Range<usize>>, message: String) -> Error {
        let place = match span {
            Some(span) => {
                let before = self.text.get(..span.start).unwrap_or(self.text);
                let line = 1 + before.matches('\n').count();
                format!("{}:{line}", self.name)
            }
            None => self.name.to_owned(),
        };
        Error::Input { place, message }
    }

    pub(super) fn missing(&self, table: &str) -> Error {
        self.error(None, format!("missing table {table}"))
    }

    fn checked(&self, key: &str, value: &Number, ok: bool, allowed: &str) -> Result<f64> {
        let number = *value.get_ref();
        if ok {
            Ok(number)
        } else {
            let message = format!("{key} = {number}: must be {allowed}");
            Err(self.error(Some(value.span()), message))
        }
    }

    fn positive(&self, key: &str, value: &Number, unit: &str) -> Result<f64> {
        let number = *value.get_ref();
        let ok = (SMALLEST..=LARGEST).contains(&number);
        self.checked(
            key,
            value,
            ok,
            &format!("from {SMALLEST:e} to {LARGEST:e} {unit}"),
        )
    }

    fn not_negative(&self, key: &str, value: Option<&Number>, unit: &str) -> Result<f64> {
        let Some(value) = value else { return Ok(0.0) };
        let number = *value.get_ref();
        let ok = (0.0..=LARGEST).contains(&number);
        self.checked(key, value, ok, &format!("from 0 to {LARGEST:e} {unit}"))
    }

    fn deviation(
        &self,
        key: &str,
        value: Option<&Number>,
        nominal: f64,
        unit: &str,
    ) -> Result<f64> {
        let Some(value) = value else { return Ok(0.0) };
        let number = *value.get_ref();
        let ok = number.is_finite() && number.abs() <= 0.9 * nominal;
        let allowed = format!("within 90 % of the nominal {nominal} {unit}");
        self.checked(key, value, ok, &allowed)
    }

    pub(super) fn actuator(&self, raw: &RawActuator) -> Result<Actuator> {
        let units = self.units();
        let mass = self.positive("actuator.mass", &raw.mass, units.mass)?;
        let force_constant = self.positive(
            "actuator.force_constant",
            &raw.force_constant,
            units.force_constant,
        )?;
        let current_limit = self.positive("actuator.current_limit", &raw.current_limit, "A")?;
        let current_resolution = match &raw.current_resolution {
            None => 0.0,
            Some(value) => {
                let number = *value.get_ref();
                let ok = number == 0.0 || (SMALLEST..=current_limit).contains(&number);
                let allowed = format!(
                    "0 (continuous) or from {SMALLEST:e} A to the current limit of {current_limit} A"
                );
                self.checked("actuator.current_resolution", value, ok, &allowed)?
            }
        };
        Ok(Actuator {
            mass_deviation: self.deviation(
                "actuator.mass_deviation",
                raw.mass_deviation.as_ref(),
                mass,
                units.mass,
            )?,
            force_constant_deviation: self.deviation(
                "actuator.force_constant_deviation",
                raw.force_constant_deviation.as_ref(),
                force_constant,
                units.force_constant,
            )?,
            mass,
            force_constant,
            current_limit,
            current_resolution,
        })
    }

    pub(super) fn encoder(&self, raw: &RawEncoder) -> Result<Encoder> {
        let resolution = self.positive(
            "encoder.resolution",
            &raw.resolution,
            &format!("{} per count", self.units().position),
        )?;
        let counter_bits = match raw.counter_bits.get_ref() {
            16 => 16,
            32 => 32,
            other => {
                let message = format!("encoder.counter_bits = {other}: must be 16 or 32");
                return Err(self.error(Some(raw.counter_bits.span()), message));
            }
        };
        Ok(Encoder {
            resolution,
            counter_bits,
        })
    }

    pub(super) fn loads(&self, raw: &RawFile) -> Result<Vec<Load>> {
        let count = raw.load.len();
        if !(1..=MAX_LOADS).contains(&count) {
            let span = raw.load.get(MAX_LOADS).map(Spanned::span);
            let message = format!("{count} [[load]] tables: must be 1 to {MAX_LOADS}");
            return Err(self.error(span, message));
        }
        let units = self.units();
        let loads = raw.load.iter().enumerate();
        loads
            .map(|(i, load)| {
                let load = load.get_ref();
                let key = |name: &str| format!("load[{}].{name}", i + 1);
                Ok(Load {
                    mass: self.positive(&key("mass"), &load.mass, units.mass)?,
                    stiffness: self.positive(
                        &key("stiffness"),
                        &load.stiffness,
                        units.stiffness,
                    )?,
                    damping: self.positive(&key("damping"), &load.damping, units.damping)?,
                })
            })
            .collect()
    }

    pub(super) fn control(&self, raw: &RawControl) -> Result<Control> {
        let value = *raw.sample_time.get_ref();
        let ok = (1e-6..=1.0).contains(&value);
        let sample_time = self.checked(
            "control.sample_time",
            &raw.sample_time,
            ok,
            "from 1e-6 to 1 s",
        )?;
        let nyquist = std::f64::consts::PI / sample_time;
        let cutoff = |key: &str, value: &Number| {
            let ok = (SMALLEST..nyquist).contains(value.get_ref());
            let allowed = format!("above 0 and below pi / sample_time = {nyquist:.4} rad/s");
            self.checked(key, value, ok, &allowed)
        };
        let observer = self.one_of(
            "control.observer",
            &raw.observer,
            &[("anchored", Form::Anchored), ("reaction", Form::Reaction)],
        )?;
        Ok(Control {
            sample_time,
            disturbance_cutoff: cutoff("control.disturbance_cutoff", &raw.disturbance_cutoff)?,
            reaction_force_cutoff: cutoff(
                "control.reaction_force_cutoff",
                &raw.reaction_force_cutoff,
            )?,
            observer,
        })
    }

    /// How the observer is designed; what the file leaves out is the default.
    pub(super) fn observer(
        &self,
        raw: Option<&RawObserver>,
        control: &Control,
    ) -> Result<ObserverSettings> {
        let mut settings = ObserverSettings::default();
        let Some(raw) = raw else { return Ok(settings) };
        if let Some(design) = &raw.design {
            let words = [
                ("kalman", ObserverDesign::Kalman),
                ("poles", ObserverDesign::Poles),
            ];
            settings.design = self.one_of("observer.design", design, &words)?;
            if settings.design == ObserverDesign::Poles && control.observer == Form::Reaction {
                let message = "observer.design = \"poles\": must be \"kalman\" for \
                               control.observer = \"reaction\", whose rigid motion cannot be placed";
                return Err(self.error(Some(design.span()), message.into()));
            }
        }
        settings.disturbance = raw.disturbance.unwrap_or(settings.disturbance);
        if let Some(speed) = &raw.speed {
            let ok = (1.0..=100.0).contains(speed.get_ref());
            settings.speed = self.checked("observer.speed", speed, ok, "from 1 to 100")?;
        }
        if let Some(ratio) = &raw.load_force_ratio {
            settings.load_force_ratio = self.positive("observer.load_force_ratio", ratio, "")?;
        }
        if let Some(rate) = &raw.disturbance_rate {
            settings.disturbance_rate = self.positive("observer.disturbance_rate", rate, "1/s")?;
        }
        Ok(settings)
    }

    /// Friction on the actuator; none where the file has no table.
    pub(super) fn friction(&self, raw: Option<&RawFriction>) -> Result<Friction> {
        let Some(raw) = raw else {
            return Ok(Friction::default());
        };
        let units = self.units();
        let value =
            |key: &str, value: &Option<Number>, unit| self.not_negative(key, value.as_ref(), unit);
        Ok(Friction {
            coulomb: value("friction.coulomb", &raw.coulomb, units.force)?,
            viscous: value("friction.viscous", &raw.viscous, units.damping)?,
        })
    }

    /// The weights, however they are stated.
    pub(super) fn cost(
        &self,
        raw: &Spanned<RawCost>,
        chain: &Chain,
        sample_time: f64,
    ) -> Result<Cost> {
        let cost = raw.get_ref();
        let units = self.units();
        let (per_position, per_velocity) = (units.position_weight, units.velocity_weight);
        let loads = chain.loads();
        let current = self.positive("cost.current", &cost.current, "1/A^2")?;
        let stated = (
            &cost.position,
            &cost.velocity,
            &cost.energy,
            &cost.settling_time,
        );
        let (position, velocity) = match stated {
            (Some(position), Some(velocity), None, None) => (
                self.weights("cost.position", position, loads, per_position, true)?,
                self.weights("cost.velocity", velocity, loads, per_velocity, false)?,
            ),
            (None, None, Some(energy), None) => {
                energy_weights(chain, self.positive("cost.energy", energy, "(1 / J)")?)
            }
            (None, None, None, Some(time)) => {
                let seconds = self.positive("cost.settling_time", time, "s")?;
                settling::weights(chain, current, sample_time, seconds).map_err(|error| {
                    let message = format!("cost.settling_time = {seconds}: {error}");
                    self.error(Some(time.span()), message)
                })?
            }
            _ => {
                let message = "[cost] must have either both position and velocity, or energy \
                               alone, or settling_time alone";
                return Err(self.error(Some(raw.span()), message.into()));
            }
        };
        let terminal = |key: &str, value: &Option<Spanned<Vec<Number>>>, unit: &str| match value {
            None => Ok(vec![0.0; loads + 1]),
            Some(value) => self.weights(key, value, loads, unit, false),
        };
        let terminal = terminal(
            "cost.terminal_position",
            &cost.terminal_position,
            &format!("s {per_position}"),
        )?
        .into_iter()
        .zip(terminal(
            "cost.terminal_velocity",
            &cost.terminal_velocity,
            &format!("s {per_velocity}"),
        )?);
        Ok(Cost {
            current,
            position,
            velocity,
            terminal: terminal.flat_map(|(x, v)| [x, v]).collect(),
        })
    }

    fn weights(
        &self,
        key: &str,
        raw: &Spanned<Vec<Number>>,
        loads: usize,
        unit: &str,
        needed: bool,
    ) -> Result<Vec<f64>> {
        let entries = raw.get_ref();
        if entries.len() != loads + 1 {
            let message = format!(
                "{key} has {} entries: must have {}, one per mass, actuator first",
                entries.len(),
                loads + 1
            );
            return Err(self.error(Some(raw.span()), message));
        }
        let weights = entries.iter().enumerate();
        let weights = weights
            .map(|(i, value)| self.not_negative(&format!("{key}[{i}]"), Some(value), unit))
            .collect::<Result<Vec<_>>>()?;
        if needed && weights.iter().all(|weight| *weight == 0.0) {
            let message = format!("{key}: one entry at least must be greater than zero");
            return Err(self.error(Some(raw.span()), message));
        }
        Ok(weights)
    }

    pub(super) fn motion(&self, raw: &RawMotion) -> Result<Motion> {
        let units = self.units();
        Ok(Motion {
            velocity: self.positive("move.velocity", &raw.velocity, units.velocity)?,
            acceleration: self.positive(
                "move.acceleration",
                &raw.acceleration,
                units.acceleration,
            )?,
            jerk: self.positive("move.jerk", &raw.jerk, units.jerk)?,
        })
    }

    pub(super) fn force(
        &self,
        number: usize,
        raw: &RawForce,
        loads: usize,
    ) -> Result<ExternalForce> {
        let key = |name: &str| format!("force[{number}].{name}");
        let mass = *raw.mass.get_ref();
        let Some(mass) = usize::try_from(mass).ok().filter(|mass| *mass <= loads) else {
            let message = format!("{} = {mass}: must be 0 (actuator) to {loads}", key("mass"));
            return Err(self.error(Some(raw.mass.span()), message));
        };
        let newton = *raw.newton.get_ref();
        let ok = newton.abs() <= LARGEST;
        Ok(ExternalForce {
            mass,
            start: self.not_negative(&key("start"), Some(&raw.start), "s")?,
            duration: self.not_negative(&key("duration"), Some(&raw.duration), "s")?,
            newton: self.checked(
                &key("newton"),
                &raw.newton,
                ok,
                &format!("within {LARGEST:e} {}", self.units().force),
            )?,
        })
    }
}
