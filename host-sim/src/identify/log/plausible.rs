//! Whether a motion is one that a machine can make, and what was the matter where it is not.

use super::counter::usual;
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
        let usual = usual((1..steps.len()).map(|k| change(k) / between(k)));
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

    /// What most likely makes a motion jump in an interval.
    pub(super) fn cause(&self, counts: &[f64], steps: &[f64], parts: &[u32], k: usize) -> String {
        let length = |k: usize| f64::from(parts[k]) / f64::from(PARTS);
        let speed = |k: usize| steps[k] / length(k);
        let before = k.checked_sub(1).map_or(0.0, speed);
        let jump = steps[k] - before * length(k);
        if let Some(next) = steps.get(k + 1) {
            let back = next - before * length(k + 1);
            if (jump + back).abs() < 0.25 * jump.abs() {
                return "one wrong reading, as electrical noise makes it; check wiring and shielding, or take the \
                        row out"
                    .into();
            }
        }
        let span = span(counts);
        // Where the counter wraps its steps are small.
        let restarts = counts.windows(2).zip(steps).filter(|(pair, step)| {
            (pair[1] - pair[0]).abs() > 0.75 * span && step.abs() > 0.1 * span
        });
        if restarts.count() > 1 {
            return format!(
                "it seems to start again every {:.0} counts or so, which is no counter of 2 to 32 bits: unwrap the \
                 column first",
                span + 1.0
            );
        }
        let periods = steps[k] / before;
        let whole = (1.5..50.0).contains(&periods) && (periods - periods.round()).abs() < 0.1;
        if whole && before.abs() > ROUNDING {
            return format!(
                "{:.0} rows seem to be missing here without their time",
                periods.round() - 1.0
            );
        }
        "counts were lost or the counter was set, electrical noise, or the counter has another width than \
         encoder.counter_bits"
            .into()
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
