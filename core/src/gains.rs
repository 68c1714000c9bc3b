//! The plain data that a design fills in, and the check that it can be run.
//!
//! A `Gains` value holds all that the core knows of a drive. It is written by the design program
//! as Rust source (`firmware/src/gains.rs`) or built in memory by the simulation; the core never
//! computes gains. [`Gains::check`] refuses what would make the core divide by zero or command
//! nonsense, so that no later step has to.

use crate::disturbance::Actuator;
use crate::limits::Limits;
use crate::observer::Form;
use crate::reference::MotionLimits;
use crate::regulator::Regulator;
use core::fmt;

/// All that the core knows of a drive with `N` load masses and an observer of `S` states.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains<const N: usize, const S: usize> {
    /// Control period `T`, s.
    pub sample_time: f32,
    /// The encoder.
    pub encoder: EncoderGains,
    /// The actuator as the force observers see it.
    pub actuator: Actuator,
    /// Cutoff `g_dist` of the disturbance observer, rad/s.
    pub disturbance_cutoff: f32,
    /// Cutoff `g_reac` of the reaction-force observer, rad/s.
    pub reaction_force_cutoff: f32,
    /// The state observer.
    pub observer: ObserverGains<S>,
    /// The constant feedback gain `K`.
    pub regulator: Regulator<N>,
    /// Limits of the command.
    pub limits: Limits,
    /// Limits of the moves.
    pub motion: MotionLimits,
}

/// The encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderGains {
    /// Distance per count after x4 decoding, m.
    pub resolution: f32,
    /// Width of the counter, 2 to 32 bits.
    pub counter_bits: u32,
}

/// Coefficients of the state observer; [`observer`](crate::observer) has the equations and the
/// order of the states.
#[derive(Clone, Debug, PartialEq)]
pub struct ObserverGains<const S: usize> {
    /// Which states there are and what the input is.
    pub form: Form,
    /// Transition matrix `F` over one period, row by row.
    pub transition: [[f32; S]; S],
    /// Response `g` to the held input: per m/s (anchored) or per A (reaction).
    pub input: [f32; S],
    /// Output row `c`, N per unit of state.
    pub output: [f32; S],
    /// Correction `L`, unit of state per N.
    pub correction: [f32; S],
}

/// Why gains cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GainsError {
    /// The named value must be finite and greater than zero.
    NotPositive(&'static str),
    /// The named value must be finite.
    NotFinite(&'static str),
    /// The named value must be finite and not negative.
    Negative(&'static str),
    /// The counter must be 2 to 32 bits wide.
    CounterBits,
    /// The observer's number of states does not fit its form and the number of loads.
    ObserverStates,
    /// The nominal mass and force constant together with their deviations must be positive.
    Deviation,
    /// There must be at least one load.
    NoLoad,
}

impl fmt::Display for GainsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            GainsError::NotPositive(name) => {
                write!(f, "{name} must be finite and greater than zero")
            }
            GainsError::NotFinite(name) => write!(f, "{name} must be finite"),
            GainsError::Negative(name) => write!(f, "{name} must be finite and not negative"),
            GainsError::CounterBits => f.write_str("the encoder counter must be 2 to 32 bits wide"),
            GainsError::ObserverStates => f.write_str(
                "the observer's number of states must be 2 N + 3 (anchored) or 2 N + 2 (reaction)",
            ),
            GainsError::Deviation => f.write_str(
                "nominal mass and force constant plus their deviations must be positive",
            ),
            GainsError::NoLoad => f.write_str("there must be at least one load"),
        }
    }
}

impl core::error::Error for GainsError {}

impl<const N: usize, const S: usize> Gains<N, S> {
    /// Refuses gains that cannot be run.
    ///
    /// # Errors
    /// The first of the conditions in [`GainsError`] that is not met.
    pub fn check(&self) -> Result<(), GainsError> {
        if N == 0 {
            return Err(GainsError::NoLoad);
        }
        if S != self.observer.form.states(N) {
            return Err(GainsError::ObserverStates);
        }
        for (name, value) in [
            ("sample_time", self.sample_time),
            ("encoder.resolution", self.encoder.resolution),
            ("actuator.mass", self.actuator.mass),
            ("actuator.force_constant", self.actuator.force_constant),
            ("disturbance_cutoff", self.disturbance_cutoff),
            ("reaction_force_cutoff", self.reaction_force_cutoff),
            ("limits.current_limit", self.limits.current_limit),
            ("motion.velocity", self.motion.velocity),
            ("motion.acceleration", self.motion.acceleration),
            ("motion.jerk", self.motion.jerk),
            ("motion.total_mass", self.motion.total_mass),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(GainsError::NotPositive(name));
            }
        }
        let resolution = self.limits.current_resolution;
        if !(resolution.is_finite() && resolution >= 0.0) {
            return Err(GainsError::Negative("limits.current_resolution"));
        }
        if !(2..=32).contains(&self.encoder.counter_bits) {
            return Err(GainsError::CounterBits);
        }
        let actuator = &self.actuator;
        for actual in [actuator.actual_mass(), actuator.actual_force_constant()] {
            if !(actual.is_finite() && actual > 0.0) {
                return Err(GainsError::Deviation);
            }
        }
        let observer = &self.observer;
        let all_finite = |values: &[f32]| values.iter().all(|value| value.is_finite());
        for (name, finite) in [
            (
                "observer.transition",
                observer.transition.iter().all(|row| all_finite(row)),
            ),
            ("observer.input", all_finite(&observer.input)),
            ("observer.output", all_finite(&observer.output)),
            ("observer.correction", all_finite(&observer.correction)),
            ("regulator", self.regulator.is_finite()),
        ] {
            if !finite {
                return Err(GainsError::NotFinite(name));
            }
        }
        Ok(())
    }
}
