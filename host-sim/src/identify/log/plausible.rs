//! Whether a motion is one that a machine can make.

use super::clock::median;
use crate::drive::Drive;
use crate::machine::motion::PARTS;

/// How much a machine can accelerate its actuator.
pub(super) struct Plausible {
    /// Counts per period, in a period, by the motor.
    acceleration: f64,
}

/// By how many times the motor's acceleration: masses are known roughly, and springs push too.
const FORCES: f64 = 6.0;
/// Or by how many times the acceleration that is usual in the record.
const USUAL: f64 = 30.0;
/// Counts by which rounding may change the motion between two periods, and as much again.
const ROUNDING: f64 = 4.0;
/// Share of the velocity that jitter of the rows may feign.
const JITTER: f64 = 0.3;

impl Plausible {
    /// For a drive whose record has this period.
    pub(super) fn new(drive: &Drive, period: f64) -> Self {
        let actuator = &drive.actuator;
        let force = actuator.largest_force() + drive.friction.coulomb;
        let acceleration = force / actuator.actual_mass();
        Self {
            acceleration: acceleration * period * period / drive.encoder.resolution,
        }
    }

    /// The first interval whose motion does not follow from the one before: counts per interval, and the
    /// lengths of these.
    pub(super) fn outlier(&self, steps: &[f64], parts: &[u32]) -> Option<usize> {
        let length = |k: usize| f64::from(parts[k]) / f64::from(PARTS);
        let speed = |k: usize| steps[k] / length(k);
        let change = |k: usize| speed(k) - speed(k - 1);
        let between = |k: usize| 0.5 * (length(k) + length(k - 1));
        let changes = (1..steps.len()).map(|k| (change(k) / between(k)).abs());
        let usual = median(&changes.collect::<Vec<_>>());
        let most = (FORCES * self.acceleration).max(USUAL * usual);
        let k = (1..steps.len()).find(|k| {
            let shorter = length(*k).min(length(k - 1));
            let slower = speed(*k).abs().min(speed(k - 1).abs());
            let allowed = most * between(*k) + ROUNDING / shorter + JITTER * slower;
            change(*k).abs() > allowed
        })?;
        // The first reading of all may be the wrong one.
        Some(if k == 1 && speed(0).abs() > speed(1).abs() {
            0
        } else {
            k
        })
    }
}

/// From the least to the greatest.
pub(super) fn span(values: &[f64]) -> f64 {
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(*x), h.max(*x))
        });
    high - low
}
