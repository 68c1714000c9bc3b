//! Planned moves beside the raw step and the rivals, on plants drawn around the drive.
//!
//! ```text
//! drive, friction stated -> design -> laws, the rivals tuned once -+-> runs -> figures -> spread over each set
//! sets, drawn with a seed -> plants and their bounds --------------+
//! ```
//!
//! Every law makes the same move on the same plants. The core is sent by its plans and by a raw step; `K` on the
//! true state, PD and PD with a disturbance observer follow the same plan with the same friction fed forward; PD
//! behind input shapers follows its own ramps, friction fed forward by the shaped reference.
//! The rivals are tuned by the search of [`compare`](super::compare), all with the same budget, on a few plants of
//! the widest set that no figure is taken from.
//!
//! Friction belongs to the sets. Where the drive file states none, a share of the motor's force is taken for
//! what is there and for what is fed forward.

mod figures;
mod sets;

pub use figures::Figures;
pub use sets::Set;

use super::laws::{self, Make};
use super::tune::Moving;
use super::{Bench, Case, Spread, Tuning, duration, require_comparable};
use crate::design::Design;
use crate::drive::Drive;
use crate::error::Result;
use crate::output::Progress;
use crate::simulate::bound::{Bound, bound, times};
use crate::simulate::scenario::{Approach, SCENARIOS, Scenario};
use crate::simulate::{Core, FullState, Time};
use rayon::prelude::*;
use serde::Serialize;

/// Coulomb friction over the motor's largest force where the drive file states none: 0.2 N of 12 N.
const FRICTION: f64 = 0.2 / 12.0;
/// Plants the rivals are tuned on.
const TUNED_ON: usize = 6;
/// How long a run is after the planned move has arrived until nothing may move any more, and how long it is then
/// watched: s, and periods of the slowest mode where these are more.
const STILL_AFTER: (f64, f64) = (1.0, 12.0);
const WATCHED: (f64, f64) = (0.5, 6.0);

/// The rivals: their names in the comparison, and here.
const RIVALS: [(&str, &str); 6] = [
    ("PD", "PD, same plan"),
    ("PD + observer", "PD + observer, same plan"),
    ("PD + ZV", "ZV shaper + PD"),
    ("PD + ZVD", "ZVD shaper + PD"),
    ("PD + EI", "EI shaper + PD"),
    ("PD + MZV", "MZV shaper + PD"),
];

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// Of the move, m.
    pub distance: f64,
    /// Of each set that is drawn.
    pub plants: usize,
    /// Of all that is drawn.
    pub seed: u64,
    /// For each rival that is tuned.
    pub evaluations: usize,
}

/// What came of it, SI units.
#[derive(Debug, Serialize)]
pub struct Campaign {
    /// Of the move, m.
    pub distance: f64,
    /// Of all that is drawn.
    pub seed: u64,
    /// Fed forward, N; in the plants within what the set says.
    pub friction: f64,
    /// Whether the drive file left that open.
    pub friction_assumed: bool,
    /// Duration of the planned move, and of each run, s.
    pub planned: f64,
    /// See `planned`.
    pub duration: f64,
    /// After which the actuator has to be still, s.
    pub still_after: f64,
    /// How far from its target each may rest, m.
    pub settling_tolerance: f64,
    /// For each rival that is tuned.
    pub evaluations: usize,
    /// What the rivals were tuned to, and their criterion, s.
    pub tunings: Vec<(&'static str, Tuning, f64)>,
    /// Set by set.
    pub sets: Vec<OnSet>,
}

/// All laws on one set.
#[derive(Debug, Serialize)]
pub struct OnSet {
    /// Which.
    pub set: Set,
    /// How many plants.
    pub plants: usize,
    /// Their least settling times, s.
    pub bound: Spread,
    /// Law by law.
    pub laws: Vec<OnPlants>,
}

/// A law on the plants of a set.
#[derive(Debug, Serialize)]
pub struct OnPlants {
    /// Which law.
    pub law: &'static str,
    /// Settling time of the controlled mass to 2 %, at rest at the end, s.
    pub settled: Spread,
    /// The same over the plant's own bound.
    pub times_bound: Spread,
    /// After which the controlled mass stays within the band, whatever moves at the end, s.
    pub within_band: Spread,
    /// The same over the plant's own bound.
    pub within_band_times_bound: Spread,
    /// After which actuator and controlled mass stay within the tolerance, s.
    pub within_tolerance: Spread,
    /// Peak-to-peak motion of the controlled mass after arrival, m.
    pub residual: Spread,
    /// Distance of actuator or controlled mass from the target at the end, the larger, m.
    pub offset: Spread,
    /// Largest current, A.
    pub peak_current: Spread,
    /// Plants on which it does not settle to 2 %.
    pub not_settled: usize,
    /// On which it does not stay within the tolerance.
    pub not_within_tolerance: usize,
    /// On which the actuator moves by more than one count each way in the end.
    pub not_still: usize,
    /// On which that motion is more than rest allows and goes on.
    pub hunting: usize,
    /// On which the drive stopped itself, or the run could not be made.
    pub failed: usize,
    /// Why, for the first of them.
    pub failure: Option<String>,
}

/// Drive with friction: its own, or that of the sets where it states none.
#[must_use]
pub fn with_friction(drive: &Drive) -> Drive {
    let mut drive = drive.clone();
    if drive.friction.coulomb == 0.0 {
        drive.friction.coulomb = FRICTION * drive.actuator.largest_force();
    }
    drive
}

/// Every law on every set.
///
/// * `design`: of the drive [`with_friction`]
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) without plans,
/// [`Error::Comparison`](crate::error::Error::Comparison) when runs are too long or a rival cannot be formed.
pub fn campaign(
    design: &Design,
    friction_assumed: bool,
    task: &Task,
    progress: &Progress<'_>,
) -> Result<Campaign> {
    require_comparable(design)?;
    let step = Scenario {
        target: task.distance,
        ..SCENARIOS[0]
    };
    let planned_move = Scenario {
        approach: Approach::Move,
        ..step
    };
    let period = design.drive.control.sample_time;
    let planned = design.plans()?.duration(task.distance, period) * period;
    let still_after = still_after(design, planned);
    let length = still_after + watched(design);

    let mut laws: Vec<(&'static str, Scenario, Make<'_>)> = vec![
        (
            "planned move",
            planned_move,
            Box::new(|case| Ok(Box::new(Core::new(design, &case.plant, &planned_move)?))),
        ),
        (
            "raw step",
            step,
            Box::new(|case| Ok(Box::new(Core::new(design, &case.plant, &step)?))),
        ),
        (
            "full state, same plan",
            planned_move,
            Box::new(|_| Ok(Box::new(FullState::new(design, &planned_move)?))),
        ),
    ];
    let count = Set::ALL.len() * (laws.len() + RIVALS.len()) + RIVALS.len();
    let mut tunings = Vec::new();
    let shown = |name: &str| RIVALS.iter().find(|rival| rival.0 == name);
    let rivals = laws::tuned(design, &planned_move).into_iter();
    let rivals = rivals.filter(|law| shown(law.name).is_some()).collect();
    let bench = Bench {
        scenario: planned_move,
        cases: sets::draw(design, Set::Rough, TUNED_ON, task.seed.wrapping_add(1)),
        drawn: Vec::new(),
        period,
        duration: duration(design),
        watched: 0.0,
        evaluations: task.evaluations,
        moving: Moving::Lasting,
    };
    let told = |left: usize, what: &str| progress(RIVALS.len() - left, count, what);
    bench.tune_each(rivals, &[], &told, |found| {
        let name = shown(found.name).map_or(found.name, |rival| rival.1);
        tunings.push((name, found.tuning, found.criterion * period));
        laws.push((name, planned_move, found.make));
    })?;

    let mut done = RIVALS.len();
    let mut results = Vec::new();
    for set in Set::ALL {
        let plants = sets::draw(design, set, task.plants, task.seed);
        let bound_of = |case: &Case| bound(&design.drive, &case.plant, &step);
        progress(done, count, &format!("bounds, {}", set.name()));
        let bounds: Vec<Bound> = plants.par_iter().map(bound_of).collect();
        let mut on = Vec::new();
        for (law, scenario, make) in &laws {
            progress(done, count, &format!("{law}, {}", set.name()));
            let run = |case: &Case| -> Result<Figures> {
                let mut control = make(case)?;
                let plant = (&case.plant, case.late);
                let time = Time::new(period, length);
                let judged_by = (design.motion.settling_tolerance, still_after);
                Figures::measure(control.as_mut(), plant, scenario, time, judged_by)
            };
            let figures: Vec<Result<Figures>> = plants.par_iter().map(run).collect();
            on.push(OnPlants::new(law, &figures, &bounds));
            done += 1;
        }
        let settled = bounds
            .iter()
            .map(|bound| Some(bound.as_ref().ok()?.settled));
        results.push(OnSet {
            set,
            plants: plants.len(),
            bound: Spread::of(&settled.collect::<Vec<_>>()),
            laws: on,
        });
    }
    Ok(Campaign {
        distance: task.distance,
        seed: task.seed,
        friction: design.drive.friction.coulomb,
        friction_assumed,
        planned,
        duration: length,
        still_after,
        settling_tolerance: design.motion.settling_tolerance,
        evaluations: task.evaluations,
        tunings,
        sets: results,
    })
}

/// From when on nothing may move any more, s.
///
/// * `planned`: how long the planned move takes, s
pub(super) fn still_after(design: &Design, planned: f64) -> f64 {
    planned + longer(design, STILL_AFTER)
}

/// How long that is watched, s.
pub(super) fn watched(design: &Design) -> f64 {
    longer(design, WATCHED)
}

/// The longer of a time in s, and one in periods of the slowest mode.
fn longer(design: &Design, (seconds, periods): (f64, f64)) -> f64 {
    let slowest = design.modes().first().map_or(0.0, |m| 1.0 / m.frequency_hz);
    seconds.max(periods * slowest)
}

impl OnPlants {
    fn new(law: &'static str, figures: &[Result<Figures>], bounds: &[Bound]) -> Self {
        let spread = |figure: &dyn Fn(&Figures) -> Option<f64>| {
            let each = figures.iter().map(|found| figure(found.as_ref().ok()?));
            Spread::of(&each.collect::<Vec<_>>())
        };
        let number = |is: &dyn Fn(&Figures) -> bool| {
            let found = figures.iter().flatten();
            found.filter(|figures| is(figures)).count()
        };
        let over_bound = |time: &dyn Fn(&Figures) -> Option<f64>| {
            let each = figures.iter().zip(bounds);
            let each = each.map(|(figures, bound)| times(time(figures.as_ref().ok()?), bound));
            Spread::of(&each.collect::<Vec<_>>())
        };
        let failed = |error: &&Result<Figures>| error.is_err();
        Self {
            law,
            settled: spread(&|f| f.settled),
            times_bound: over_bound(&|f| f.settled),
            within_band: spread(&|f| f.within_band),
            within_band_times_bound: over_bound(&|f| f.within_band),
            within_tolerance: spread(&|f| f.within_tolerance),
            residual: spread(&|f| Some(f.residual)),
            offset: spread(&|f| Some(f.offset)),
            peak_current: spread(&|f| Some(f.peak_current)),
            not_settled: number(&|f| f.settled.is_none()),
            not_within_tolerance: number(&|f| f.within_tolerance.is_none()),
            not_still: number(&|f| !f.still),
            hunting: number(&|f| f.hunting),
            failed: figures.iter().filter(failed).count(),
            failure: figures
                .iter()
                .find_map(|f| Some(f.as_ref().err()?.to_string())),
        }
    }
}
