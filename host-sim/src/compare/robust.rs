//! Tuning the drive for plants that are not known better than a set of them.
//!
//! ```text
//! drive file -> design -> families, a box each ----+-> search -> tuned laws -+-> runs -> figures
//! ranges -> plants, one seed --> those tuned on ---+                         |
//!                           `-> those never seen ----------------------------+
//! ```
//!
//! What is searched of the drive is its gain itself, two entries for each mass, the two densities of its observer and,
//! where it goes by planned moves, the share of the current limit that plans may use: less current makes a longer plan,
//! which leaves less to ring where the plant is another one. Weights of a performance index would not do: no
//! diagonal ones lead to a PD law, and a PD law is a serious rival. The rivals beside it (`families`) are tuned by
//! the same search with the same budget on the same plants, and go the same way.
//!
//! Of one plant the criterion is that of `tune` beside this, and what the current does at rest:
//!
//! ```text
//! c = mean over b of t_b + h + T / 10 (σ_i / σ_0 − 1)⁺       J = ½ (mean of all c + mean of the worst quarter)
//! ```
//!
//! with `T` the length of the run, `σ_i` the spread of the current in the last fifth of it and `σ_0` 2.5 % of the current
//! limit. A law of the drive that is not stable with one more control period of delay, or that a check of the design
//! refuses, is worse than any other. Friction is fed forward as the drive file states it, or as it held the actuator when
//! the signs were proven: it is the first move that is tuned, before anything is learned.

mod drive_file;
mod families;
mod plants;

pub use drive_file::drive_file;
pub use plants::{Known, Ranges};

use super::laws::Make;
use super::moves::{Figures, still_after, watched};
use super::tune::{self, Criterion, Moving};
use super::{Case, Spread, Tuning, duration_over, require_comparable, require_short};
use crate::design::Design;
use crate::design::assessment::require_sound;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::output::Progress;
use crate::simulate::metrics::Frame;
use crate::simulate::scenario::{Approach, SCENARIOS, Scenario};
use crate::simulate::{Core, Instant, Time, follow};
use families::{Family, Plans};
use rayon::prelude::*;
use serde::Serialize;

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// How the drive is sent.
    pub approach: Approach,
    /// How far, m.
    pub distance: f64,
    /// What the plants are drawn from.
    pub ranges: Ranges,
    /// How many a law is tuned on.
    pub tuned_on: usize,
    /// How many it is judged on.
    pub judged_on: usize,
    /// Of all that is drawn.
    pub seed: u64,
    /// For each law that is tuned; each is a run on every plant that it is tuned on.
    pub evaluations: usize,
}

/// What came of it, SI units.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    /// The drive as designed, the drive tuned, and its rivals.
    pub laws: Vec<Judged>,
    /// The drive with what was found for it.
    #[serde(skip)]
    pub drive: Drive,
}

/// A law on the plants that no tuning saw.
#[derive(Clone, Debug, Serialize)]
pub struct Judged {
    /// Which law.
    pub law: &'static str,
    /// What it was tuned to.
    pub tuning: Tuning,
    /// Share of the current limit that its plans use, and how long the planned move takes, s; none without plans.
    pub plan: Option<(f64, f64)>,
    /// What the tuning has made least, `J`, s; none where nothing was tuned.
    pub criterion: Option<f64>,
    /// Settling time of the controlled mass to 2 %, s: after which it stays within the band, whatever moves within it.
    pub settled: Spread,
    /// The same where all is at rest at the end, s; a load that friction no longer lets the actuator damp is not.
    pub settled_and_at_rest: Spread,
    /// Largest current, A.
    pub peak_current: Spread,
    /// Plants on which it does not settle to 2 %.
    pub not_settled: usize,
    /// On which it does not, or is not at rest at the end.
    pub not_at_rest: usize,
    /// On which its actuator goes on moving by more than what counts as rest.
    pub hunting: usize,
    /// On which the drive stopped itself, or the run could not be made.
    pub failed: usize,
    /// Why, for the first of them.
    pub failure: Option<String>,
}

/// Length of the runs that a law is tuned by, over that of a comparison.
const TUNED_FOR: f64 = 0.6;
/// Share of the worst plants that count once more.
const WORST: f64 = 0.25;
/// Last part of a run in which the current is looked at, as a share of it, and what it may do there, over the current
/// limit.
const IDLE: f64 = 0.2;
const IDLE_CURRENT: f64 = 0.025;

/// Tunes the drive and its rivals, and judges all of them.
///
/// * `progress`: told of each law as its turn comes, and how far its tuning is
///
/// # Errors
/// [`Error::Design`] without plans, or when the checks of the design refuse what was found; [`Error::Comparison`] when
/// the runs are too long or a rival cannot be formed.
pub fn tune(design: &Design, task: &Task, progress: &Progress<'_>) -> Result<Found> {
    require_comparable(design)?;
    let name = match task.approach {
        Approach::Step => "step",
        Approach::Move => "move",
    };
    let scenario = Scenario {
        approach: task.approach,
        target: task.distance,
        name,
        linear_title: name,
        ..SCENARIOS[0]
    };
    let plans = match task.approach {
        Approach::Step => {
            design.plans()?;
            Plans::own(design)
        }
        Approach::Move => {
            progress(0, 1, "plans");
            Plans::of_less_current(design)?
        }
    };
    let bench = Bench {
        scenario,
        period: design.drive.control.sample_time,
        tuned_for: tuned_for(design, task, &plans)?,
        idle: IDLE_CURRENT * design.drive.actuator.current_limit,
        tuned_on: plants::draw(
            &design.drive,
            &task.ranges,
            plants::Stream::TunedOn,
            task.tuned_on,
            task.seed,
        ),
        judged_on: plants::draw(
            &design.drive,
            &task.ranges,
            plants::Stream::JudgedOn,
            task.judged_on,
            task.seed,
        ),
    };
    let families = families::all(design, &plans, &bench.scenario);
    let count = families.len() + 1;
    progress(0, count, "as designed");
    let make: Make<'_> = Box::new(|case| Ok(Box::new(Core::new(design, &case.plant, &scenario)?)));
    let mut laws = vec![bench.judge(design, "drive, as designed", Tuning::Design, &make)?];
    let mut before: Vec<(&'static str, Vec<f64>)> = Vec::new();
    let mut tuned = None;
    for (done, mut family) in families.into_iter().enumerate() {
        let told = |made: usize| {
            let what = format!("{}, {made} of {}", family.name, task.evaluations);
            progress(done + 1, count, &what);
        };
        if let Some(part) = &family.contains {
            let points = before.iter().filter(|(name, _)| *name == part.name);
            let points: Vec<_> = points.map(|(_, point)| part.widened(point)).collect();
            family.space.starts.extend(points);
        }
        let cost = |point: &[f64]| bench.criterion(&family, point);
        let (point, criterion) = tune::search(&family.space, task.evaluations, &cost, &told);
        let law = (family.form)(&point).map_err(|error| {
            Error::Comparison(format!(
                "{} cannot be formed for this drive: {error}",
                family.name
            ))
        })?;
        let mut judged = match law.drive {
            // As it is sold: by its own plans, with its own limits.
            Some(drive) => {
                let design = Design::new(&drive)?.with_plans_of(law.design);
                if family.name == families::DRIVE {
                    require_sound(&design)?;
                }
                let make: Make<'_> =
                    Box::new(|case| Ok(Box::new(Core::new(&design, &case.plant, &scenario)?)));
                let judged = bench.judge(&design, family.name, law.tuning, &make)?;
                if family.name == families::DRIVE {
                    if judged.failed == bench.judged_on.len() {
                        let why = judged.failure.unwrap_or_default();
                        return Err(Error::Comparison(format!(
                            "nothing was found that runs on a single plant: {why}"
                        )));
                    }
                    tuned = Some(drive);
                }
                judged
            }
            None => bench.judge(law.design, family.name, law.tuning, &law.make)?,
        };
        judged.criterion = Some(criterion * bench.period);
        laws.push(judged);
        before.push((family.name, point));
    }
    let drive = tuned.unwrap_or_else(|| design.drive.clone());
    Ok(Found { laws, drive })
}

/// Length of the runs that laws are tuned by, s; at least half of it comes after the longest plan.
///
/// # Errors
/// [`Error::Comparison`] where that is too long.
fn tuned_for(design: &Design, task: &Task, plans: &Plans) -> Result<f64> {
    let period = design.drive.control.sample_time;
    let alone = TUNED_FOR * duration_over(design, task.distance);
    let longest = match task.approach {
        Approach::Step => 0.0,
        Approach::Move => period * plans.longest(task.distance, period),
    };
    let whole = alone.max(longest + 0.5 * alone);
    require_short(design, whole)?;
    Ok(whole)
}

/// The current at the end of a run, taken while it passes.
struct Restless {
    /// Periods that are passed over.
    before: usize,
    count: f64,
    sum: f64,
    squares: f64,
}

impl Restless {
    fn new(time: Time) -> Self {
        Self {
            before: ((1.0 - IDLE) * time.periods as f64) as usize,
            count: 0.0,
            sum: 0.0,
            squares: 0.0,
        }
    }

    /// * `current`: of the next period, A
    fn look(&mut self, current: f64) {
        if self.before > 0 {
            self.before -= 1;
            return;
        }
        self.count += 1.0;
        self.sum += current;
        self.squares += current * current;
    }

    /// By how much its deviation is more than it may be, as a share of that.
    ///
    /// * `allowed`: A rms
    fn beyond(&self, allowed: f64) -> f64 {
        let count = self.count.max(1.0);
        let variance = self.squares / count - (self.sum / count).powi(2);
        (variance.max(0.0).sqrt() / allowed - 1.0).max(0.0)
    }
}

/// The plants, and how long a run takes on them.
struct Bench {
    scenario: Scenario,
    /// s.
    period: f64,
    /// s.
    tuned_for: f64,
    /// What the current may do at rest, A rms.
    idle: f64,
    tuned_on: Vec<Case>,
    judged_on: Vec<Case>,
}

impl Bench {
    /// `J` of a point, control periods.
    fn criterion(&self, family: &Family<'_>, point: &[f64]) -> f64 {
        let length = self.tuned_for / self.period;
        let lost = 10.0 * length;
        let Ok(law) = (family.form)(point) else {
            return lost;
        };
        let of_plant = |case: &Case| {
            let time = Time::new(self.period, self.tuned_for);
            let frame = Frame::on(&case.plant, &self.scenario, time);
            let mut criterion = Criterion::new(frame, Moving::Lasting);
            let mut restless = Restless::new(time);
            let look = |instant: &Instant<'_>| {
                let seen = instant.seen();
                restless.look(seen.command);
                criterion.look(&seen);
            };
            let result = (law.make)(case).and_then(|mut control| {
                let plant = (&case.plant, case.late);
                follow(control.as_mut(), plant, &self.scenario, time, look)
            });
            match result {
                Ok(None) => criterion.periods() + 0.1 * length * restless.beyond(self.idle),
                _ => 5.0 * length,
            }
        };
        let mut each: Vec<f64> = self.tuned_on.iter().map(of_plant).collect();
        each.sort_by(|a, b| b.total_cmp(a));
        let worst = (WORST * each.len() as f64).ceil() as usize;
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        0.5 * (mean(&each) + mean(&each[..worst]))
    }

    /// A law on the plants that no tuning saw.
    ///
    /// * `design`: whose plans it goes by
    fn judge(
        &self,
        design: &Design,
        law: &'static str,
        tuning: Tuning,
        make: &Make<'_>,
    ) -> Result<Judged> {
        let planned = match self.scenario.approach {
            Approach::Step => None,
            Approach::Move => {
                let periods = design.plans()?.duration(self.scenario.target, self.period);
                Some((design.motion.current_share, periods * self.period))
            }
        };
        let still = still_after(design, planned.map_or(0.0, |(_, time)| time));
        let length = still + watched(design);
        let run = |case: &Case| -> Result<Figures> {
            let mut control = make(case)?;
            let plant = (&case.plant, case.late);
            let time = Time::new(self.period, length);
            let judged_by = (design.motion.settling_tolerance, still);
            Figures::measure(control.as_mut(), plant, &self.scenario, time, judged_by)
        };
        let figures: Vec<Result<Figures>> = self.judged_on.par_iter().map(run).collect();
        let spread = |figure: &dyn Fn(&Figures) -> Option<f64>| {
            let each = figures.iter().map(|found| figure(found.as_ref().ok()?));
            Spread::of(&each.collect::<Vec<_>>())
        };
        let number =
            |is: &dyn Fn(&Figures) -> bool| figures.iter().flatten().filter(|f| is(f)).count();
        let failed = figures.iter().filter(|found| found.is_err()).count();
        Ok(Judged {
            law,
            tuning,
            plan: planned,
            criterion: None,
            settled: spread(&|f| f.within_band),
            settled_and_at_rest: spread(&|f| f.settled),
            peak_current: spread(&|f| Some(f.peak_current)),
            not_settled: failed + number(&|f| f.within_band.is_none()),
            not_at_rest: failed + number(&|f| f.settled.is_none()),
            hunting: number(&|f| f.hunting),
            failed,
            failure: figures
                .iter()
                .find_map(|f| Some(f.as_ref().err()?.to_string())),
        })
    }
}
