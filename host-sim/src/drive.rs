//! The description of a drive: `drive.toml`, read and checked.
//!
//! [`Drive`] is what the controller believes, [`Plant`](crate::plant::Plant) files
//! ([`PlantFile`]) are the same schema plus friction and external forces: what is really there.
//! Every value is checked where it is read; the message names file, line, key, value and what is
//! allowed.

use crate::error::{Error, Result};
use arso_core::observer::Form;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;

/// The paper's rig.
pub const DEFAULT_DRIVE: &str = include_str!("../drive.toml");

/// How [`DEFAULT_DRIVE`] is named in messages.
pub const DEFAULT_NAME: &str = "embedded drive.toml";

/// The most load masses a drive can have.
pub const MAX_LOADS: usize = 6;

/// Actuator and its amplifier.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// `m_an`, kg.
    pub mass: f64,
    /// `k_fn`, N/A.
    pub force_constant: f64,
    /// Identified deviation `Δm`, kg.
    pub mass_deviation: f64,
    /// Identified deviation `Δk_f`, N/A.
    pub force_constant_deviation: f64,
    /// A.
    pub current_limit: f64,
    /// Step of the current output, A; zero for a continuous one.
    pub current_resolution: f64,
}

impl Actuator {
    /// `m_an + Δm`, kg.
    #[must_use]
    pub fn actual_mass(&self) -> f64 {
        self.mass + self.mass_deviation
    }

    /// `k_fn + Δk_f`, N/A.
    #[must_use]
    pub fn actual_force_constant(&self) -> f64 {
        self.force_constant + self.force_constant_deviation
    }
}

/// Encoder of the actuator.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoder {
    /// m per count.
    pub resolution: f64,
    /// 16 or 32.
    pub counter_bits: u32,
}

/// One load mass with the spring and damper towards the actuator.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// kg.
    pub mass: f64,
    /// N/m.
    pub stiffness: f64,
    /// N s/m.
    pub damping: f64,
}

/// Sampling and observers.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// `T`, s.
    pub sample_time: f64,
    /// `g_dist`, rad/s.
    pub disturbance_cutoff: f64,
    /// `g_reac`, rad/s.
    pub reaction_force_cutoff: f64,
    /// Which state observer.
    pub observer: Form,
}

/// Diagonals of the performance index (2), one entry per mass, actuator first.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// `R`, 1/A².
    pub current: f64,
    /// 1/m².
    pub position: Vec<f64>,
    /// s²/m².
    pub velocity: Vec<f64>,
}

impl Cost {
    /// Diagonal of `Q` in the order of the states, `x_a v_a x_1 v_1 …`.
    #[must_use]
    pub fn state_weights(&self) -> Vec<f64> {
        let masses = self.position.iter().zip(&self.velocity);
        masses
            .flat_map(|(position, velocity)| [*position, *velocity])
            .collect()
    }
}

/// Limits of a planned move.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// m/s.
    pub velocity: f64,
    /// m/s².
    pub acceleration: f64,
    /// m/s³.
    pub jerk: f64,
}

/// What the controller believes of a drive, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// The actuator.
    pub actuator: Actuator,
    /// Its encoder.
    pub encoder: Encoder,
    /// The loads, from the actuator outwards.
    pub loads: Vec<Load>,
    /// Sampling and observers.
    pub control: Control,
    /// Weights of the design.
    pub cost: Cost,
    /// Limits of planned moves; `None` when the file leaves them to the design.
    pub motion: Option<Motion>,
}

/// Friction on the actuator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Friction {
    /// N.
    pub coulomb: f64,
    /// N s/m.
    pub viscous: f64,
}

/// A force on one mass for some time.
#[derive(Clone, Debug, PartialEq)]
pub struct ExternalForce {
    /// 0 for the actuator, 1 for the first load, ….
    pub mass: usize,
    /// s.
    pub start: f64,
    /// s.
    pub duration: f64,
    /// N.
    pub newton: f64,
}

/// What is really there: actuator, encoder, loads, friction and forces.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantFile {
    /// The actuator as it is.
    pub actuator: Actuator,
    /// The encoder as it is.
    pub encoder: Encoder,
    /// The loads as they are.
    pub loads: Vec<Load>,
    /// Friction on the actuator.
    pub friction: Friction,
    /// Forces from outside.
    pub forces: Vec<ExternalForce>,
}

/// The drive as the controller believes it, without friction.
impl From<&Drive> for PlantFile {
    fn from(drive: &Drive) -> Self {
        Self {
            actuator: drive.actuator.clone(),
            encoder: drive.encoder.clone(),
            loads: drive.loads.clone(),
            friction: Friction::default(),
            forces: Vec::new(),
        }
    }
}

impl Drive {
    /// The embedded default drive.
    ///
    /// # Panics
    /// Never: a test reads the file.
    #[must_use]
    pub fn default_drive() -> Self {
        Self::parse(DEFAULT_DRIVE, DEFAULT_NAME).expect("the embedded drive is valid")
    }

    /// Reads a drive file, or the embedded default where none is given.
    ///
    /// # Errors
    /// [`Error::Read`] or [`Error::Input`].
    pub fn load(path: Option<&Path>) -> Result<Self> {
        match path {
            None => Self::parse(DEFAULT_DRIVE, DEFAULT_NAME),
            Some(path) => Self::parse(&read(path)?, &path.display().to_string()),
        }
    }

    /// * `text`: TOML
    /// * `name`: of the file, for messages
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let source = Source { text, name };
        let raw: RawFile = source.parse()?;
        if let Some(friction) = &raw.friction {
            let message = "[friction] belongs into a plant file (simulate --plant)";
            return Err(source.error(Some(friction.span()), message.into()));
        }
        if let Some(force) = raw.force.first() {
            let message = "[[force]] belongs into a plant file (simulate --plant)";
            return Err(source.error(Some(force.span()), message.into()));
        }
        let actuator = source.actuator(&raw.actuator)?;
        let encoder = source.encoder(&raw.encoder)?;
        let loads = source.loads(&raw)?;
        let control = raw
            .control
            .as_ref()
            .ok_or_else(|| source.missing("[control]"))?;
        let control = source.control(control)?;
        let cost = raw.cost.as_ref().ok_or_else(|| source.missing("[cost]"))?;
        let cost = source.cost(cost, &actuator, &loads)?;
        let motion = raw.motion.as_ref().map(|m| source.motion(m)).transpose()?;
        Ok(Self {
            actuator,
            encoder,
            loads,
            control,
            cost,
            motion,
        })
    }

    /// Mass of actuator and loads, kg.
    #[must_use]
    pub fn total_mass(&self) -> f64 {
        self.actuator.actual_mass() + self.loads.iter().map(|load| load.mass).sum::<f64>()
    }
}

impl PlantFile {
    /// Reads a plant file; `[control]`, `[cost]` and `[move]` may stand in it and say nothing.
    ///
    /// # Errors
    /// [`Error::Read`] or [`Error::Input`].
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&read(path)?, &path.display().to_string())
    }

    /// * `text`: TOML
    /// * `name`: of the file, for messages
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let source = Source { text, name };
        let raw: RawFile = source.parse()?;
        let actuator = source.actuator(&raw.actuator)?;
        let encoder = source.encoder(&raw.encoder)?;
        let loads = source.loads(&raw)?;
        let friction = match &raw.friction {
            None => Friction::default(),
            Some(friction) => Friction {
                coulomb: source.not_negative(
                    "friction.coulomb",
                    friction.get_ref().coulomb.as_ref(),
                    "N",
                )?,
                viscous: source.not_negative(
                    "friction.viscous",
                    friction.get_ref().viscous.as_ref(),
                    "N s/m",
                )?,
            },
        };
        let forces = raw.force.iter().enumerate();
        let forces = forces
            .map(|(i, force)| source.force(i + 1, force.get_ref(), loads.len()))
            .collect::<Result<_>>()?;
        Ok(Self {
            actuator,
            encoder,
            loads,
            friction,
            forces,
        })
    }
}

/// The paper's weights: each mass weighs in with the stiffness attached to it and with its mass,
/// so that the index counts potential and kinetic energy, times `scale`.
fn energy_weights(actuator: &Actuator, loads: &[Load], scale: f64, current: f64) -> Cost {
    let masses = std::iter::once(actuator.actual_mass()).chain(loads.iter().map(|l| l.mass));
    let stiffness = |element: usize| {
        let inner = element
            .checked_sub(1)
            .map_or(0.0, |spring| loads[spring].stiffness);
        inner + loads.get(element).map_or(0.0, |load| load.stiffness)
    };
    Cost {
        current,
        position: (0..=loads.len())
            .map(|element| scale * stiffness(element))
            .collect(),
        velocity: masses.map(|mass| scale * mass).collect(),
    }
}

fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|source| Error::Read {
        path: path.to_owned(),
        source,
    })
}

/// The file as TOML has it, before any value is looked at.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    actuator: RawActuator,
    encoder: RawEncoder,
    #[serde(default)]
    load: Vec<Spanned<RawLoad>>,
    control: Option<RawControl>,
    cost: Option<Spanned<RawCost>>,
    #[serde(rename = "move")]
    motion: Option<RawMotion>,
    friction: Option<Spanned<RawFriction>>,
    #[serde(default)]
    force: Vec<Spanned<RawForce>>,
}

type Number = Spanned<f64>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawActuator {
    mass: Number,
    force_constant: Number,
    current_limit: Number,
    current_resolution: Option<Number>,
    mass_deviation: Option<Number>,
    force_constant_deviation: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawEncoder {
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
struct RawControl {
    sample_time: Number,
    disturbance_cutoff: Number,
    reaction_force_cutoff: Number,
    observer: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCost {
    current: Number,
    position: Option<Spanned<Vec<Number>>>,
    velocity: Option<Spanned<Vec<Number>>>,
    energy: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMotion {
    velocity: Number,
    acceleration: Number,
    jerk: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFriction {
    coulomb: Option<Number>,
    viscous: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawForce {
    mass: Spanned<i64>,
    start: Number,
    duration: Number,
    newton: Number,
}

/// Numbers beyond this are slips of the pen; within it nothing overflows in the design.
const LARGEST: f64 = 1e9;
const SMALLEST: f64 = 1e-9;

/// A file's text and name: turns spans into places.
struct Source<'a> {
    text: &'a str,
    name: &'a str,
}

impl Source<'_> {
    fn parse<T: serde::de::DeserializeOwned>(&self) -> Result<T> {
        toml::from_str(self.text).map_err(|error| {
            let message = error.message().trim().replace('\n', "; ");
            self.error(error.span(), message)
        })
    }

    fn error(&self, span: Option<Range<usize>>, message: String) -> Error {
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

    fn missing(&self, table: &str) -> Error {
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

    fn actuator(&self, raw: &RawActuator) -> Result<Actuator> {
        let mass = self.positive("actuator.mass", &raw.mass, "kg")?;
        let force_constant =
            self.positive("actuator.force_constant", &raw.force_constant, "N/A")?;
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
                "kg",
            )?,
            force_constant_deviation: self.deviation(
                "actuator.force_constant_deviation",
                raw.force_constant_deviation.as_ref(),
                force_constant,
                "N/A",
            )?,
            mass,
            force_constant,
            current_limit,
            current_resolution,
        })
    }

    fn encoder(&self, raw: &RawEncoder) -> Result<Encoder> {
        let resolution = self.positive("encoder.resolution", &raw.resolution, "m per count")?;
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

    fn loads(&self, raw: &RawFile) -> Result<Vec<Load>> {
        let count = raw.load.len();
        if !(1..=MAX_LOADS).contains(&count) {
            let span = raw.load.get(MAX_LOADS).map(Spanned::span);
            let message = format!("{count} [[load]] tables: must be 1 to {MAX_LOADS}");
            return Err(self.error(span, message));
        }
        let loads = raw.load.iter().enumerate();
        loads
            .map(|(i, load)| {
                let load = load.get_ref();
                let key = |name: &str| format!("load[{}].{name}", i + 1);
                Ok(Load {
                    mass: self.positive(&key("mass"), &load.mass, "kg")?,
                    stiffness: self.positive(&key("stiffness"), &load.stiffness, "N/m")?,
                    damping: self.positive(&key("damping"), &load.damping, "N s/m")?,
                })
            })
            .collect()
    }

    fn control(&self, raw: &RawControl) -> Result<Control> {
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
        let observer = match raw.observer.get_ref().as_str() {
            "anchored" => Form::Anchored,
            "reaction" => Form::Reaction,
            other => {
                let message =
                    format!("control.observer = \"{other}\": must be \"anchored\" or \"reaction\"");
                return Err(self.error(Some(raw.observer.span()), message));
            }
        };
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

    fn cost(&self, raw: &Spanned<RawCost>, actuator: &Actuator, loads: &[Load]) -> Result<Cost> {
        let cost = raw.get_ref();
        let current = self.positive("cost.current", &cost.current, "1/A^2")?;
        match (&cost.position, &cost.velocity, &cost.energy) {
            (Some(position), Some(velocity), None) => Ok(Cost {
                current,
                position: self.weights("cost.position", position, loads.len(), "1/m^2", true)?,
                velocity: self.weights("cost.velocity", velocity, loads.len(), "s^2/m^2", false)?,
            }),
            (None, None, Some(energy)) => {
                let scale = self.positive("cost.energy", energy, "(1 / J)")?;
                Ok(energy_weights(actuator, loads, scale, current))
            }
            _ => {
                let message = "[cost] must have either both position and velocity, or energy alone";
                Err(self.error(Some(raw.span()), message.into()))
            }
        }
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

    fn motion(&self, raw: &RawMotion) -> Result<Motion> {
        Ok(Motion {
            velocity: self.positive("move.velocity", &raw.velocity, "m/s")?,
            acceleration: self.positive("move.acceleration", &raw.acceleration, "m/s^2")?,
            jerk: self.positive("move.jerk", &raw.jerk, "m/s^3")?,
        })
    }

    fn force(&self, number: usize, raw: &RawForce, loads: usize) -> Result<ExternalForce> {
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
                &format!("within {LARGEST:e} N"),
            )?,
        })
    }
}
