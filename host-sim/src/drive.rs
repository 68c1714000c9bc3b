//! The description of a drive: `drive.toml`, read and checked.
//!
//! [`Drive`] is what the controller believes, [`Plant`](crate::plant::Plant) files
//! ([`PlantFile`]) are the same schema plus external forces: what is really there. `file` reads and
//! checks both. Doc comments name the units of a linear drive; [`Kind::units`] has those of a rotary
//! one.

mod file;
mod kind;

use crate::error::Result;
use crate::model::Chain;
use arso_core::observer::Form;
use file::{Source, read};
use std::path::Path;

pub use kind::{Kind, Units};

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

/// How the gain of the state observer is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObserverDesign {
    /// Steady-state Kalman filter.
    Kalman,
    /// Poles placed: each decays `speed` times as fast as the slowest pole of the regulator, or as
    /// it does by itself where that is faster.
    Poles,
}

/// How the state observer is designed.
#[derive(Clone, Debug, PartialEq)]
pub struct ObserverSettings {
    /// By which method.
    pub design: ObserverDesign,
    /// Whether a disturbance on the actuator (friction) is estimated and compensated.
    pub disturbance: bool,
    /// How many times faster than the regulator the observer is to be: placed so by
    /// [`ObserverDesign::Poles`], checked for both.
    pub speed: f64,
    /// Kalman: density of a random force on each load over that of the measurement noise.
    pub load_force_ratio: f64,
    /// Kalman: random walk of the disturbance over the measurement noise, 1/s.
    pub disturbance_rate: f64,
}

impl Default for ObserverSettings {
    /// Kalman weights of 0.3 N/√Hz on each load and 0.3 N per sample on the disturbance against a
    /// measurement noise of 1 N per sample at 1 ms, written as ratios that do not depend on the
    /// sample time; "at least twice faster than the control system", as the paper asks.
    fn default() -> Self {
        Self {
            design: ObserverDesign::Kalman,
            disturbance: true,
            speed: 2.0,
            load_force_ratio: 9.486_832_980_505_138,
            disturbance_rate: 300.0,
        }
    }
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
    /// Diagonal of the terminal weight `H`, read as `½ xᵀ H x`, in the order of the states; for the
    /// gain over the time to go alone.
    pub terminal: Vec<f64>,
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
    /// Linear or rotary.
    pub kind: Kind,
    /// The actuator.
    pub actuator: Actuator,
    /// Its encoder.
    pub encoder: Encoder,
    /// The loads, from the actuator outwards.
    pub loads: Vec<Load>,
    /// Friction on the actuator.
    pub friction: Friction,
    /// Sampling and observers.
    pub control: Control,
    /// How the state observer is designed.
    pub observer: ObserverSettings,
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
    /// Linear or rotary.
    pub kind: Kind,
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

/// The drive as the controller believes it.
impl From<&Drive> for PlantFile {
    fn from(drive: &Drive) -> Self {
        Self {
            kind: drive.kind,
            actuator: drive.actuator.clone(),
            encoder: drive.encoder.clone(),
            loads: drive.loads.clone(),
            friction: drive.friction.clone(),
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
    /// [`Error::Read`](crate::error::Error::Read) or [`Error::Input`](crate::error::Error::Input).
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
    /// [`Error::Input`](crate::error::Error::Input).
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let (source, raw) = Source::open(text, name)?;
        if let Some(force) = raw.force.first() {
            let message = "[[force]] belongs into a plant file (simulate --plant)";
            return Err(source.error(Some(force.span()), message.into()));
        }
        let actuator = source.actuator(&raw.actuator)?;
        let encoder = source.encoder(&raw.encoder)?;
        let loads = source.loads(&raw)?;
        let friction = source.friction(raw.friction.as_ref())?;
        let control = raw
            .control
            .as_ref()
            .ok_or_else(|| source.missing("[control]"))?;
        let control = source.control(control)?;
        let observer = source.observer(raw.observer.as_ref(), &control)?;
        let cost = raw.cost.as_ref().ok_or_else(|| source.missing("[cost]"))?;
        let chain = Chain::new(&actuator, &loads, friction.viscous);
        let cost = source.cost(cost, &chain, control.sample_time)?;
        let motion = raw.motion.as_ref().map(|m| source.motion(m)).transpose()?;
        Ok(Self {
            kind: source.kind(),
            actuator,
            encoder,
            loads,
            friction,
            control,
            observer,
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
    /// Reads a plant file; `[control]`, `[observer]`, `[cost]` and `[move]` may stand in it and say
    /// nothing.
    ///
    /// # Errors
    /// [`Error::Read`](crate::error::Error::Read) or [`Error::Input`](crate::error::Error::Input).
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&read(path)?, &path.display().to_string())
    }

    /// * `text`: TOML
    /// * `name`: of the file, for messages
    ///
    /// # Errors
    /// [`Error::Input`](crate::error::Error::Input).
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let (source, raw) = Source::open(text, name)?;
        let actuator = source.actuator(&raw.actuator)?;
        let encoder = source.encoder(&raw.encoder)?;
        let loads = source.loads(&raw)?;
        let friction = source.friction(raw.friction.as_ref())?;
        let forces = raw.force.iter().enumerate();
        let forces = forces
            .map(|(i, force)| source.force(i + 1, force.get_ref(), loads.len()))
            .collect::<Result<_>>()?;
        Ok(Self {
            kind: source.kind(),
            actuator,
            encoder,
            loads,
            friction,
            forces,
        })
    }
}
