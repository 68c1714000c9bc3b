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
//! `Σ k_p = ω² M / k_f` and `Σ k_v = 2 ζ ω M / k_f`; a load's share is a part of that sum, of either sign. Every other
//! variable is the logarithm of a ratio, as in [`laws`](super::super::laws). All numbers are rounded to four figures
//! before they are tried: what is written into a drive file is what was judged.

use super::super::guide::Guide;
use super::super::laws::{Make, slowest};
use super::super::pd::{DisturbanceSettings, Pd};
use super::super::shaper::Shaper;
use super::super::tune::Space;
use super::super::{Case, GainSettings, PdSettings, ReferenceSettings, Tuning};
use crate::design::assessment::require_sound_at_first_look;
use crate::design::drive_loop::{Compensation, DriveLoop};
use crate::design::protection::{Healthy, Protection};
use crate::design::Design;
use crate::drive::{Drive, ObserverMethod, Weights};
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
    /// Another one that is a part of this one, and where that one's points are in it.
    pub(super) contains: Option<&'static str>,
    pub(super) widened: Box<dyn Fn(&[f64]) -> Vec<f64> + Sync + 'a>,
    pub(super) form: Box<dyn Fn(&[f64]) -> Result<Formed<'a>> + Sync + 'a>,
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
const LESS: f64 = 0.75;
const LEVELS: i32 = 10;

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

    /// Of a variable from 0, the file's own, to the slowest.
    fn of(&self, variable: f64) -> &Design {
        let last = self.0.len() - 1;
        &self.0[(variable.round().max(0.0) as usize).min(last)]
    }

    fn ends(&self) -> (f64, f64) {
        // A box has a width.
        (-0.49, (self.0.len() as f64 - 0.51).max(0.49))
    }
}

/// All of them, a part of another one before that one.
pub(super) fn all<'a>(design: &'a Design, plans: &'a Plans, scenario: &'a Scenario) -> Vec<Family<'a>> {
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
/// Ends of a load's share in the sum of the gains.
const SHARE: (f64, f64) = (-1.5, 1.5);
/// Ends of the densities: `load_force_ratio`, and `disturbance_rate` over the slowest mode.
const DENSITIES: [(f64, f64); 2] = [(0.1, 1e3), (1e-2, 1e3)];

fn logarithms((low, high): (f64, f64)) -> (f64, f64) {
    (low.ln(), high.ln())
}

/// The drive's own law.
///
/// * `loads`: whether the loads have gains
fn of_drive<'a>(design: &'a Design, plans: &'a Plans, scenario: &'a Scenario, loads: bool) -> Family<'a> {
    let omega = slowest(design);
    let count = design.loads();
    let shares = if loads { 2 * count } else { 0 };
    let per_acceleration = design.drive.total_mass() / design.chain.force_constant;
    let observer = &design.drive.observer;
    let sum = |first: usize| -> f64 { design.regulator.iter().skip(first).step_by(2).sum() };
    // The gain as designed, or the nearest that the box has.
    let bandwidth = (sum(0) / per_acceleration).max(0.0).sqrt().max(BANDWIDTH.0 * omega);
    let damping = (sum(1) / (2.0 * bandwidth * per_acceleration)).max(DAMPING.0);
    let mut start = vec![(bandwidth / omega).ln(), damping.ln()];
    if loads {
        for first in 0..2 {
            let gains = design.regulator.iter().skip(first).step_by(2).skip(1);
            start.extend(gains.map(|gain| gain / sum(first)));
        }
    }
    start.extend([observer.load_force_ratio.ln(), (observer.disturbance_rate / omega).ln(), 0.0]);
    let mut ends = vec![logarithms(BANDWIDTH), logarithms(DAMPING)];
    ends.extend(vec![SHARE; shares]);
    ends.extend(DENSITIES.map(logarithms));
    ends.push(plans.ends());
    // Slow and damped, with a slow plan.
    let mut slow = start.clone();
    (slow[0], slow[1]) = (0.35_f64.ln(), 0.85_f64.ln());
    slow[2..2 + shares].fill(0.0);
    if let Some(plan) = slow.last_mut() {
        *plan = 0.5 * plans.ends().1;
    }
    let form = move |point: &[f64]| {
        let omega_c = omega * point[0].exp();
        let sums = [
            omega_c * omega_c * per_acceleration,
            2.0 * point[1].exp() * omega_c * per_acceleration,
        ];
        let [position, velocity] = [0, 1].map(|kind| {
            let shares: Vec<f64> = (0..count)
                .map(|load| if loads { point[2 + kind * count + load] } else { 0.0 })
                .collect();
            let own = 1.0 - shares.iter().sum::<f64>();
            let gains = std::iter::once(own).chain(shares);
            gains.map(|share| rounded(share * sums[kind])).collect::<Vec<f64>>()
        });
        let settings = GainSettings {
            position,
            velocity,
            load_force_ratio: rounded(point[2 + shares].exp()),
            disturbance_rate: rounded(omega * point[3 + shares].exp()),
        };
        let of_plans = plans.of(point[4 + shares]);
        let mut drive = of_plans.drive.clone();
        drive.cost.weights = Weights::Gain {
            position: settings.position.clone(),
            velocity: settings.velocity.clone(),
        };
        drive.observer.design = ObserverMethod::Kalman;
        drive.observer.load_force_ratio = settings.load_force_ratio;
        drive.observer.disturbance_rate = settings.disturbance_rate;
        let tuned = Design::new(&drive)?;
        require_sound_at_first_look(&tuned)?;
        require_stable_later(&tuned)?;
        let plans = of_plans.plans()?;
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
        contains: loads.then_some(NO_LOADS),
        widened: Box::new(move |point| {
            let shares = std::iter::repeat_n(0.0, 2 * count);
            let (head, tail) = point.split_at(2);
            head.iter().copied().chain(shares).chain(tail.iter().copied()).collect()
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
fn pd_with_observer<'a>(design: &'a Design, plans: &'a Plans, scenario: &'a Scenario) -> Family<'a> {
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
    let start = |plan: f64| vec![0.35_f64.ln(), 0.85_f64.ln(), 0.3_f64.ln(), 0.9_f64.ln(), plan];
    let mut ends = [BANDWIDTH, DAMPING, (0.02, 10.0), (0.3, 1.5)].map(logarithms).to_vec();
    ends.push(plans.ends());
    Family {
        name: "PD + observer",
        space: Space {
            ends,
            starts: vec![start(0.0), start(0.5 * plans.ends().1)],
        },
        contains: None,
        widened: Box::new(<[f64]>::to_vec),
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
        widened: Box::new(<[f64]>::to_vec),
        form: Box::new(form),
    }
}
