//! Weights that follow from the drive itself, for a drive file that states none.
//!
//! Members of one family, from fast to slow in their bandwidth `ω` in steps of 12 %; the first whose checks
//! pass is taken:
//!
//! ```text
//! q_i = s_i R (ω² M / k_f)²,   q_v,i = q_i / ω²,   R = 1 / i_max²
//! ```
//!
//! `s_i` shares the weight equally among the masses, or gives 95 % of it to the controlled one; where the file
//! states no observer either, three pairs of noise densities are tried with each. Of the members of one
//! bandwidth that pass, the one is taken with which the true state settles soonest. The loop must also bear two
//! control periods of delay, and decay on plants whose springs are 30 %, whose last load is 50 % or whose force
//! constant is 10 % off, unless no member does. Where none
//! passes, the one is taken with the fewest checks that refuse or warn. A check passes if it gives no
//! warning, or only one that the slowest sound member has as well: it speaks of the drive then, and no weights
//! change it. The fastest bandwidth is three times the slowest mode, or 0.35 of a control period's rate
//! where that is less.

use super::PerformanceIndex;
use super::settling::settles;
use crate::chain::{Chain, controlled_mass};
use crate::design::Design;
use crate::design::assessment::{at_first_look, judged};
use crate::design::checks::{Check, Verdict};
use crate::design::drive_loop::{Compensation, DriveLoop};
use crate::drive::{Drive, ObserverSettings, Weights};
use crate::error::{Error, Result};
use crate::linear::eigen::spectral_radius;
use crate::machine::chain_of;
use rayon::prelude::*;

/// Ratio of one bandwidth to the next, and how many there are.
const STEP: f64 = 1.12;
const MEMBERS: i32 = 45;
/// Fastest bandwidth, over that of the slowest mode, and times the control period.
const OF_MODE: f64 = 3.0;
const OF_RATE: f64 = 0.35;
/// Share of the weights on the controlled mass, besides the equal shares.
const ON_CONTROLLED: f64 = 0.95;
/// What the loop must bear: delay, in control periods, and decay on other plants, over the bandwidth.
const DELAY: f64 = 2.0;
const DECAY: f64 = 0.05;
/// `load_force_ratio`, and `disturbance_rate` in 1/s, besides the defaults.
const DENSITIES: [(f64, f64); 2] = [(9.486_832_980_505_138, 1000.0), (1.0, 100.0)];

/// The drive with weights stated, and the observer's densities with them where the drive leaves both open.
///
/// # Errors
/// [`Error::Design`] when no member of the family can be designed.
pub(in crate::design) fn stated(drive: &Drive) -> Result<Drive> {
    let chain = chain_of(&drive.actuator, &drive.loads, drive.friction.viscous);
    let period = drive.control.sample_time;
    let mode = chain.modes().first().map_or(f64::INFINITY, |mode| {
        OF_MODE * std::f64::consts::TAU * mode.frequency_hz
    });
    let fastest = mode.min(OF_RATE / period);
    let bandwidth = |step: i32| fastest * STEP.powi(-step);
    let warnings = |checks: &[Check]| -> Option<Vec<&'static str>> {
        let refused = checks.iter().any(|check| check.verdict == Verdict::Refuse);
        let warned = checks.iter().filter(|check| check.verdict == Verdict::Warn);
        (!refused).then(|| warned.map(|check| check.name).collect())
    };
    let of_the_drive = (0..=MEMBERS).rev().find_map(|step| {
        let design = Design::new(&members(drive, bandwidth(step))[0]).ok()?;
        warnings(&at_first_look(&design).ok()?)
    });
    let of_the_drive = of_the_drive.unwrap_or_default();
    let passes = |checks: &[Check]| {
        warnings(checks).is_some_and(|names| names.iter().all(|name| of_the_drive.contains(name)))
    };
    // Robust ones first; where there are none, those whose checks pass.
    let all = [true, false].into_iter();
    for (robust, step) in all.flat_map(|robust| (0..=MEMBERS).map(move |step| (robust, step))) {
        let omega = bandwidth(step);
        let members = members(drive, omega);
        let passing = members.par_iter().filter_map(|member| {
            let design = Design::new(member).ok()?;
            let holds =
                lasts_elsewhere(&design, omega).ok()? && passes(&at_first_look(&design).ok()?);
            let (checks, margins) = holds.then(|| judged(&design).ok())??;
            let delay = margins.and_then(|margins| margins.delay());
            let late = delay.is_some_and(|delay| delay < DELAY * period);
            if !passes(&checks) || (robust && late) {
                return None;
            }
            // A rigid drive of this bandwidth settles in some 5 / ω.
            let time = settles(&design.chain, &design.regulator, period, 5.0 / omega);
            Some((time, member))
        });
        let passing: Vec<_> = passing.collect();
        let best = passing.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, member)) = best {
            return Ok(member.clone());
        }
    }
    // Nor these: what the checks say of the best of them is then for the user to read.
    let steps: Vec<i32> = (0..=MEMBERS).collect();
    let judged = steps.par_iter().flat_map_iter(|step| {
        let members = members(drive, bandwidth(*step)).into_iter();
        members.filter_map(|member| {
            let checks = at_first_look(&Design::new(&member).ok()?).ok()?;
            let count = |verdict| checks.iter().filter(|c| c.verdict == verdict).count();
            let faults = (count(Verdict::Refuse), count(Verdict::Warn), *step);
            Some((faults, member))
        })
    });
    let judged: Vec<_> = judged.collect();
    let best = judged.into_iter().min_by_key(|(faults, _)| *faults);
    best.map(|(_, member)| member).ok_or_else(|| {
        Error::Design(
            "no weights that follow from the drive itself give a stable loop: state them in [cost]"
                .into(),
        )
    })
}

/// What differs on a plant, by a factor.
type Change<'a> = &'a dyn Fn(&mut Chain, f64);

/// Whether the loop of a design, observers and all, still decays on plants whose springs, last load and force
/// constant differ, each by itself.
///
/// # Errors
/// [`Error::Design`] when poles cannot be computed.
fn lasts_elsewhere(design: &Design, omega: f64) -> Result<bool> {
    let period = design.drive.control.sample_time;
    let drive_loop = DriveLoop::new(design, Compensation::Follows);
    let slowest = (-DECAY * omega * period).exp();
    let springs = |chain: &mut Chain, factor: f64| {
        for stiffness in &mut chain.stiffness {
            *stiffness *= factor;
        }
    };
    let last = |chain: &mut Chain, factor: f64| {
        if let Some(mass) = chain.mass.last_mut() {
            *mass *= factor;
        }
    };
    let force = |chain: &mut Chain, factor: f64| chain.force_constant *= factor;
    let changes: [(Change<'_>, f64); 3] = [(&springs, 0.3), (&last, 0.5), (&force, 0.1)];
    for (change, by) in changes {
        for factor in [1.0 - by, 1.0 + by] {
            let mut chain = design.chain.clone();
            change(&mut chain, factor);
            let (ad, bd) = design.sampled(&chain);
            if spectral_radius(&drive_loop.closed(&ad, &bd))? >= slowest {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// The drive with each member of one bandwidth, rad/s.
fn members(drive: &Drive, omega: f64) -> Vec<Drive> {
    let masses = drive.loads.len() + 1;
    let controlled = controlled_mass(drive.loads.len());
    let force_constant = drive.actuator.actual_force_constant();
    let sum = drive.cost.current * (omega * omega * drive.total_mass() / force_constant).powi(2);
    let equal = vec![1.0 / masses as f64; masses];
    let mut one: Vec<f64> = equal.iter().map(|s| (1.0 - ON_CONTROLLED) * s).collect();
    one[controlled] += ON_CONTROLLED;
    let mut observers = vec![drive.observer.clone()];
    if drive.observer == ObserverSettings::default() {
        observers.extend(
            DENSITIES.map(|(load_force_ratio, disturbance_rate)| ObserverSettings {
                load_force_ratio,
                disturbance_rate,
                ..drive.observer.clone()
            }),
        );
    }
    let shares = [equal, one];
    let each = shares.iter().flat_map(|shares| {
        observers.iter().map(move |observer| {
            let index = PerformanceIndex {
                current: drive.cost.current,
                position: shares.iter().map(|share| share * sum).collect(),
                velocity: shares
                    .iter()
                    .map(|share| share * sum / (omega * omega))
                    .collect(),
            };
            let mut member = drive.clone();
            member.cost.weights = Weights::Given {
                position: index.position,
                velocity: index.velocity,
            };
            member.observer = observer.clone();
            member
        })
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light and heavy loads, one to six of them, soft and stiff: gains without a warning that weights could
    /// change.
    #[test]
    fn gains_of_many_drives_pass_their_checks() {
        let mut failing = Vec::new();
        for (loads, share, stiffness) in [
            (1, 6.0, 400.0),
            (2, 1.0, 2000.0),
            (3, 0.3, 300.0),
            (4, 1.5, 3000.0),
            (6, 0.2, 5000.0),
        ] {
            let mut drive = Drive::default_drive();
            let load = drive.loads[0].clone();
            drive.loads = vec![load; loads];
            for load in &mut drive.loads {
                load.mass = share * drive.actuator.mass / loads as f64;
                load.stiffness = stiffness;
            }
            drive.cost.weights = Weights::Derived;
            drive.cost.terminal = vec![0.0; 2 * loads + 2];
            let design = Design::new(&drive).unwrap();
            let checks = judged(&design).unwrap().0;
            let not: Vec<_> = checks
                .iter()
                .filter(|check| check.verdict != Verdict::Pass)
                // Of the drive itself.
                .filter(|check| check.name != "samples_per_fastest_mode")
                .map(|check| (check.name, check.value))
                .collect();
            failing.extend((!not.is_empty()).then_some((loads, not)));
        }
        assert!(failing.is_empty(), "{failing:?}");
    }
}
