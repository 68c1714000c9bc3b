//! The drive beside its rivals, on the same plants in the same run.
//!
//! Two ways of going: the raw step, and the planned move (`guide`), over the same distance on the same plants.
//! Under them: the drive as designed, and its gain on the true state; the drive with weights that are
//! tuned here, a Kalman filter of the encoder alone with the drive's gain, and collocated PD, alone, with
//! a notch, with a disturbance observer, and on references shaped by ZV, ZVD, EI and MZV.
//!
//! The named plants: as designed for, stiffness ±30 %, last load ±50 %, force constant ±10 %, the current
//! one sample late, Coulomb friction. Beside them plants that are drawn at random and that no tuning sees, in
//! which all of that comes together (`held_out`). Every law that is tuned is tuned by the same search
//! with the same budget (`tune`), on the worst of the named plants whose parameters differ; what can remove
//! friction on that plant as well.
//!
//! Runs, boxes and budgets follow from the slowest mode, the shortest time in which the motor can make the step,
//! and the control period. So no row depends on the unit of time but that of PD + MZV, whose search may end in
//! another optimum by rounding.

mod bounds;
mod encoder_observer;
mod guide;
mod held_out;
mod laws;
pub mod moves;
mod notch;
mod pd;
mod rivals;
pub mod robust;
mod shaper;
mod spread;
mod tune;

pub use bounds::bounds;
pub use encoder_observer::Settings as EncoderSettings;
pub use held_out::HeldOut;
pub use notch::Settings as NotchSettings;
pub use pd::{DisturbanceSettings, ReferenceSettings, Settings as PdSettings};
pub use rivals::{FormedRival, Rival, rival_names, tune_rivals};
pub use shaper::Shaper;
pub use spread::Spread;

use crate::design::{Design, settling_tolerance};
use crate::drive::{Drive, ObserverMethod, PlantFile, Weights};
use crate::error::{Error, Result};
use crate::output::Progress;
use crate::simulate::metrics::{Frame, Metrics};
use crate::simulate::scenario::{Approach, SCENARIOS, Scenario};
use crate::simulate::watch::measure_loop;
use crate::simulate::{Instant, Time, follow};
use laws::{Make, Tuned};
use rayon::prelude::*;
use serde::Serialize;
use tune::{Criterion, Moving};

/// One plant of the comparison.
#[derive(Clone, Debug)]
pub struct Case {
    /// What differs from the drive file.
    pub name: String,
    /// The plant.
    pub plant: PlantFile,
    /// By how many control periods the current comes late.
    pub late: usize,
    /// Whether the rivals are tuned on it.
    tuned: bool,
}

/// A law's figures on one plant.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Which plant.
    pub case: String,
    /// Whether every law that is tuned is tuned on it.
    pub tuned_on: bool,
    /// The figures; none when the run could not be made.
    pub metrics: Option<Metrics>,
    /// Why it could not.
    pub failure: Option<String>,
}

/// All laws, by both ways of going.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// By a raw step.
    pub steps: Vec<Row>,
    /// By planned moves: on the same plan with the same friction fed forward, and behind input shapers on ramps of
    /// their own.
    pub moves: Vec<Row>,
}

/// A law on all plants.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Which law.
    pub law: &'static str,
    /// What it was tuned to.
    pub tuning: Tuning,
    /// What the tuning has made least: the criterion of the worst plant, s; none where nothing was tuned.
    pub criterion: Option<f64>,
    /// One for each case.
    pub outcomes: Vec<Outcome>,
    /// Over the plants that were drawn at random.
    pub held_out: HeldOut,
}

/// What a law was tuned to.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Tuning {
    /// As designed.
    Design,
    /// A PD law.
    Pd(PdSettings),
    /// The filter on the encoder.
    Encoder(EncoderSettings),
    /// The drive's own law, by its weights.
    Weights(LawSettings),
    /// The same, its gain itself.
    Gain(LawSettings),
}

/// What the drive's own law goes by: its gain or its weights, that of the current being the drive's, and its observer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawSettings {
    /// Gains in A/m or weights in 1/m², actuator first.
    pub position: Vec<f64>,
    /// Gains in A s/m or weights in s²/m².
    pub velocity: Vec<f64>,
    /// Of the observer, see [`ObserverSettings`](crate::drive::ObserverSettings).
    pub load_force_ratio: f64,
    /// Of the observer, 1/s.
    pub disturbance_rate: f64,
}

impl LawSettings {
    /// A drive with this observer.
    ///
    /// * `weights`: what position and velocity are of it
    fn put_into(&self, drive: &Drive, weights: Weights) -> Drive {
        let mut drive = drive.clone();
        drive.cost.weights = weights;
        drive.observer.design = ObserverMethod::Kalman;
        drive.observer.load_force_ratio = self.load_force_ratio;
        drive.observer.disturbance_rate = self.disturbance_rate;
        drive
    }
}

/// How much is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Evaluations for each law that is tuned; each is a run on every plant that it is tuned on.
    pub evaluations: usize,
    /// Plants drawn at random.
    pub plants: usize,
}

impl Default for Effort {
    fn default() -> Self {
        Self {
            evaluations: 1200,
            plants: 50,
        }
    }
}

/// Friction of the friction case where the drive has none, as a share of the motor's force.
const FRICTION: f64 = 0.0155;

/// Length of the runs: in periods of the slowest mode, in the shortest times in which the motor can make the
/// step, and in control periods, whichever is longest.
const PERIODS: f64 = 15.0;
const SHORTEST_MOVES: f64 = 15.0;
const SAMPLES: f64 = 200.0;
/// How long a loop is watched after that, over that length.
const WATCHED: f64 = 2.4;
/// Longest runs, in control periods: thousands of runs are made.
const LONGEST: f64 = 50_000.0;
/// Longest runs, in control periods, of which as many are made as is asked for.
const FULL: f64 = 2_500.0;

/// The step that is compared: the paper's first.
fn scenario() -> &'static Scenario {
    &SCENARIOS[0]
}

/// Coulomb friction of the friction case, N: the drive's own, or a share of the motor's force where it has
/// none.
fn coulomb(drive: &Drive) -> f64 {
    let own = drive.friction.coulomb;
    if own > 0.0 {
        own
    } else {
        FRICTION * drive.actuator.largest_force()
    }
}

/// The plants.
#[must_use]
pub fn cases(design: &Design) -> Vec<Case> {
    let mut nominal = PlantFile::from(&design.drive);
    nominal.friction.coulomb = 0.0;
    let mut cases = Vec::new();
    let mut case = |name: &str, late, tuned, change: &dyn Fn(&mut PlantFile)| {
        let mut plant = nominal.clone();
        change(&mut plant);
        cases.push(Case {
            name: name.into(),
            plant,
            late,
            tuned,
        });
    };
    let stiffness = |factor: f64| {
        move |plant: &mut PlantFile| {
            for load in &mut plant.loads {
                load.stiffness *= factor;
            }
        }
    };
    let last_load = |factor: f64| {
        move |plant: &mut PlantFile| {
            if let Some(load) = plant.loads.last_mut() {
                load.mass *= factor;
            }
        }
    };
    let force = |factor: f64| move |plant: &mut PlantFile| plant.actuator.force_constant *= factor;
    let coulomb = coulomb(&design.drive);
    let unit = design.drive.kind.units().force;
    case("nominal", 0, true, &|_| ());
    case("k +30 %", 0, true, &stiffness(1.3));
    case("k -30 %", 0, true, &stiffness(0.7));
    case("load +50 %", 0, true, &last_load(1.5));
    case("load -50 %", 0, true, &last_load(0.5));
    case("k_f +10 %", 0, true, &force(1.1));
    case("k_f -10 %", 0, true, &force(0.9));
    case("1 sample late", 1, false, &|_| ());
    case(
        &format!("friction {coulomb:.3} {unit}"),
        0,
        false,
        &|plant| {
            plant.friction.coulomb = coulomb;
        },
    );
    cases
}

/// Whether the runs are short enough to make thousands of them.
///
/// # Errors
/// [`Error::Comparison`] when they are not.
pub fn require_comparable(design: &Design) -> Result<()> {
    require_short(design, duration(design))
}

/// The same of runs of another length, s.
fn require_short(design: &Design, duration: f64) -> Result<()> {
    let period = design.drive.control.sample_time;
    if duration > LONGEST * period {
        return Err(Error::Comparison(format!(
            "a run of {duration:.1} s ({PERIODS} periods of the slowest mode, {SHORTEST_MOVES} times the \
             shortest move) takes {:.0} control periods: at most {LONGEST} can be compared",
            duration / period
        )));
    }
    Ok(())
}

/// All laws on all plants. Laws behind input shapers are tuned once, for the step; all others for either way.
///
/// * `progress`: told of each law as its turn comes, and how far its tuning is
///
/// # Errors
/// [`Error::Design`] when there are no planned moves, [`Error::Comparison`] when the runs are too long, or no law can
/// be formed in the whole box of a rival.
pub fn compare(design: &Design, effort: Effort, progress: &Progress<'_>) -> Result<Comparison> {
    require_comparable(design)?;
    let planned = Scenario {
        approach: Approach::Move,
        ..*scenario()
    };
    let mut bench = Bench::new(design, effort);
    let mut shaped = Vec::new();
    let half = laws::tuned(design, scenario()).len() + laws::designed(design, scenario()).len();
    let steps = bench.rows(
        design,
        scenario(),
        &|done, what| progress(done, 2 * half, what),
        &mut shaped,
    )?;
    bench.go_by(design, &planned);
    let moves = bench.rows(
        design,
        &planned,
        &|done, what| progress(half + done, 2 * half, &format!("planned move, {what}")),
        &mut shaped,
    )?;
    Ok(Comparison { steps, moves })
}

/// What a law was tuned to before: its name, the point and its criterion in control periods.
type Known = (&'static str, Vec<f64>, f64);

/// A law that has been tuned.
struct Found<'a> {
    name: &'static str,
    shaped: bool,
    tuning: Tuning,
    /// The same as a point of its box, and the criterion there, control periods.
    point: Vec<f64>,
    criterion: f64,
    make: Make<'a>,
}

/// The plants, and how long a run takes on them.
struct Bench {
    scenario: Scenario,
    cases: Vec<Case>,
    drawn: Vec<Case>,
    /// s.
    period: f64,
    /// Of a run, and of a run that is watched, s.
    duration: f64,
    watched: f64,
    evaluations: usize,
    /// What a law that is tuned is punished for at the end of a run.
    moving: Moving,
}

impl Bench {
    fn new(design: &Design, effort: Effort) -> Self {
        let duration = duration(design);
        Self {
            scenario: *scenario(),
            cases: cases(design),
            drawn: held_out::cases(design, coulomb(&design.drive), effort.plants),
            period: design.drive.control.sample_time,
            duration,
            watched: (1.0 + WATCHED) * duration,
            evaluations: evaluations(design, effort),
            moving: Moving::Any,
        }
    }

    /// From now on by planned moves, on plants with the friction that the drive feeds forward.
    fn go_by(&mut self, design: &Design, scenario: &Scenario) {
        self.scenario = *scenario;
        self.moving = Moving::Lasting;
        for case in &mut self.cases {
            let friction = &mut case.plant.friction.coulomb;
            *friction = friction.max(design.drive.friction.coulomb);
        }
    }

    /// All laws on all plants.
    ///
    /// * `progress`: told how many are done, and what is done just now
    /// * `shaped`: what those behind input shapers were tuned to, if they were, and afterwards are
    fn rows(
        &self,
        design: &Design,
        scenario: &Scenario,
        progress: &dyn Fn(usize, &str),
        shaped: &mut Vec<Known>,
    ) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        for (law, make) in laws::designed(design, scenario) {
            progress(rows.len(), law);
            rows.push(self.row(law, Tuning::Design, None, &make));
        }
        let tuned = laws::tuned(design, scenario);
        let count = rows.len() + tuned.len();
        let told = |left: usize, what: &str| progress(count - left, what);
        let known = shaped.clone();
        self.tune_each(tuned, &known, &told, |found| {
            let criterion = found.criterion * self.period;
            rows.push(self.row(found.name, found.tuning, Some(criterion), &found.make));
            if found.shaped {
                shaped.push((found.name, found.point, found.criterion));
            }
        })?;
        Ok(rows)
    }

    /// A law's figures on one plant.
    fn judge(&self, make: &Make<'_>, case: &Case) -> Outcome {
        let result = make(case).and_then(|mut control| {
            let plant = (&case.plant, case.late);
            let time = (self.period, self.duration, self.watched);
            let tolerance = settling_tolerance(case.plant.encoder.resolution);
            measure_loop(control.as_mut(), plant, &self.scenario, time, tolerance)
        });
        Outcome {
            case: case.name.clone(),
            tuned_on: case.tuned,
            failure: result.as_ref().err().map(ToString::to_string),
            metrics: result.ok(),
        }
    }

    /// The best point of a law's box, and its criterion in control periods.
    ///
    /// * `progress`: told of the evaluations made, and of how many
    fn tune(&self, law: &Tuned<'_>, progress: &dyn Fn(usize, usize)) -> (Vec<f64>, f64) {
        let of = self.evaluations;
        let cost = |point: &[f64]| self.worst(law, point);
        tune::search(&law.space, of, &cost, &|made| progress(made, of))
    }

    /// Tunes laws one after the other; those that can be PD itself also start from what plain PD has come to.
    ///
    /// * `known`: what some of them have been tuned to before
    /// * `progress`: told how many laws are left, and what is done just now
    /// * `found`: gets each law
    ///
    /// # Errors
    /// [`Error::Comparison`] when a law cannot be formed in its whole box.
    fn tune_each<'a>(
        &self,
        laws: Vec<Tuned<'a>>,
        known: &[Known],
        progress: &dyn Fn(usize, &str),
        mut found: impl FnMut(Found<'a>),
    ) -> Result<()> {
        let mut plain: Option<Vec<f64>> = None;
        let count = laws.len();
        for (done, mut law) in laws.into_iter().enumerate() {
            let name = law.name;
            if let (Some(plain), Some(neutral)) = (&plain, &law.neutral) {
                law.space.starts.push([&plain[..], neutral].concat());
            }
            let before = known.iter().find(|(known, ..)| *known == name);
            let (point, criterion) = match before {
                Some((_, point, criterion)) => (point.clone(), *criterion),
                None => self.tune(&law, &|made, of| {
                    progress(count - done, &format!("{name}, {made} of {of}"));
                }),
            };
            if law.neutral.is_some() {
                plain.get_or_insert_with(|| point.clone());
            }
            let (tuning, make) = (law.form)(&point).map_err(|error| {
                Error::Comparison(format!("{name} cannot be formed for this drive: {error}"))
            })?;
            found(Found {
                name,
                shaped: law.shaped,
                tuning,
                point,
                criterion,
                make,
            });
        }
        Ok(())
    }

    fn row(
        &self,
        law: &'static str,
        tuning: Tuning,
        criterion: Option<f64>,
        make: &Make<'_>,
    ) -> Row {
        let on = |cases: &[Case]| -> Vec<Outcome> {
            let outcomes = cases.par_iter().map(|case| self.judge(make, case));
            outcomes.collect()
        };
        Row {
            law,
            tuning,
            criterion,
            outcomes: on(&self.cases),
            held_out: HeldOut::new(&on(&self.drawn)),
        }
    }

    /// The criterion of the worst plant that a law is tuned on, in control periods; a law that cannot be formed,
    /// or whose motion ends beyond all bounds, is worse than any other.
    fn worst(&self, law: &Tuned<'_>, point: &[f64]) -> f64 {
        let lost = 10.0 * self.duration / self.period;
        let Ok((_, make)) = (law.form)(point) else {
            return lost;
        };
        let tuned = self.cases.iter().filter(|case| {
            case.tuned || (law.removes_friction && case.plant.friction.coulomb > 0.0)
        });
        let each = tuned.map(|case| {
            let time = Time::new(self.period, self.duration);
            let mut criterion =
                Criterion::new(Frame::on(&case.plant, &self.scenario, time), self.moving);
            let look = |instant: &Instant<'_>| criterion.look(&instant.seen());
            let result = make(case).and_then(|mut control| {
                let plant = (&case.plant, case.late);
                follow(control.as_mut(), plant, &self.scenario, time, look)
            });
            match result {
                Ok(None) => criterion.periods(),
                _ => lost,
            }
        });
        each.fold(0.0, f64::max)
    }
}

/// Evaluations for each law: as asked for, fewer in proportion where the runs are long.
#[must_use]
pub fn evaluations(design: &Design, effort: Effort) -> usize {
    let periods = duration(design) / design.drive.control.sample_time;
    let share = (FULL / periods).min(1.0);
    (share * effort.evaluations as f64).ceil() as usize
}

/// Length of the runs, s: the longest of 15 periods of the slowest mode, 15 times the shortest move
/// `2 √(s M / F)` of a rigid drive over the step `s`, and 200 control periods.
#[must_use]
pub fn duration(design: &Design) -> f64 {
    duration_over(design, scenario().target)
}

/// The same over another distance, m.
fn duration_over(design: &Design, distance: f64) -> f64 {
    let drive = &design.drive;
    let slowest = design.modes().first().map_or(1.0, |mode| mode.frequency_hz);
    let acceleration = drive.actuator.largest_force() / drive.total_mass();
    let shortest = 2.0 * (distance.abs() / acceleration).sqrt();
    (PERIODS / slowest)
        .max(SHORTEST_MOVES * shortest)
        .max(SAMPLES * drive.control.sample_time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Weights;
    use crate::output::unwatched;

    fn row<'a>(rows: &'a [Row], name: &str) -> &'a Row {
        rows.iter().find(|row| row.law == name).unwrap()
    }

    /// Settling time in ms and overshoot.
    fn settled(row: &Row, case: &str) -> (Option<f64>, f64) {
        let outcome = row.outcomes.iter().find(|outcome| outcome.case == case);
        let metrics = outcome.unwrap().metrics.clone().unwrap();
        (metrics.settling_time.map(|t| 1e3 * t), metrics.overshoot)
    }

    /// Another program computed full-state feedback, and searched PD for its worst settling time with another
    /// global method: the same figures for the first, and as good a worst case for the second.
    #[test]
    fn figures_are_those_computed_elsewhere() {
        let design = Design::new(&Drive::default_drive()).unwrap();
        let effort = Effort {
            evaluations: 800,
            plants: 4,
        };
        let bench = Bench::new(&design, effort);
        let mut rows = Vec::new();
        for (law, make) in laws::designed(&design, scenario()) {
            rows.push(bench.row(law, Tuning::Design, None, &make));
        }
        for law in laws::tuned(&design, scenario()) {
            if ["PD", "PD + notch"].contains(&law.name) {
                let (point, criterion) = bench.tune(&law, &|_, _| ());
                let (tuning, make) = (law.form)(&point).unwrap();
                rows.push(bench.row(law.name, tuning, Some(criterion), &make));
            }
        }
        for (case, time, overshoot) in [
            ("nominal", 139.0, 0.6),
            ("k +30 %", 130.0, 0.3),
            ("k -30 %", 94.0, 1.5),
            ("load +50 %", 103.0, 1.0),
            ("k_f -10 %", 136.0, 1.6),
        ] {
            let (settled, beyond) = settled(row(&rows, "full state"), case);
            assert!(
                (settled.unwrap() - time).abs() <= 1.0,
                "{case}: {settled:?}"
            );
            assert!((beyond - overshoot).abs() < 0.1, "{case}: {beyond}");
        }
        let worst = |name: &str| {
            let cases = bench.cases.iter().filter(|case| case.tuned);
            let times = cases.map(|case| settled(row(&rows, name), &case.name));
            times.fold((0.0, 0.0), |(most, beyond), (time, overshoot)| {
                (f64::max(most, time.unwrap()), f64::max(beyond, overshoot))
            })
        };
        let (pd, overshoot) = worst("PD");
        assert!(pd <= 190.0 && overshoot <= 2.2, "{pd} {overshoot}");
        let (notch, _) = worst("PD + notch");
        assert!(notch <= 185.0, "{notch}");
        // Friction stops a PD law short of its target; the drive removes it.
        let friction = &rows[0].outcomes.last().unwrap().case;
        assert_eq!(settled(row(&rows, "PD"), friction).0, None);
        assert!(settled(row(&rows, "drive"), friction).0.unwrap() < 200.0);
    }

    /// The same physics with another unit of time, `factor` of which make a second.
    fn in_another_unit(drive: &Drive, factor: f64) -> Drive {
        let mut drive = drive.clone();
        // Per unit of time, and per unit of time squared.
        let (once, twice) = (1.0 * factor, factor * factor);
        drive.actuator.force_constant *= twice;
        drive.friction.coulomb *= twice;
        for load in &mut drive.loads {
            load.stiffness *= twice;
            load.damping *= once;
        }
        drive.control.sample_time /= once;
        drive.control.disturbance_cutoff *= once;
        drive.control.reaction_force_cutoff *= once;
        drive.observer.disturbance_rate *= once;
        if let Weights::Given { velocity, .. } = &mut drive.cost.weights {
            for weight in velocity {
                *weight /= twice;
            }
        }
        drive.motion = crate::drive::StatedMotion::default();
        drive
    }

    /// What a second is must not change who wins: every figure is the same in control periods.
    #[test]
    fn the_unit_of_time_changes_nothing() {
        let effort = Effort {
            evaluations: 30,
            plants: 3,
        };
        let mut own = Drive::default_drive();
        own.motion = crate::drive::StatedMotion::default();
        // How well friction that is not stated is seen at the start is a matter of seconds.
        own.friction.coulomb = 0.1;
        let other = in_another_unit(&own, 10.0);
        let rows = [own, other].map(|drive| {
            let mut design = Design::new(&drive).unwrap();
            // That a machine is to be still after a second is a matter of seconds.
            design.motion.settling = 800.0 * drive.control.sample_time;
            compare(&design, effort, &unwatched).unwrap().steps
        });
        let close = |what: &str, own: Option<f64>, other: Option<f64>, within: f64| {
            let same = match (own, other) {
                (Some(own), Some(other)) => (own - other).abs() <= within,
                (own, other) => own == other,
            };
            assert!(same, "{what}: {own:?} {other:?}");
        };
        for (own, other) in rows[0].iter().zip(&rows[1]) {
            let law = own.law;
            let in_ms = |time: Option<f64>| time.map(|time| 1e3 * time);
            let in_tenths = |time: Option<f64>| time.map(|time| 1e4 * time);
            close(law, in_ms(own.criterion), in_tenths(other.criterion), 1.0);
            for (own, other) in own.outcomes.iter().zip(&other.outcomes) {
                let what = format!("{law}, {}", own.case);
                let (own, other) = (
                    own.metrics.as_ref().unwrap(),
                    other.metrics.as_ref().unwrap(),
                );
                let times = (in_ms(own.settling_time), in_tenths(other.settling_time));
                close(&what, times.0, times.1, 1.01);
                assert_eq!(own.end.state, other.end.state, "{what}");
                assert!((own.overshoot - other.overshoot).abs() < 0.1, "{what}");
            }
            let (own, other) = (&own.held_out, &other.held_out);
            assert_eq!(own.not_settled, other.not_settled, "{law}");
            close(law, in_ms(own.median), in_tenths(other.median), 1.01);
            close(law, in_ms(own.worst), in_tenths(other.worst), 1.01);
        }
    }
}
