//! What the encoder does to a drive: noise by its rounding, and a counter that must not be outrun.

use super::{Check, Design, Verdict, verdict};
use crate::design::paper;
use crate::error::Result;
use arso_core::filter::{Difference, Lag};
use nalgebra::DVector;

/// Force noise of the reaction-force observer from the encoder's rounding, N rms, against the force
/// of the motor.
pub(super) fn encoder_noise(design: &Design) -> Check {
    let noise = force_noise(design);
    let actuator = &design.drive.actuator;
    let limit = 0.02 * actuator.largest_force();
    Check::new(
        "encoder_force_noise",
        // The smaller the better.
        verdict(limit / noise, 1.0, 0.1),
        (noise, limit),
        format!(
            "{} rms of reaction force from encoder rounding; above 2 % of the motor's force \
             lower both cutoffs or use a finer encoder",
            design.drive.kind.units().force
        ),
    )
}

/// Rounding is as good as noise, uniform over one count and different in each sample; the variance
/// behind the filter is the sum of its squared impulse response.
pub(super) fn force_noise(design: &Design) -> f64 {
    let (actuator, control) = (&design.drive.actuator, &design.drive.control);
    let period = control.sample_time;
    let difference = Difference::new(period);
    let once = Lag::new(control.disturbance_cutoff, period);
    let twice = Lag::new(control.reaction_force_cutoff, period);
    let (mut position, mut velocity, mut filtered, mut acceleration) = (0.0, 0.0, 0.0, 0.0);
    let mut sum = 0.0;
    for k in 0..100_000 {
        let impulse = if k == 0 { 1.0 } else { 0.0 };
        let mean = difference.step(&mut position, impulse);
        let through = once.step(&mut velocity, mean);
        let change = difference.step(&mut filtered, through);
        twice.step(&mut acceleration, change);
        sum += acceleration * acceleration;
        if k > 10 && velocity.abs() < 1e-12 / period && acceleration.abs() < 1e-12 / period {
            break;
        }
    }
    actuator.mass * f64::sqrt(sum) * design.drive.encoder.resolution / f64::sqrt(12.0)
}

/// Counts in one control period at the drive's fastest, against the quarter of the counter's range
/// beyond which the core no longer knows the direction and stops ([`Fault::EncoderJump`]).
///
/// Refused where the step of the experiments or a move with the limits of the drive file gets that fast;
/// where only a long move with limits that nobody stated would, it is a warning.
///
/// [`Fault::EncoderJump`]: arso_core::Fault::EncoderJump
pub(super) fn counts_per_period(design: &Design) -> Result<Check> {
    let drive = &design.drive;
    let counts = |speed: f64| speed * drive.control.sample_time / drive.encoder.resolution;
    let certain = step_speed(design)?.max(match drive.motion.velocity {
        Some(stated) => stated,
        None => move_speed(design),
    });
    let value = counts(certain.max(design.motion.velocity));
    let limit = quarter_of_range(drive.encoder.counter_bits);
    let verdict = if counts(certain) > limit {
        Verdict::Refuse
    } else if value > 0.5 * limit {
        Verdict::Warn
    } else {
        Verdict::Pass
    };
    let units = drive.kind.units();
    Ok(Check::new(
        "counts_per_period",
        verdict,
        (value, limit),
        format!(
            "counts in one control period at the drive's fastest in a step of {} {} or a move; beyond a quarter \
             of the counter's range the drive stops (fault 2, EncoderJump), at {:.3} {}: \
             encoder.counter_bits = 32, a coarser encoder, a shorter control.sample_time or a smaller \
             move.velocity",
            1e3 * paper::STEP,
            units.milli_position,
            limit * drive.encoder.resolution / drive.control.sample_time,
            units.velocity,
        ),
    ))
}

/// Counts that the counter may move in one period.
#[must_use]
pub fn quarter_of_range(counter_bits: u32) -> f64 {
    2_f64.powi(counter_bits as i32 - 2)
}

/// How many of the regulator's slowest time constants a step is followed, and in how many periods at most.
const TIME_CONSTANTS: f64 = 5.0;
const LONGEST: f64 = 20_000.0;

/// Fastest of the actuator in the step of the experiments, with the true state fed back, m/s.
fn step_speed(design: &Design) -> Result<f64> {
    let period = design.drive.control.sample_time;
    let periods = TIME_CONSTANTS / (design.regulator_decay()? * period);
    let limit = design.drive.actuator.current_limit;
    let target = DVector::from_fn(
        design.bd.len(),
        |i, _| {
            if i % 2 == 0 { paper::STEP } else { 0.0 }
        },
    );
    let mut state = DVector::zeros(design.bd.len());
    let mut fastest = 0.0_f64;
    for _ in 0..periods.clamp(10.0, LONGEST) as u32 {
        let current = (&design.regulator * (&target - &state)).x;
        let next = &design.ad * &state + &design.bd * current.clamp(-limit, limit);
        // The encoder sees the mean over the period.
        fastest = fastest.max((next[0] - state[0]).abs() / period);
        state = next;
    }
    Ok(fastest)
}

/// Fastest in a planned move as long as that step, m/s: what the motor can make of a rigid machine.
pub(super) fn move_speed(design: &Design) -> f64 {
    let actuator = &design.drive.actuator;
    let force = design.chain.force_constant * actuator.current_limit;
    let largest = force / design.drive.total_mass();
    let acceleration = design
        .motion
        .acceleration
        .map_or(largest, |a| a.min(largest));
    // Half of the way to speed up.
    (acceleration * paper::STEP)
        .sqrt()
        .min(design.motion.velocity)
}
