//! What is searched of each law, in which box, and the law that a point stands for.
//!
//! | law | variables |
//! |---|---|
//! | drive, tuned | bandwidth, damping, share of each load in either gain, densities of the observer, plan |
//! | drive, load gains zero | bandwidth, damping, densities of the observer, plan: PD with the drive's friction removal |
//! | PD + observer | bandwidth, damping, cutoff and mass of a disturbance observer, plan |
//! | PD + ZV | bandwidth, damping, duration of the ramps, frequency and damping of the shaper |
//!
//! Bandwidth `ω` and damping `ζ` are those of a rigid drive of the whole mass `M`: the gains of all masses come to
//! `Σ k_p = ω² M / k_f` and `Σ k_v = 2 ζ ω M / k_f`; a load's share is a part of that sum, of either sign, searched by its root. Every other
//! variable is the logarithm of a ratio, as in [`laws`](super::super::laws). All numbers are rounded to four figures
//! before they are tried: what is written into a drive file is what was judged.

use super::super::guide::Guide;
use super::super::laws::{Make, slowest};
use super::super::pd::{DisturbanceSettings, Pd};
use super::super::shaper::Shaper;
use super::super::tune::Space;
use super::super::{Case, LawSettings, PdSettings, ReferenceSettings, Tuning};
use crate::design::Design;
use crate::design::assessment::require_sound_at_first_look;
use crate::design::drive_loop::{Compensation, DriveLoop};
use crate::design::protection::{Healthy, Protection};
use crate::drive::{Drive, Weights};
use crate::error::{Error, Result};
use crate::linear::eigen::spectral_radius;
use crate::simulate::Core;
use crate::simulate::scenario::Scenario;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The drive's own law with everything free, and without gains on the loads.
pub(super) const DRIVE: &str = "drive, tuned";
const NO_LOADS: &str = "drive, load gains zero";

/// A law that is tuned.
pub(super) struct Family<'a> {
    pub(super) name: &'static str,
    pub(super) space: Space,
    /// Another one that is a part of this one.
    pub(super) contains: Option<Part>,
    pub(super) form: Form<'a>,
}

/// The law of a point.
type Form<'a> = Box<dyn Fn(&[f64]) -> Result<Formed<'a>> + Sync + 'a>;

/// A family that another one contains: the variables that are missing in it are zero.
pub(super) struct Part {
    pub(super) name: &'static str,
    /// Where they are missing, and how many.
    at: usize,
    zeros: usize,
}

impl Part {
    /// A point of the part as one of the whole.
    pub(super) fn widened(&self, point: &[f64]) -> Vec<f64> {
        let (before, after) = point.split_at(self.at);
        [before, &vec![0.0; self.zeros], after].concat()
    }
}

/// The law of a point.
pub(super) struct Formed<'a> {
    pub(super) tuning: Tuning,
    /// Whose plans it goes by.
    pub(super) design: &'a Design,
    /// As a drive file has it; none of what is not the drive's own law.
    pub(super) drive: Option<Drive>,
    pub(super) make: Make<'a>,
}

/// The same design with plans of more and less current.
pub(super) struct Plans(Vec<Design>);

/// By which the current of one is less than that of the one before, and how many there are.
const LESS: f64 = 0.7;
const LEVELS: i32 = 11;

impl Plans {
    /// Those of the drive file alone.
    pub(super) fn own(design: &Design) -> Self {
        Self(vec![design.clone()])
    }

    /// Those of the drive file, and slower ones as far as friction and holding force leave them current.
    ///
    /// # Errors
    /// [`Error::Design`] when there are none.
    pub(super) fn of_less_current(design: &Design) -> Result<Self> {
        design.plans()?;
        let share = design.motion.current_share;
        let slower: Vec<Option<Design>> = (1..LEVELS)
            .into_par_iter()
            .map(|level| {
                let mut drive = design.drive.clone();
                drive.motion.current_share = Some(rounded(share * LESS.powi(level)));
                let slower = Design::new(&drive).ok()?;
                slower.plans().ok()?;
                Some(slower)
            })
            .collect();
        let mut all = vec![design.clone()];
        all.extend(slower.into_iter().map_while(|slower| slower));
        Ok(Self(all))
    }

    /// Longest time that one of them takes over a distance, control periods.
    pub(super) fn longest(&self, distance: f64, sample_time: f64) -> f64 {
        let plans = self.0.iter().filter_map(|design| design.plans().ok());
        let each = plans.map(|plans| plans.duration(distance, sample_time));
        each.fold(0.0, f64::max)
    }

    /// Of a variable from 0, the file's own, to the slowest.
    fn of(&self, variable: f64) -> &Design {
        let last = self.0.len() - 1;
        &self.0[(variable.round().max(0.0) as usize).min(last)]
    }

    fn middle(&self) -> f64 {
        0.5 * (self.0.len() - 1) as f64
    }

    fn ends(&self) -> (f64, f64) {
        // A box has a width.
        (-0.49, (self.0.len() as f64 - 0.51).max(0.49))
    }
}

/// All of them, a part of another one before that one.
pub(super) fn all<'a>(
    design: &'a Design,
    plans: &'a Plans,
    scenario: &'a Scenario,
) -> Vec<Family<'a>> {
    vec![
        of_drive(design, plans, scenario, false),
        of_drive(design, plans, scenario, true),
        pd_with_observer(design, plans, scenario),
        pd_with_shaper(design, scenario),
    ]
}

/// To four figures.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// Ends of bandwidth over the slowest mode, and of damping.
const BANDWIDTH: (f64, f64) = (0.05, 10.0);
const DAMPING: (f64, f64) = (0.1, 3.0);
/// Both of a slow and damped PD law.
const SLOW: [f64; 2] = [0.35, 0.85];
/// Most that a load's share in the sum of the gains can be, of either sign. What is searched is `x` of
/// `s = 1.5 x |x|`, from -1 to 1: fine around none, where laws are good, and wide enough for those that are designed.
const SHARE: f64 = 1.5;

fn share_of(x: f64) -> f64 {
    SHARE * x * x.abs()
}

fn root_of(share: f64) -> f64 {
    (share / SHARE).abs().sqrt().copysign(share)
}
/// Ends of the densities: `load_force_ratio`, and `disturbance_rate` over the slowest mode.
const DENSITIES: [(f64, f64); 2] = [(0.1, 1e3), (1e-2, 1e3)];

fn logarithms((low, high): (f64, f64)) -> (f64, f64) {
    (low.ln(), high.ln())
}

/// Gain and observer of the drive's own law as a point of its box, and back: bandwidth, damping, the shares of the
/// loads in the position gains and in the velocity gains, the two densities, the plan.
struct Coordinates {
    /// The slowest mode, rad/s.
    omega: f64,
    /// `M / k_f`, A s²/m.
    per_acceleration: f64,
    /// How many loads have gains.
    loads: usize,
    /// How many there are.
    all: usize,
}

/// How many variables stand before the shares.
const BEFORE_SHARES: usize = 2;

impl Coordinates {
    /// The drive as designed, or the nearest that the box has, by its fastest plan.
    fn start(&self, design: &Design) -> Vec<f64> {
        let Self {
            omega,
            per_acceleration,
            ..
        } = *self;
        let gains = |first: usize| design.regulator.iter().skip(first).step_by(2);
        let [position, velocity] = [0, 1].map(|first| gains(first).sum::<f64>());
        let bandwidth = (position / per_acceleration).max(0.0).sqrt();
        let bandwidth = bandwidth.max(BANDWIDTH.0 * omega);
        let damping = (velocity / (2.0 * bandwidth * per_acceleration)).max(DAMPING.0);
        let mut point = vec![(bandwidth / omega).ln(), damping.ln()];
        for (first, sum) in [position, velocity].into_iter().enumerate() {
            point.extend(
                gains(first)
                    .skip(1)
                    .take(self.loads)
                    .map(|gain| root_of(gain / sum)),
            );
        }
        let observer = &design.drive.observer;
        let densities = [observer.load_force_ratio, observer.disturbance_rate / omega];
        point.extend(densities.map(f64::ln));
        point.push(0.0);
        point
    }

    fn ends(&self, plans: &Plans) -> Vec<(f64, f64)> {
        let mut ends = vec![logarithms(BANDWIDTH), logarithms(DAMPING)];
        ends.extend(vec![(-1.0, 1.0); 2 * self.loads]);
        ends.extend(DENSITIES.map(logarithms));
        ends.push(plans.ends());
        ends
    }

    /// The gain and the observer of a point, and its plan.
    fn settings(&self, point: &[f64]) -> (LawSettings, f64) {
        let bandwidth = self.omega * point[0].exp();
        let sums = [bandwidth, 2.0 * point[1].exp()].map(|x| x * bandwidth * self.per_acceleration);
        let (shares, last) = point[BEFORE_SHARES..].split_at(2 * self.loads);
        let gains = |sum: f64, shares: &[f64]| -> Vec<f64> {
            let shares: Vec<f64> = shares.iter().map(|x| share_of(*x)).collect();
            let own = 1.0 - shares.iter().sum::<f64>();
            let mut gains = vec![0.0; self.all + 1];
            for (gain, share) in gains.iter_mut().zip([own].iter().chain(&shares)) {
                *gain = rounded(share * sum);
            }
            gains
        };
        let (of_positions, of_velocities) = shares.split_at(self.loads);
        let settings = LawSettings {
            position: gains(sums[0], of_positions),
            velocity: gains(sums[1], of_velocities),
            load_force_ratio: rounded(last[0].exp()),
            disturbance_rate: rounded(self.omega * last[1].exp()),
        };
        (settings, last[2])
    }
}

/// The drive's own law.
///
/// * `loads`: whether the loads have gains
fn of_drive<'a>(
    design: &'a Design,
    plans: &'a Plans,
    scenario: &'a Scenario,
    loads: bool,
) -> Family<'a> {
    let coordinates = Coordinates {
        omega: slowest(design),
        per_acceleration: design.drive.total_mass() / design.chain.force_constant,
        loads: if loads { design.loads() } else { 0 },
        all: design.loads(),
    };
    let start = coordinates.start(design);
    let ends = coordinates.ends(plans);
    // PD, slow and damped, with a plan in the middle.
    let mut slow = start.clone();
    slow[BEFORE_SHARES..BEFORE_SHARES + 2 * coordinates.loads].fill(0.0);
    slow[..BEFORE_SHARES].copy_from_slice(&SLOW.map(f64::ln));
    if let Some(plan) = slow.last_mut() {
        *plan = plans.middle();
    }
    let form = move |point: &[f64]| {
        let (settings, plan) = coordinates.settings(point);
        let of_plans = plans.of(plan);
        let weights = Weights::Gain {
            position: settings.position.clone(),
            velocity: settings.velocity.clone(),
        };
        let drive = settings.put_into(&of_plans.drive, weights);
        let tuned = Design::new(&drive)?;
        require_sound_at_first_look(&tuned)?;
        require_stable_later(&tuned)?;
        let plans = of_plans.plans()?;
        // What machines near this one need of the limits is looked for once it is found.
        let widest = Protection::new(&tuned, &Healthy::widest(&tuned));
        let make: Make<'a> = Box::new(move |case: &Case| {
            let core = Core::with_plans(&tuned, plans, &widest, &case.plant, scenario)?;
            Ok(Box::new(core))
        });
        Ok(Formed {
            tuning: Tuning::Gain(settings),
            design: of_plans,
            drive: Some(drive),
            make,
        })
    };
    Family {
        name: if loads { DRIVE } else { NO_LOADS },
        space: Space {
            ends,
            starts: vec![start, slow],
        },
        contains: loads.then_some(Part {
            name: NO_LOADS,
            at: BEFORE_SHARES,
            zeros: 2 * design.loads(),
        }),
        form: Box::new(form),
    }
}

/// A loop that one more control period of delay makes unstable is none.
fn require_stable_later(design: &Design) -> Result<()> {
    let mut later = design.clone();
    later.drive.actuator.delay += design.drive.control.sample_time;
    let (ad, bd) = later.sampled(&later.chain);
    for compensation in [Compensation::Follows, Compensation::Held] {
        let closed = DriveLoop::new(&later, compensation).closed(&ad, &bd);
        if spectral_radius(&closed)? >= 1.0 {
            let why = "it is not stable with one more control period of delay";
            return Err(Error::Design(why.into()));
        }
    }
    Ok(())
}

/// PD on the encoder and a disturbance observer.
fn pd_with_observer<'a>(
    design: &'a Design,
    plans: &'a Plans,
    scenario: &'a Scenario,
) -> Family<'a> {
    let omega = slowest(design);
    let form = move |point: &[f64]| {
        let of_plans = plans.of(point[4]);
        let mut settings = PdSettings::new(design, omega * point[0].exp(), point[1].exp());
        settings.disturbance = Some(DisturbanceSettings {
            cutoff: omega * point[2].exp(),
            mass: design.drive.total_mass() * point[3].exp(),
        });
        let make: Make<'a> = Box::new(move |_| {
            let guide = Guide::of(of_plans, scenario)?;
            Ok(Box::new(Pd::new(of_plans, settings, guide)))
        });
        Ok(Formed {
            tuning: Tuning::Pd(settings),
            design: of_plans,
            drive: None,
            make,
        })
    };
    let start = |plan: f64| {
        let slow = [SLOW[0], SLOW[1], 0.3, 0.9].map(f64::ln);
        [&slow[..], &[plan]].concat()
    };
    let mut ends = [BANDWIDTH, DAMPING, (0.02, 10.0), (0.3, 1.5)]
        .map(logarithms)
        .to_vec();
    ends.push(plans.ends());
    Family {
        name: "PD + observer",
        space: Space {
            ends,
            starts: vec![start(0.0), start(plans.middle())],
        },
        contains: None,
        form: Box::new(form),
    }
}

/// PD on the encoder behind a ZV shaper on ramps of its own.
fn pd_with_shaper<'a>(design: &'a Design, scenario: &'a Scenario) -> Family<'a> {
    let omega = slowest(design);
    let form = move |point: &[f64]| {
        let mut settings = PdSettings::new(design, omega * point[0].exp(), point[1].exp());
        settings.reference = Some(ReferenceSettings {
            ramp: TAU / omega * point[2].exp(),
            frequency: omega * point[3].exp(),
            damping: point[4].exp(),
        });
        let make: Make<'a> = Box::new(move |_| {
            let guide = Guide::shaped(design, settings.reference, Shaper::Zv, scenario);
            Ok(Box::new(Pd::new(design, settings, guide)))
        });
        Ok(Formed {
            tuning: Tuning::Pd(settings),
            design,
            drive: None,
            make,
        })
    };
    let logarithm = |point: [f64; 5]| point.map(f64::ln).to_vec();
    Family {
        name: "PD + ZV",
        space: Space {
            ends: [BANDWIDTH, DAMPING, (0.01, 3.0), (0.2, 100.0), (0.01, 0.9)]
                .map(logarithms)
                .to_vec(),
            starts: vec![
                logarithm([0.35, 0.85, 0.01, 0.6, 0.3]),
                logarithm([2.0, 0.7, 0.7, 0.7, 0.05]),
            ],
        },
        contains: None,
        form: Box::new(form),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::scenario::SCENARIOS;

    /// The drive as designed is a point of its box, to the four figures that are kept; and PD with the drive's friction
    /// removal is the same law as a point of the whole.
    #[test]
    fn what_is_designed_and_what_has_no_load_gains_are_points_of_the_box() {
        let design = Design::new(&Drive::default_drive()).unwrap();
        let plans = Plans::own(&design);
        let part = of_drive(&design, &plans, &SCENARIOS[0], false);
        let whole = of_drive(&design, &plans, &SCENARIOS[0], true);
        let gain = |family: &Family<'_>, point: &[f64]| match (family.form)(point).unwrap().tuning {
            Tuning::Gain(gain) => gain,
            other => panic!("{other:?}"),
        };
        let start = &whole.space.starts[0];
        for (x, (low, high)) in start.iter().zip(&whole.space.ends) {
            assert!((low..=high).contains(&x), "{start:?}");
        }
        let own = gain(&whole, start);
        let stated = own.position.iter().zip(&own.velocity);
        let stated = stated.flat_map(|(position, velocity)| [*position, *velocity]);
        for (found, designed) in stated.zip(design.regulator.iter()) {
            assert!(
                (found - designed).abs() <= 1e-3 * designed.abs(),
                "{found} {designed}"
            );
        }
        let point = &part.space.starts[0];
        let wider = whole.contains.as_ref().unwrap().widened(point);
        assert_eq!(gain(&part, point), gain(&whole, &wider));
    }
}
