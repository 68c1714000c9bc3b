//! Checks before a design is trusted: the paper's conditions, and what experience adds.
//!
//! Each has a value, a limit, a verdict and a sentence on what to change. `warn`: works, with less
//! margin than one would want; `refuse`: do not run this drive.

mod conditions;
mod encoder;
mod friction;
mod observer;
mod stability;
mod start_up;

use super::Design;
use super::paper;
use crate::drive::SETTLING_BAND;
use crate::error::Result;
use crate::linear::eigen::spectral_radius;
use arso_core::filter::Lag;
use conditions::{distinct_eigenvalues, observability, riccati_residual};
use encoder::{counts_per_period, encoder_noise};
use friction::friction_share;
use nalgebra::{DMatrix, DVector, RowDVector};
use observer::{observer_samples, observer_speed};
use serde::Serialize;
use start_up::{holding_share, unheld_force};

pub use encoder::quarter_of_range;
pub(super) use observer::{OBSERVER_SPEED, what_changes_its_speed};
pub(super) use stability::{closed_loop, of_margins};

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
    /// The figure; none when it cannot be computed, which the advice then says.
    pub value: Option<f64>,
    /// Where `warn` begins.
    pub limit: f64,
    /// What the figure means, and what to change.
    pub advice: String,
}

impl Check {
    /// A check; what is no number is refused in words.
    ///
    /// * `value`, `limit`: the figure, and where `warn` begins
    pub(crate) fn new(
        name: &'static str,
        verdict: Verdict,
        (value, limit): (f64, f64),
        advice: impl Into<String>,
    ) -> Self {
        let advice = advice.into();
        let known = value.is_finite();
        Self {
            name,
            verdict: if known { verdict } else { Verdict::Refuse },
            value: known.then_some(value),
            limit,
            advice: if known {
                advice
            } else {
                format!("cannot be computed, the drive file's numbers lie too far apart: {advice}")
            },
        }
    }
}

/// All checks of a design but those of its loop, [`closed_loop`] and [`of_margins`].
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when an eigenvalue iteration does not converge.
pub(super) fn checks(design: &Design) -> Result<Vec<Check>> {
    let mut checks: Vec<Check> = riccati_residual(design).into_iter().collect();
    checks.extend([
        distinct_eigenvalues(design)?,
        observability(design)?,
        samples_per_mode(design),
        observer_samples(design)?,
        observer_speed(design)?,
        encoder_noise(design),
        counts_per_period(design)?,
        friction_share(design),
        holding_share(design),
        unheld_force(design),
        current_step(design),
        commissioning_brake(design)?,
    ]);
    Ok(checks)
}

/// How the drive file is told to have a weaker feedback, and a stronger one.
fn weaker(design: &Design) -> &'static str {
    match design.index {
        Some(_) => "a larger cost.current",
        None => "smaller gains in [gain]",
    }
}

fn stronger(design: &Design) -> &'static str {
    match design.index {
        Some(_) => "a smaller cost.current",
        None => "larger gains in [gain]",
    }
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
    Check::new(
        "samples_per_fastest_mode",
        verdict(value, limit, 4.0),
        (value, limit),
        format!(
            "the fastest mode has {fastest:.1} Hz: control.sample_time below {:.2e} s samples it ten \
             times per period",
            0.1 / fastest
        ),
    )
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
    Check::new(
        "current_step",
        // The smaller the better.
        verdict(limit / value, 1.0, 0.0),
        (value, limit),
        format!(
            "{} from the target at which the current rounds to none, against the band of a step of {} {}: a \
             finer actuator.current_resolution or {}",
            units.position,
            1e3 * step,
            units.milli_position,
            stronger(design)
        ),
    )
}

/// Transition of the loop closed around actuator and encoder alone: position and filtered velocity of
/// the actuator times a gain each. States: the chain (and what
/// its force remembers where it comes late), the actuator's position one sample ago, the
/// filtered velocity then.
///
/// * `position`, `velocity`: gains, A/m and A s/m
#[must_use]
pub fn collocated_loop(design: &Design, position: f64, velocity: f64) -> DMatrix<f64> {
    let control = &design.drive.control;
    let period = control.sample_time;
    let pole = Lag::new(control.disturbance_cutoff, period).pole();
    let (ad, bd) = design.sampled(&design.chain);
    let n = bd.len();
    let slope = (1.0 - pole) / period;
    let mut gain = RowDVector::zeros(n + 2);
    gain[0] = -position - velocity * slope;
    gain[n] = velocity * slope;
    gain[n + 1] = -velocity * pole;
    let mut closed = DMatrix::zeros(n + 2, n + 2);
    closed.view_mut((0, 0), (n, n)).copy_from(&ad);
    let mut input = DVector::zeros(n + 2);
    input.rows_mut(0, n).copy_from(&bd);
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
    Ok(Check::new(
        "commissioning_brake",
        verdict,
        (value, limit),
        format!(
            "largest pole of the loop that brakes the actuator after its signs are proven; from 1 \
                 on it does not brake: {}, a shorter control.sample_time or a higher disturbance_cutoff",
            match design.index {
                Some(_) => "smaller cost.position and cost.velocity against cost.current",
                None => "smaller gains in [gain]",
            }
        ),
    ))
}

#[cfg(test)]
mod tests;
