//! Collocated PD on the encoder, with or without a shaped reference: what a drive without a load model
//! does.
//!
//! ```text
//! i = k_p (r − x_a) + k_d (dr/dt − v_a)
//! ```
//!
//! The velocity goes through the drive's own filter and the command through its limiter. The
//! reference is a step drawn out into a ramp, one after the other for each part of the shaper.

use super::shaper::Shaper;
use crate::design::Design;
use crate::design::checks::collocated_loop;
use crate::error::{Error, Result};
use crate::linear::eigen::eigenvalues;
use crate::simulate::{Control, ControlOutput};
use arso_core::disturbance::{self, DisturbanceObserver};
use arso_core::encoder::{self, Encoder};
use arso_core::limits::Limits;
use arso_core::{Counts, Current};
use nalgebra::DVector;

/// Gains and reference of a PD law.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// A/m.
    pub position_gain: f64,
    /// A s/m.
    pub velocity_gain: f64,
    /// Duration of each ramp, s.
    pub ramp: f64,
    /// Frequency the shaper is made for, rad/s, and its damping ratio; of no meaning without one.
    pub frequency: f64,
    /// See `frequency`.
    pub damping: f64,
}

/// Damping ratio beyond which a closed loop does not vibrate.
const VIBRATES: f64 = 0.8;

impl Settings {
    /// * `bandwidth`, `damping`: of a rigid drive, rad/s and ratio
    /// * `ramp`: s, one control period at the least
    /// * `tuning`: the shaper's frequency over that of the slowest vibration of the closed loop
    ///
    /// # Errors
    /// [`Error::Design`] when the poles of the closed loop cannot be computed.
    pub fn new(
        design: &Design,
        (bandwidth, damping): (f64, f64),
        ramp: f64,
        tuning: f64,
    ) -> Result<Self> {
        let period = design.drive.control.sample_time;
        let per_acceleration = design.drive.total_mass() / design.chain.force_constant;
        let position_gain = bandwidth * bandwidth * per_acceleration;
        let velocity_gain = 2.0 * damping * bandwidth * per_acceleration;
        let poles = eigenvalues(&collocated_loop(design, position_gain, velocity_gain))?;
        let (frequency, damping) = poles
            .iter()
            .filter(|pole| pole.im > 0.0)
            .map(|pole| pole.ln() / period)
            .map(|pole| (pole.norm(), -pole.re / pole.norm()))
            .filter(|(_, damping)| *damping < VIBRATES)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((bandwidth, VIBRATES));
        Ok(Self {
            position_gain,
            velocity_gain,
            ramp: ramp.max(period),
            frequency: frequency * tuning,
            damping: damping.max(0.0),
        })
    }
}

/// The law.
pub(crate) struct Pd {
    settings: Settings,
    parts: Vec<(f64, f64)>,
    target: f64,
    period: f64,
    limits: Limits,
    encoder: (Encoder, encoder::Memory),
    filter: (DisturbanceObserver, disturbance::Memory),
    samples: u32,
}

impl Pd {
    pub(crate) fn new(design: &Design, settings: Settings, shaper: Shaper, target: f64) -> Self {
        let control = &design.drive.control;
        Self {
            parts: shaper.parts(settings.frequency, settings.damping),
            settings,
            target,
            period: control.sample_time,
            limits: design.limits(),
            encoder: (design.encoder(), encoder::Memory::default()),
            filter: (
                DisturbanceObserver::new(
                    &design.actuator(),
                    control.disturbance_cutoff as f32,
                    control.sample_time as f32,
                ),
                disturbance::Memory::default(),
            ),
            samples: 0,
        }
    }

    /// Reference and its velocity.
    fn reference(&self, time: f64) -> (f64, f64) {
        let (mut position, mut velocity) = (0.0, 0.0);
        for (share, start) in &self.parts {
            let part = share * self.target;
            let done = ((time - start) / self.settings.ramp).clamp(0.0, 1.0);
            position += part * done;
            if done > 0.0 && done < 1.0 {
                velocity += part / self.settings.ramp;
            }
        }
        (position, velocity)
    }
}

impl Control for Pd {
    fn step(&mut self, count: u32, _: &DVector<f64>, applied: f64) -> Result<ControlOutput> {
        let reading = self.encoder.0.step(&mut self.encoder.1, Counts(count));
        let current = Current(applied as f32);
        let seen = self
            .filter
            .0
            .step(&mut self.filter.1, reading.displacement, current);
        // The first sample already sees the first part of the ramp, as a step is seen.
        self.samples += 1;
        let (position, velocity) = self.reference(f64::from(self.samples) * self.period);
        let measured = self.encoder.0.position(reading.place);
        let command = self.settings.position_gain * (position - f64::from(measured.0))
            + self.settings.velocity_gain * (velocity - f64::from(seen.velocity.0));
        let limited = self
            .limits
            .step(Current(command as f32))
            .ok_or_else(|| Error::Simulation("the PD law is no longer finite".into()))?;
        Ok(ControlOutput {
            current: limited.current.0.into(),
            enable: true,
            limited: limited.limited,
            reference: position,
            record: None,
        })
    }
}
