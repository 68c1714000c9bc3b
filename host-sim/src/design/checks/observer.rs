//! How fast the observer is: against the regulator, against the noise, and what would change it.

use super::{Check, Design, Verdict, stability, verdict};
use crate::design::drive_loop::Compensation;
use crate::design::loop_margins;
use crate::drive::{ObserverMethod, ObserverSettings};
use crate::error::Result;
use crate::output::significant;
use nalgebra::Complex;

/// The check's name.
pub(in crate::design) const OBSERVER_SPEED: &str = "observer_speed";

/// How many times faster than the regulator's the slowest part of the estimation error decays.
fn speed(design: &Design) -> Result<f64> {
    let slowest = |poles: Vec<Complex<f64>>| {
        let norms = poles.iter().map(|pole| pole.norm());
        // What eq. (17) cannot correct stays at one; the check of eigenvalues tells that.
        -norms
            .filter(|norm| *norm < 1.0 - 1e-6)
            .fold(0.0, f64::max)
            .ln()
    };
    Ok(slowest(design.observer_poles()?) / slowest(design.regulator_poles()?))
}

/// "At least twice faster than the control system", on the discrete poles.
///
/// Never a reason to refuse: a slow part of the error that the gain hardly uses does no harm, and whether
/// the loop as a whole is sound is said by the checks of the loop.
pub(super) fn observer_speed(design: &Design) -> Result<Check> {
    let value = speed(design)?;
    let limit = design.drive.observer.speed;
    let verdict = if value >= limit * (1.0 - 1e-6) {
        Verdict::Pass
    } else {
        Verdict::Warn
    };
    Ok(Check::new(
        OBSERVER_SPEED,
        verdict,
        (value, limit),
        "the slowest part of the estimation error decays this many times as fast as the regulator's \
         slowest pole",
    ))
}

/// By how much a setting is changed to see what that does.
const CHANGE: f64 = 3.0;

/// What each change of the observer's settings does to its speed and to the loop: tried, not supposed.
///
/// # Errors
/// When an eigenvalue iteration does not converge.
pub(in crate::design) fn what_changes_its_speed(design: &Design) -> Result<String> {
    let mut words = Vec::new();
    for (name, change) in changes(&design.drive.observer) {
        let mut drive = design.drive.clone();
        drive.observer = change;
        let decay = design.regulator_decay()?;
        let variant = design.observer_variant();
        let Ok(observer) = variant.design(&drive, &design.chain, decay) else {
            continue;
        };
        let changed = Design {
            drive,
            observer,
            ..design.clone()
        };
        let faster = significant(speed(&changed)?, 2);
        let peak = if stability::closed_loop(&changed)?.verdict == Verdict::Refuse {
            "an unstable loop".to_owned()
        } else {
            let margins = loop_margins::of_drive(&changed, Compensation::Follows)?;
            format!(
                "peak sensitivity {}",
                significant(margins.peak_sensitivity, 2)
            )
        };
        words.push(format!("{name}: {faster}, {peak}"));
    }
    Ok(format!(
        "; tried on this drive (speed, loop): {}",
        words.join("; ")
    ))
}

/// The changes that are tried, each with its words.
fn changes(settings: &ObserverSettings) -> Vec<(String, ObserverSettings)> {
    let mut changes = Vec::new();
    if settings.design == ObserverMethod::Poles {
        return changes;
    }
    for factor in [1.0 / CHANGE, CHANGE] {
        let load_force_ratio = settings.load_force_ratio * factor;
        changes.push((
            format!(
                "observer.load_force_ratio = {}",
                significant(load_force_ratio, 2)
            ),
            ObserverSettings {
                load_force_ratio,
                ..settings.clone()
            },
        ));
    }
    for factor in [1.0 / CHANGE, CHANGE] {
        let disturbance_rate = settings.disturbance_rate * factor;
        if settings.disturbance {
            changes.push((
                format!(
                    "observer.disturbance_rate = {}",
                    significant(disturbance_rate, 2)
                ),
                ObserverSettings {
                    disturbance_rate,
                    ..settings.clone()
                },
            ));
        }
    }
    changes
}

/// Samples in which the fastest part of the estimation error decays by 1/e.
pub(super) fn observer_samples(design: &Design) -> Result<Check> {
    let poles = design.observer_poles()?;
    // Exact zeros are lags that the correction removes in one sample.
    let fastest = poles
        .iter()
        .map(|pole| pole.norm())
        .filter(|norm| *norm > 1e-9)
        .fold(1.0, f64::min);
    let value = -1.0 / f64::ln(fastest);
    let limit = 0.7;
    Ok(Check::new(
        "observer_samples",
        verdict(value, limit, 0.2),
        (value, limit),
        "the observer settles its fastest part in this many samples; below one it follows \
         every count of noise: lower the cutoffs or shorten control.sample_time",
    ))
}
