//! Vibration level for people: how much the last load swings against the actuator.
//!
//! The rms of the last load's estimated deflection about its mean, over about a quarter of a
//! second. The square root is micromath's approximation (some 5 % off): fit for a display or
//! a log line, never for control.

use crate::telemetry::Telemetry;
use micromath::F32Ext;

/// Running vibration level.
#[derive(Clone, Copy, Debug)]
pub struct Vibration {
    forgetting: f32,
    mean: f32,
    variance: f32,
}

impl Vibration {
    /// * `sample_time`: time between two records, s, positive
    #[must_use]
    pub fn new(sample_time: f32) -> Self {
        Self {
            forgetting: (sample_time / 0.25).clamp(0.0, 1.0),
            mean: 0.0,
            variance: 0.0,
        }
    }

    /// Takes one record in.
    pub fn update<const N: usize>(&mut self, telemetry: &Telemetry<[f32; N]>) {
        let Some(position) = telemetry.load_position.last() else {
            return;
        };
        let deviation = position - telemetry.position - self.mean;
        if deviation.is_finite() {
            self.mean += self.forgetting * deviation;
            self.variance += self.forgetting * (deviation * deviation - self.variance);
        }
    }

    /// The level, m rms, within some 5 %.
    #[must_use]
    pub fn level(&self) -> f32 {
        F32Ext::sqrt(self.variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sinusoidal deflection of amplitude A has the rms A / √2.
    #[test]
    fn level_of_a_sine_is_its_rms() {
        let mut vibration = Vibration::new(1e-3);
        for k in 0..4000 {
            let swing = 1e-3 * libm::sinf(core::f32::consts::TAU * 12.0 * k as f32 * 1e-3);
            vibration.update(&Telemetry {
                position: 0.7,
                load_position: [0.0, 0.702 + swing],
                ..Telemetry::default()
            });
        }
        // 5 % of the square root, and the ripple of the averaging.
        let relative = vibration.level() / (1e-3 / core::f32::consts::SQRT_2);
        assert!((relative - 1.0).abs() < 0.08, "{relative}");
        vibration.update(&Telemetry {
            load_position: [f32::NAN],
            ..Telemetry::default()
        });
        assert!(vibration.level().is_finite());
    }
}
