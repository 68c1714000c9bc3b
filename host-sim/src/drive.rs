//! The description of a drive, read and checked: `drive.toml` and `plant.toml`.
//!
//! ```text
//! text --schema (TOML)--> document (places, numbers) --machine_tables, design_tables--> Drive, PlantFile
//! ```
//!
//! [`Drive`] is what the controller believes, a [`PlantFile`] has the same schema plus external forces
//! and imperfections: what is really there. A description says what is wanted and knows nothing of how it is designed:
//! weights that follow from a settling time or from energies stand here as they were asked for. Doc
//! comments name the units of a linear drive; [`Kind::units`] has those of a rotary one.

mod design_tables;
mod document;
pub(crate) mod edit;
mod fit;
mod machine_tables;
mod schema;

pub use schema::schema;

use crate::error::{Error, Result};
use crate::machine::{Actuator, Encoder, ExternalForce, Friction, Imperfections, Kind, Load};
use document::{Document, read};
use std::path::Path;

/// The paper's rig.
pub const DEFAULT_DRIVE: &str = include_str!("../drive.toml");

/// How [`DEFAULT_DRIVE`] is named in messages.
pub const DEFAULT_NAME: &str = "embedded drive.toml";

/// The most load masses a drive can have.
pub const MAX_LOADS: usize = 6;

/// Half width of the band around the target in which a mass counts as settled, over the span of the
/// motion: what a settling time means.
pub const SETTLING_BAND: f64 = 0.02;

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
    pub observer: Observer,
}

/// Which state observer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observer {
    /// The load alone, driven by the measured motion of the actuator.
    Anchored,
    /// The whole free chain, driven by the current, eq. (17) as printed.
    Reaction,
}

impl Observer {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Anchored, Self::Reaction];

    /// Its name in drive files and tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Anchored => "anchored",
            Self::Reaction => "reaction",
        }
    }
}

/// How the gain of the state observer is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObserverMethod {
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
    pub design: ObserverMethod,
    /// Whether a disturbance on the actuator (friction) is estimated and compensated.
    pub disturbance: bool,
    /// How many times faster than the regulator the observer is to be: placed so by
    /// [`ObserverMethod::Poles`], checked for both.
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
            design: ObserverMethod::Kalman,
            disturbance: true,
            speed: 2.0,
            load_force_ratio: 9.486_832_980_505_138,
            disturbance_rate: 300.0,
        }
    }
}

/// The performance index (2) as it is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// `R`, 1/A².
    pub current: f64,
    /// `Q`.
    pub weights: Weights,
    /// Diagonal of the terminal weight `H`, read as `½ xᵀ H x`, in the order of the states; for the
    /// gain over the time to go alone.
    pub terminal: Vec<f64>,
}

impl Cost {
    /// What a file without `[cost]` asks for: `R = 1 / i_max²`, all else from the drive.
    ///
    /// * `current_limit`: `i_max`, A
    /// * `loads`: number of load masses
    #[must_use]
    pub fn derived(current_limit: f64, loads: usize) -> Self {
        Self {
            current: current_limit.powi(-2),
            weights: Weights::Derived,
            terminal: vec![0.0; 2 * loads + 2],
        }
    }
}

/// How the weights of the states are stated, or the gain that they would lead to.
#[derive(Clone, Debug, PartialEq)]
pub enum Weights {
    /// Not at all: the gain `K` itself is stated, `i = −Σ k_p,i (x_i − x_ref,i) + k_v,i (v_i − v_ref,i)` over all masses,
    /// absolute positions and velocities, actuator first. No performance index (2) is known then.
    Gain {
        /// `k_p,i`, A/m.
        position: Vec<f64>,
        /// `k_v,i`, A s/m.
        velocity: Vec<f64>,
    },
    /// Diagonals, one entry per mass, actuator first.
    Given {
        /// 1/m².
        position: Vec<f64>,
        /// s²/m².
        velocity: Vec<f64>,
    },
    /// Left to the design, which finds them from the drive itself.
    Derived,
    /// The paper's: potential and kinetic energy, times this, 1/J.
    Energy(f64),
    /// The mildest with which the controlled mass settles in time.
    SettlingTime {
        /// s.
        seconds: f64,
        /// `file:line` of the key, for a time that cannot be kept.
        place: String,
    },
}

/// Limits of planned moves, as far as the file states them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatedMotion {
    /// Of the actuator, m/s.
    pub velocity: Option<f64>,
    /// Of the actuator, m/s².
    pub acceleration: Option<f64>,
    /// Of the actuator, m/s³.
    pub jerk: Option<f64>,
    /// Of each spring, from the actuator outwards, m.
    pub deflection: Option<Vec<f64>>,
    /// Share of the current limit that plans may use.
    pub current_share: Option<f64>,
    /// Bytes of the table of plans.
    pub table: Option<usize>,
    /// How far from its target the actuator may come to rest, m.
    pub settling_tolerance: Option<f64>,
}

/// Limits of a running drive that the file states; the others are the design's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatedProtection {
    /// m per period.
    pub encoder_step: Option<f64>,
    /// m/s.
    pub velocity: Option<f64>,
    /// m.
    pub following_error: Option<f64>,
    /// N.
    pub reaction_force: Option<f64>,
    /// N.
    pub disturbance: Option<f64>,
    /// N.
    pub innovation: Option<f64>,
    /// m.
    pub tracking_error: Option<f64>,
    /// Of every spring, m.
    pub deflection: Option<f64>,
    /// N.
    pub stiction: Option<f64>,
    /// s.
    pub saturation_time: Option<f64>,
    /// A.
    pub continuous_current: Option<f64>,
    /// s.
    pub thermal_time: Option<f64>,
    /// Ends of the travel, m.
    pub travel: Option<[f64; 2]>,
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
    /// Limits of planned moves, as far as the file states them.
    pub motion: StatedMotion,
    /// Limits of a running drive, as far as the file states them.
    pub protection: StatedProtection,
}

/// What is really there: actuator, encoder, loads, friction, forces and imperfections.
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
    /// What no drive reckons with.
    pub imperfections: Imperfections,
    /// The control period that the file was written for, s, where it states one.
    pub sample_time: Option<f64>,
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
            imperfections: Imperfections::default(),
            sample_time: Some(drive.control.sample_time),
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
    /// [`Error::Input`], or [`Error::PlantOnly`] for a table or key of a plant file.
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let (document, raw) = Document::open(text, name)?;
        if let Some((what, span)) = raw.plant_only() {
            return Err(Error::PlantOnly {
                place: document.place(Some(span)),
                what,
            });
        }
        let actuator = document.actuator(&raw.actuator, raw.amplifier.as_ref())?;
        let encoder = document.encoder(&raw.encoder)?;
        let loads = document.loads(&raw)?;
        let friction = document.friction(raw.friction.as_ref())?;
        let control = raw
            .control
            .as_ref()
            .ok_or_else(|| document.missing("[control]"))?;
        let control = document.control(control)?;
        document.delay_of_a_drive(&raw.actuator, control.sample_time)?;
        let observer = document.observer(raw.observer.as_ref(), &control)?;
        let cost = match (&raw.cost, &raw.gain) {
            (Some(cost), None) => document.cost(cost, loads.len())?,
            (None, Some(gain)) => Cost {
                weights: document.gain(gain, loads.len())?,
                ..Cost::derived(actuator.current_limit, loads.len())
            },
            (None, None) => Cost::derived(actuator.current_limit, loads.len()),
            (Some(_), Some(gain)) => {
                let message =
                    "[gain] and [cost] both say what the feedback is to be: leave one of them out";
                return Err(document.error(Some(gain.span()), message.into()));
            }
        };
        let motion = raw
            .motion
            .as_ref()
            .map(|limits| document.motion(limits, loads.len()))
            .transpose()?
            .unwrap_or_default();
        let protection = raw.protection.as_ref();
        let protection = document.protection(protection, encoder.resolution)?;
        Ok(Self {
            kind: document.kind(),
            actuator,
            encoder,
            loads,
            friction,
            control,
            observer,
            cost,
            motion,
            protection,
        })
    }

    /// Viscous friction of actuator and loads against the ground, N s/m.
    #[must_use]
    pub fn viscous(&self) -> f64 {
        self.friction.viscous + self.loads.iter().map(|load| load.viscous).sum::<f64>()
    }

    /// Mass of actuator and loads, kg.
    #[must_use]
    pub fn total_mass(&self) -> f64 {
        self.actuator.actual_mass() + self.loads.iter().map(|load| load.mass).sum::<f64>()
    }
}

impl PlantFile {
    /// Reads a plant file; `[control]`, `[observer]`, `[cost]`, `[gain]` and `[move]` may stand in it and say
    /// nothing but the control period.
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
        let (document, raw) = Document::open(text, name)?;
        let actuator = document.actuator(&raw.actuator, raw.amplifier.as_ref())?;
        let encoder = document.encoder(&raw.encoder)?;
        let loads = document.loads(&raw)?;
        let friction = document.friction(raw.friction.as_ref())?;
        let control = raw.control.as_ref();
        let sample_time = control
            .map(|control| document.sample_time(&control.sample_time))
            .transpose()?;
        let forces = raw.force.iter().enumerate();
        let forces = forces
            .map(|(i, force)| document.force(i + 1, force.get_ref(), loads.len()))
            .collect::<Result<_>>()?;
        Ok(Self {
            kind: document.kind(),
            actuator,
            encoder,
            loads,
            friction,
            forces,
            imperfections: document.imperfections(&raw)?,
            sample_time,
        })
    }
}
