//! Limits of a running drive, from what the drive file states and, where it does not, from drive and gains.
//!
//! What a healthy drive does in its moves, with springs and loads 30 % off and some kicks, must stay
//! within them; what a dead encoder or amplifier makes it do must not, for long. `F` is the motor's force
//! at the current limit, `M` the mass of all, `v` the velocity of moves:
//!
//! | limit | where not stated |
//! |---|---|
//! | `encoder_step` | 12 counts, and over `T²/m_a`: 35 % of `F`, friction turning round, the first spring at twice the velocity limit |
//! | `velocity` | 1.25 `v`, and half of what `F` gives `M` by itself |
//! | `following_error` | what that makes in one period of the slowest mode |
//! | `reaction_force` | 2 `F` |
//! | `disturbance` | 15 % of `F`, and three times the declared Coulomb friction |
//! | `innovation` | 15 % of `F` |
//! | `tracking_error` | what a kick makes, friction, and the settling tolerance |
//! | `deflection` | 2 `F` over the spring's stiffness |
//! | `stiction` | 3 % of `F`, and 1.5 times the declared Coulomb friction |
//! | `saturation_time` | 0.25 s, or four times what the motor needs to bring `M` to the velocity limit |
//! | `continuous_current` | 70 % of the current limit |
//! | `thermal_time` | 10 s |
//! | `travel` | none |
//!
//! In a move the three before `deflection` may be larger by shares of the plan's force, as much as machines near
//! the description need: [`Healthy`] finds out.

mod healthy;

use super::Design;
use arso_core::Place;
use arso_core::protection::{ModelError, ProtectionLimits};
use arso_core::units::Travel;
pub use healthy::Healthy;
use serde::Serialize;

/// The limits in `f64`, SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Protection {
    /// Change of the actuator's motion that the current does not explain, m per period.
    pub encoder_step: f64,
    /// m/s.
    pub velocity: f64,
    /// m.
    pub following_error: f64,
    /// N.
    pub reaction_force: f64,
    /// N.
    pub disturbance: f64,
    /// N.
    pub innovation: f64,
    /// m.
    pub tracking_error: f64,
    /// By how much the three before may be larger in a move, over the plan's force: 1, 1, m/N.
    pub model_error: [f64; 3],
    /// Period of the slowest mode, in which the force of a plan is forgotten by `1/e`, in control periods.
    pub slowest: f64,
    /// Of each spring, m.
    pub deflection: Vec<f64>,
    /// N.
    pub stiction: f64,
    /// s.
    pub saturation_time: f64,
    /// A.
    pub continuous_current: f64,
    /// s.
    pub thermal_time: f64,
    /// Ends of the travel, m.
    pub travel: Option<[f64; 2]>,
}

/// Shares and factors of the table above.
const COUNTS: f64 = 12.0;
const CURRENT_ERROR: f64 = 0.35;
const FASTER: f64 = 1.25;
const DISTURBANCE: (f64, f64) = (0.15, 3.0);
const INNOVATION: f64 = 0.15;
const FORCE: f64 = 2.0;
const STICTION: (f64, f64) = (0.03, 1.5);
const SATURATION: (f64, f64) = (0.25, 4.0);
const CONTINUOUS: f64 = 0.7;
const THERMAL_TIME: f64 = 10.0;

/// Fastest that the actuator may be, m/s.
fn velocity(design: &Design) -> f64 {
    let motion = &design.motion;
    let stated = design.drive.protection.velocity;
    stated.unwrap_or((FASTER * motion.velocity).max(0.5 * motion.natural_velocity))
}

/// A share of the motor's force, or so many times the declared friction where that is more, N.
fn share_of((of_force, of_friction): (f64, f64), force: f64, coulomb: f64) -> f64 {
    (of_force * force).max(of_friction * coulomb)
}

/// Disturbance and innovation at rest, N.
fn forces(design: &Design) -> [f64; 2] {
    let drive = &design.drive;
    let force = design.chain.force_constant * drive.actuator.current_limit;
    let stated = &drive.protection;
    let disturbance = share_of(DISTURBANCE, force, drive.friction.coulomb);
    [
        stated.disturbance.unwrap_or(disturbance),
        stated.innovation.unwrap_or(INNOVATION * force),
    ]
}

impl Protection {
    /// The limits of a design.
    ///
    /// * `healthy`: what is known of machines near the description
    #[must_use]
    pub fn new(design: &Design, healthy: &Healthy) -> Self {
        let (drive, chain) = (&design.drive, &design.chain);
        let stated = &drive.protection;
        let period = drive.control.sample_time;
        let force = chain.force_constant * drive.actuator.current_limit;
        let coulomb = drive.friction.coulomb;
        let slowest = design.modes().first().map_or(1.0, |mode| mode.frequency_hz);
        let velocity = velocity(design);
        let spring = 2.0 * velocity * period * chain.stiffness[0];
        let encoder_step = COUNTS * drive.encoder.resolution
            + (CURRENT_ERROR * force + 2.0 * coulomb + spring) * period * period / chain.mass[0];
        let share = |share| share_of(share, force, coulomb);
        let [disturbance, innovation] = forces(design);
        let reaction_force = stated.reaction_force.unwrap_or(FORCE * force);
        let deflection = chain.stiffness.iter().map(|k| FORCE * force / k);
        Self {
            encoder_step: stated.encoder_step.unwrap_or(encoder_step),
            velocity,
            following_error: stated.following_error.unwrap_or(velocity / slowest),
            reaction_force,
            disturbance,
            innovation,
            tracking_error: stated.tracking_error.unwrap_or(healthy.tracking_error),
            model_error: healthy.model_error,
            slowest: 1.0 / (slowest * period),
            deflection: match stated.deflection {
                Some(stated) => vec![stated; chain.loads()],
                None => deflection.collect(),
            },
            stiction: stated.stiction.unwrap_or(share(STICTION)),
            saturation_time: stated.saturation_time.unwrap_or(
                SATURATION
                    .0
                    .max(SATURATION.1 * drive.total_mass() * velocity / force),
            ),
            continuous_current: stated
                .continuous_current
                .unwrap_or(CONTINUOUS * drive.actuator.current_limit),
            thermal_time: stated.thermal_time.unwrap_or(THERMAL_TIME),
            travel: stated.travel,
        }
    }

    /// As the core takes them.
    ///
    /// * `resolution`: of the encoder, m
    pub(super) fn limits<const N: usize>(&self, resolution: f64) -> ProtectionLimits<N> {
        // Whole counts inside.
        let travel = self.travel.map(|[lowest, highest]| Travel {
            lowest: Place((lowest / resolution).ceil() as i64),
            highest: Place((highest / resolution).floor() as i64),
        });
        ProtectionLimits {
            encoder_step: self.encoder_step as f32,
            velocity: self.velocity as f32,
            following_error: self.following_error as f32,
            reaction_force: self.reaction_force as f32,
            disturbance: self.disturbance as f32,
            innovation: self.innovation as f32,
            tracking_error: self.tracking_error as f32,
            model_error: ModelError {
                disturbance: self.model_error[0] as f32,
                innovation: self.model_error[1] as f32,
                tracking_error: self.model_error[2] as f32,
                remembered: (-1.0 / self.slowest).exp() as f32,
            },
            deflection: std::array::from_fn(|spring| {
                let limit = self.deflection.get(spring);
                limit.map_or(f32::NAN, |limit| *limit as f32)
            }),
            stiction: self.stiction as f32,
            saturation_time: self.saturation_time as f32,
            continuous_current: self.continuous_current as f32,
            thermal_time: self.thermal_time as f32,
            travel,
        }
    }
}
