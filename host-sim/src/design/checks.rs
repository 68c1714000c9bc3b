//! Checks before a design is trusted: the paper's conditions, and what experience adds.
//!
//! Each has a value, a limit, a verdict and a sentence on what to change. `warn`: works, with less
//! margin than one would want; `refuse`: do not run this drive.

mod conditions;

use super::Design;
use super::drive_loop::DriveLoop;
use super::paper;
use crate::drive::SETTLING_BAND;
use crate::error::Result;
use crate::linear::eigen::spectral_radius;
use crate::linear::margins::Margins;
use arso_core::filter::{Difference, Lag};
use conditions::{distinct_eigenvalues, observability, riccati_residual};
use nalgebra::{Complex, DMatrix, DVector, RowDVector};
use serde::Serialize;

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Good.
    Pass,
    /// Works, with little margin.
    Warn,
    /// Must not be run.
    Refuse,
}

/// One check.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// What was checked.
    pub name: &'static str,
    /// How it came out.
    pub verdict: Verdict,
    /// The figure.
    pub value: f64,
    /// Where `warn` begins.
    pub limit: f64,
    /// What the figure means, and what to change.
    pub advice: String,
}

/// All checks of a design but those of its loop, [`closed_loop`] and [`peak_sensitivity`].
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when an eigenvalue iteration does not converge.
pub(super) fn checks(design: &Design) -> Result<Vec<Check>> {
    Ok(vec![
        riccati_residual(design),
        distinct_eigenvalues(design)?,
        observability(design)?,
        samples_per_mode(design),
        observer_samples(design)?,
        observer_speed(design)?,
        encoder_noise(design),
        current_step(design),
        commissioning_brake(design)?,
    ])
}

fn verdict(value: f64, warn_below: f64, refuse_below: f64) -> Verdict {
    // Written so that what is no number is refused.
    if value >= warn_below {
        Verdict::Pass
    } else if value >= refuse_below {
        Verdict::Warn
    } else {
        Verdict::Refuse
    }
}

/// Samples in one period of the fastest mode.
fn samples_per_mode(design: &Design) -> Check {
    let fastest = design.modes().last().map_or(0.0, |mode| mode.frequency_hz);
    let value = 1.0 / (fastest * design.drive.control.sample_time);
    let limit = 10.0;
    Check {
        name: "samples_per_fastest_mode",
        verdict: verdict(value, limit, 4.0),
        value,
        limit,
        advice: format!(
            "the fastest mode has {fastest:.1} Hz: control.sample_time below {:.2e} s samples it ten \
             times per period",
            0.1 / fastest
        ),
    }
}

/// How many times faster than the regulator's the slowest part of the estimation error decays, on the
/// discrete poles: "at least twice faster than the control system".
fn observer_speed(design: &Design) -> Result<Check> {
    let slowest = |poles: Vec<Complex<f64>>| {
        let norms = poles.iter().map(|pole| pole.norm());
        // What eq. (17) cannot correct stays at one; the check of eigenvalues tells that.
        -norms
            .filter(|norm| *norm < 1.0 - 1e-6)
            .fold(0.0, f64::max)
            .ln()
    };
    let value = slowest(design.observer_poles()?) / slowest(design.regulator_poles()?);
    let limit = design.drive.observer.speed;
    Ok(Check {
        name: "observer_speed",
        verdict: verdict(value, limit * (1.0 - 1e-6), 0.1),
        value,
        limit,
        advice: "the slowest part of the estimation error decays this many times as fast as the \
                 regulator's slowest pole; a larger observer.load_force_ratio and \
                 observer.disturbance_rate, or observer.design = \"poles\", make it faster, and the \
                 margins smaller"
            .into(),
    })
}

/// Samples in which the fastest part of the estimation error decays by 1/e.
fn observer_samples(design: &Design) -> Result<Check> {
    let poles = design.observer_poles()?;
    // Exact zeros are lags that the correction removes in one sample.
    let fastest = poles
        .iter()
        .map(|pole| pole.norm())
        .filter(|norm| *norm > 1e-9)
        .fold(1.0, f64::min);
    let value = -1.0 / f64::ln(fastest);
    let limit = 0.7;
    Ok(Check {
        name: "observer_samples",
        verdict: verdict(value, limit, 0.2),
        value,
        limit,
        advice: "the observer settles its fastest part in this many samples; below one it follows \
                 every count of noise: lower the cutoffs or shorten control.sample_time"
            .into(),
    })
}

/// Force noise of the reaction-force observer from the encoder's rounding, N rms, against the force
/// of the motor.
fn encoder_noise(design: &Design) -> Check {
    let noise = force_noise(design);
    let actuator = &design.drive.actuator;
    let limit = 0.02 * actuator.actual_force_constant() * actuator.current_limit;
    Check {
        name: "encoder_force_noise",
        // The smaller the better.
        verdict: verdict(limit / noise, 1.0, 0.1),
        value: noise,
        limit,
        advice: format!(
            "{} rms of reaction force from encoder rounding; above 2 % of the motor's force \
                 lower both cutoffs or use a finer encoder",
            design.drive.kind.units().force
        ),
    }
}

/// How far from its target the feedback lets the load stand, because half a step of the current output
/// rounds to none.
fn current_step(design: &Design) -> Check {
    let stiffness: f64 = design.regulator.iter().step_by(2).sum();
    let value = 0.5 * design.drive.actuator.current_resolution / stiffness;
    // Half of the band, on the step of the experiments.
    let step = paper::STEP;
    let limit = 0.5 * SETTLING_BAND * step;
    let units = design.drive.kind.units();
    Check {
        name: "current_step",
        // The smaller the better.
        verdict: verdict(limit / value, 1.0, 0.0),
        value,
        limit,
        advice: format!(
            "{} from the target at which the current rounds to none, against the band of a step of {} {}: a \
             finer actuator.current_resolution or a smaller cost.current",
            units.position,
            1e3 * step,
            units.milli_position
        ),
    }
}

/// Transition of the loop closed around actuator and encoder alone: position and filtered velocity of
/// the actuator times a gain each. States: the chain, the actuator's position one sample ago, the
/// filtered velocity then.
///
/// * `position`, `velocity`: gains, A/m and A s/m
#[must_use]
pub fn collocated_loop(design: &Design, position: f64, velocity: f64) -> DMatrix<f64> {
    let control = &design.drive.control;
    let period = control.sample_time;
    let pole = Lag::new(control.disturbance_cutoff, period).pole();
    let n = design.bd.len();
    let slope = (1.0 - pole) / period;
    let mut gain = RowDVector::zeros(n + 2);
    gain[0] = -position - velocity * slope;
    gain[n] = velocity * slope;
    gain[n + 1] = -velocity * pole;
    let mut closed = DMatrix::zeros(n + 2, n + 2);
    closed.view_mut((0, 0), (n, n)).copy_from(&design.ad);
    let mut input = DVector::zeros(n + 2);
    input.rows_mut(0, n).copy_from(&design.bd);
    closed += input * gain;
    closed[(n, 0)] = 1.0;
    closed[(n + 1, 0)] = slope;
    closed[(n + 1, n)] = -slope;
    closed[(n + 1, n + 1)] = pole;
    closed
}

/// Largest pole of the loop that commissioning closes around actuator and encoder alone, as if the
/// load were rigid: with the sums of the gains.
fn commissioning_brake(design: &Design) -> Result<Check> {
    let period = design.drive.control.sample_time;
    let position: f64 = design.regulator.iter().step_by(2).sum();
    let velocity: f64 = design.regulator.iter().skip(1).step_by(2).sum();
    let closed = collocated_loop(design, position, velocity);
    let value = spectral_radius(&closed)?;
    // Settled to 2 % within the two seconds that commissioning waits.
    let limit = (-4.0 * period / 2.0).exp();
    let verdict = if value < limit {
        Verdict::Pass
    } else if value < 1.0 {
        Verdict::Warn
    } else {
        Verdict::Refuse
    };
    Ok(Check {
        name: "commissioning_brake",
        verdict,
        value,
        limit,
        advice:
            "largest pole of the loop that brakes the actuator after its signs are proven; from 1 \
                 on it does not brake: smaller cost.position and cost.velocity against \
                 cost.current, a shorter control.sample_time or a higher disturbance_cutoff"
                .into(),
    })
}

/// Largest pole of the drive's own loop, plant, force observers, state observer and gain together.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when the eigenvalue iteration does not converge.
pub(super) fn closed_loop(design: &Design) -> Result<Check> {
    let closed = DriveLoop::new(design).closed(&design.ad, &design.bd);
    let value = spectral_radius(&closed)?;
    // Of eq. (17) alone the rigid motion stays in the estimate, a double one that rounding splits.
    let limit = if design.observer_variant().rigid_motion() {
        1.0 + 1e-4
    } else {
        1.0
    };
    Ok(Check {
        name: "closed_loop",
        verdict: if value < limit {
            Verdict::Pass
        } else {
            Verdict::Refuse
        },
        value,
        limit,
        advice:
            "largest pole of the drive's own loop, with its observers; from 1 on it is not stable: \
                 higher control.disturbance_cutoff and control.reaction_force_cutoff, a larger \
                 cost.current or a shorter control.sample_time"
                .into(),
    })
}

/// How far the loop stays from the brink over all frequencies.
pub(super) fn peak_sensitivity(margins: &Margins) -> Check {
    let (value, limit) = (margins.peak_sensitivity, 2.0);
    Check {
        name: "peak_sensitivity",
        // The smaller the better.
        verdict: verdict(limit / value, 1.0, 0.2),
        value,
        limit,
        advice: format!(
            "at {:.1} Hz the loop makes a disturbance this many times larger; below 2 the margins are \
             6 dB and 29 degrees at least: higher cutoffs, a larger cost.current, or a slower observer",
            margins.peak_sensitivity_hz
        ),
    }
}

/// Rounding is as good as noise, uniform over one count and different in each sample; the variance
/// behind the filter is the sum of its squared impulse response.
fn force_noise(design: &Design) -> f64 {
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

#[cfg(test)]
mod tests;
