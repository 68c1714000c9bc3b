//! Collocated PD on the encoder: what a drive without a load model does, with what such drives add to it.
//!
//! ```text
//! i = i_ff + N (k_p (r − x_a) + k_d (dr/dt − v_a)) + d_hat / k_f
//! ```
//!
//! The velocity goes through the drive's own filter and the command through its limiter. Reference and
//! feed-forward come from a [`Guide`]: a shaped step, or the planned move of the drive. `N` is a
//! notch and `d_hat` the disturbance of eq. (19) with a mass and a cutoff of its own; each is one where it is
//! used, and otherwise there is none.

use super::guide::Guide;
use super::notch::{self, Notch};
use crate::design::Design;
use crate::error::{Error, Result};
use crate::simulate::{Control, ControlOutput};
use arso_core::actuator::Actuator;
use arso_core::disturbance::{self, DisturbanceObserver};
use arso_core::encoder::{self, Encoder};
use arso_core::limits::Limiter;
use arso_core::{Counts, Current};
use nalgebra::DVector;

/// Gains and reference of a PD law.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// A/m.
    pub position_gain: f64,
    /// A s/m.
    pub velocity_gain: f64,
    /// What the step is made of; none for the step as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<ReferenceSettings>,
    /// Filter of the command.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub notch: Option<notch::Settings>,
    /// Disturbance that is compensated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub disturbance: Option<DisturbanceSettings>,
}

/// A shaped reference.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ReferenceSettings {
    /// Duration of each ramp, s; one control period at the least.
    pub ramp: f64,
    /// Frequency that the shaper is made for, rad/s.
    pub frequency: f64,
    /// Damping ratio that it is made for.
    pub damping: f64,
}

/// A disturbance observer beside a PD law.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct DisturbanceSettings {
    /// rad/s.
    pub cutoff: f64,
    /// Mass that it takes the drive for, kg.
    pub mass: f64,
}

impl Settings {
    /// Gains that give a rigid drive of mass `M` a bandwidth and a damping ratio,
    /// `k_p = ω² M / k_f` and `k_d = 2 ζ ω M / k_f`, without anything beside them.
    ///
    /// * `bandwidth`: `ω`, rad/s
    /// * `damping`: `ζ`
    #[must_use]
    pub fn new(design: &Design, bandwidth: f64, damping: f64) -> Self {
        let per_acceleration = design.drive.total_mass() / design.chain.force_constant;
        Self {
            position_gain: bandwidth * bandwidth * per_acceleration,
            velocity_gain: 2.0 * damping * bandwidth * per_acceleration,
            reference: None,
            notch: None,
            disturbance: None,
        }
    }
}

/// The law.
pub(crate) struct Pd<'d> {
    settings: Settings,
    guide: Guide<'d>,
    limiter: Limiter,
    encoder: (Encoder, encoder::Memory),
    filter: (DisturbanceObserver, disturbance::Memory),
    notch: Option<Notch>,
    disturbance: Option<(DisturbanceObserver, disturbance::Memory)>,
    /// N/A.
    force_constant: f64,
    /// Of the current that is applied now, what was fed forward, A.
    fed: f64,
}

impl<'d> Pd<'d> {
    pub(super) fn new(design: &Design, settings: Settings, guide: Guide<'d>) -> Self {
        let control = &design.drive.control;
        let observer = |actuator: &Actuator, cutoff: f64| {
            let period = control.sample_time as f32;
            let observer = DisturbanceObserver::new(actuator, cutoff as f32, period);
            (observer, disturbance::Memory::default())
        };
        let actuator = design.actuator();
        Self {
            settings,
            guide,
            limiter: design.limits().limiter(),
            encoder: (design.encoder(), encoder::Memory::default()),
            filter: observer(&actuator, control.disturbance_cutoff),
            notch: settings
                .notch
                .map(|notch| Notch::new(&notch, control.sample_time)),
            disturbance: settings.disturbance.map(|disturbance| {
                let mass = disturbance.mass as f32;
                observer(&Actuator { mass, ..actuator }, disturbance.cutoff)
            }),
            force_constant: design.chain.force_constant,
            fed: 0.0,
        }
    }
}

impl Control for Pd<'_> {
    fn step(&mut self, count: u32, _: &DVector<f64>, applied: f64) -> Result<ControlOutput> {
        let reading = self.encoder.0.step(&mut self.encoder.1, Counts(count));
        let led = self.guide.step()?;
        let displacement = reading.displacement - led.displacement as f32;
        let current = Current((applied - self.fed) as f32);
        let seen = self
            .filter
            .0
            .step(&mut self.filter.1, displacement, current);
        let measured = self.encoder.0.position(reading.place);
        let mut command = self.settings.position_gain * (led.state[0] - f64::from(measured.0))
            + self.settings.velocity_gain * (led.velocity - f64::from(seen.velocity.0));
        if let Some(notch) = &mut self.notch {
            command = notch.step(command);
        }
        if let Some((observer, memory)) = &mut self.disturbance {
            let seen = observer.step(memory, displacement, current);
            command += f64::from(seen.force.0) / self.force_constant;
        }
        self.fed = led.feed_forward + led.friction;
        let limited = self
            .limiter
            .step(Current((command + self.fed) as f32))
            .ok_or_else(|| Error::Simulation("the PD law is no longer finite".into()))?;
        Ok(ControlOutput {
            current: limited.current.0.into(),
            enable: true,
            limited: limited.limited,
            reference: Some(led.state[0]),
        })
    }
}
