//! All that the core knows of a drive, as plain data.
//!
//! Filled in by a design: as Rust source for the firmware (`firmware/src/gains.rs`), or in memory for
//! the simulation; the core never computes gains. Each part owns its data and its check, beside its
//! equations; here they stand together. [`Settings::check`] refuses what would make the core divide by
//! zero or command nonsense, so that no later period has to. The same type goes over a wire and into
//! a file (serde).

use crate::actuator::Actuator;
use crate::amplifier::Amplifier;
use crate::check::{SettingsError, finite, positive};
use crate::encoder::Encoder;
use crate::friction::FrictionFeedForward;
use crate::limits::Limits;
use crate::observer::StateObserver;
use crate::protection::ProtectionLimits;
use crate::regulator::Regulator;
use crate::standstill::Standstill;
use serde::{Deserialize, Serialize};

/// A drive with `N` load masses and the state observer `O`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings<const N: usize, O> {
    /// Control period `T`, s.
    pub sample_time: f32,
    /// The encoder.
    pub encoder: Encoder,
    /// The actuator as the force observers see it.
    pub actuator: Actuator,
    /// The amplifier, which the firmware asks for current through a converter.
    pub amplifier: Amplifier,
    /// Cutoff `g_dist` of the disturbance observer, rad/s.
    pub disturbance_cutoff: f32,
    /// Cutoff `g_reac` of the reaction-force observer, rad/s.
    pub reaction_force_cutoff: f32,
    /// The state observer.
    pub observer: O,
    /// The constant feedback gain `K`.
    pub regulator: Regulator<N>,
    /// Limits of the command.
    pub limits: Limits,
    /// Mass of actuator and all loads, kg.
    pub total_mass: f32,
    /// Friction that is fed forward.
    pub friction: FrictionFeedForward,
    /// The rule for rest.
    pub standstill: Standstill<N>,
    /// Force by which the motor holds the machine where it stands, positive as a positive current: what
    /// carries the load against gravity, N.
    pub holding_force: f32,
    /// Limits of a running drive.
    pub protection: ProtectionLimits<N>,
}

impl<const N: usize, O: StateObserver<N>> Settings<N, O> {
    /// Refuses settings that cannot be run.
    ///
    /// # Errors
    /// The first of the conditions in [`SettingsError`] that is not met.
    pub fn check(&self) -> Result<(), SettingsError> {
        if N == 0 {
            return Err(SettingsError::NoLoad);
        }
        positive("sample_time", self.sample_time)?;
        positive("disturbance_cutoff", self.disturbance_cutoff)?;
        positive("reaction_force_cutoff", self.reaction_force_cutoff)?;
        self.encoder.check()?;
        self.actuator.check()?;
        self.amplifier.check()?;
        self.limits.check()?;
        positive("total_mass", self.total_mass)?;
        self.friction.check()?;
        self.standstill.check()?;
        finite("holding_force", [&self.holding_force])?;
        self.protection.check()?;
        self.observer.check()?;
        self.regulator.check()
    }
}
