//! A run, and what comes after it.
//!
//! Friction can hold an actuator at rest for a second while the disturbance state winds up, and let it go again:
//! a drive that hunts looks settled in a run that ends too soon. So the loop runs on for a while after the
//! experiment, and what moves at its end is what moves at the end of the time it was watched.

use super::ending::{Ending, EndingMeter};
use super::metrics::{Frame, Meter, Metrics, Seen, Stay, both_within, controlled, within};
use super::scenario::Scenario;
use super::sequence::{AT_THE_ORIGIN, MoveSequence, follow_moves, simulate_moves};
use super::{Control, Instant, Law, Run, Time, control, follow, simulate};
use crate::design::Design;
use crate::drive::PlantFile;
use crate::error::Result;
use arso_core::Fault;

/// How long the loop is watched after the experiment, s, and in how many control periods at most.
pub const WATCHED: f64 = 3.0;
const LONGEST: f64 = 100_000.0;

/// One experiment, and its figures with the end as it is after the loop has run on.
///
/// Forces from outside that begin after the experiment stay away. A fault after it is the run's fault.
///
/// # Errors
/// As [`simulate`].
pub fn watched(
    design: &Design,
    plant: &PlantFile,
    scenario: &Scenario,
    law: Law,
    duration: f64,
) -> Result<(Run, Metrics)> {
    let plant = without_later_forces(plant, duration);
    let period = design.drive.control.sample_time;
    let run = simulate(design, &plant, scenario, law, duration + after(period))?;
    Ok(judged(run, (duration / period).round() as usize))
}

/// The figures of [`watched`], without keeping a sample.
///
/// # Errors
/// As [`simulate`].
pub fn measure_watched(
    design: &Design,
    plant: &PlantFile,
    scenario: &Scenario,
    law: Law,
    duration: f64,
) -> Result<Metrics> {
    let plant = without_later_forces(plant, duration);
    let period = design.drive.control.sample_time;
    let mut control = control(design, &plant, scenario, law)?;
    measure_loop(
        control.as_mut(),
        (&plant, 0),
        scenario,
        (period, duration, duration + after(period)),
        design.motion.settling_tolerance,
    )
}

/// The figures of an experiment under any law, whose loop is watched after it.
///
/// * `plant`: what is there, and the control periods by which the current comes late
/// * `time`: control period, duration of the experiment, and until when the loop is watched, s
/// * `tolerance`: how far from the target counts as there, m
///
/// # Errors
/// [`Error::Simulation`](crate::error::Error::Simulation) when the motion or a command is no longer finite.
pub(crate) fn measure_loop(
    control: &mut dyn Control,
    (file, late): (&PlantFile, usize),
    scenario: &Scenario,
    (period, duration, watched): (f64, f64, f64),
    tolerance: f64,
) -> Result<Metrics> {
    let time = Time::new(period, watched);
    let whole = Frame::on(file, scenario, time).with_tolerance(tolerance);
    let mut meter = WatchMeter::new(whole, Time::new(period, duration));
    let look = |instant: &Instant<'_>| meter.look(&instant.seen());
    let fault = follow(control, (file, late), scenario, time, look)?;
    Ok(meter.metrics(fault))
}

/// How long a loop is watched after the experiment, s.
pub(crate) fn after(period: f64) -> f64 {
    WATCHED.min(LONGEST * period)
}

/// Figures of a run that is watched after the experiment, taken while it passes.
#[derive(Clone, Debug)]
pub(super) struct WatchMeter {
    whole: Frame,
    periods: usize,
    samples: usize,
    experiment: Meter,
    /// Of all of it; not used where nothing comes after the experiment, whose own say the same.
    ending: EndingMeter,
    in_tolerance: Stay,
}

impl WatchMeter {
    /// * `whole`: all of the run
    /// * `experiment`: the part of it that comes before
    pub(super) fn new(whole: Frame, experiment: Time) -> Self {
        let periods = experiment.periods.min(whole.periods);
        let experiment = Time {
            periods,
            ..experiment
        };
        Self {
            whole,
            periods,
            samples: 0,
            experiment: Meter::new(whole.of_periods(experiment)),
            ending: EndingMeter::new(&whole),
            in_tolerance: Stay::default(),
        }
    }

    /// The next sample.
    #[inline]
    pub(super) fn look(&mut self, seen: &Seen<'_>) {
        if self.samples < self.periods {
            self.experiment.look(seen);
        }
        self.samples += 1;
        if self.periods == self.whole.periods {
            return;
        }
        let (truth, whole) = (seen.truth, &self.whole);
        let there = both_within(truth, whole.target, whole.settling_tolerance);
        self.in_tolerance.see(seen.time, there);
        self.ending
            .see(seen.time, [truth[0], truth[controlled(truth.len())]]);
    }

    /// The figures of the experiment, its end as it is after the loop has run on.
    pub(super) fn metrics(&self, fault: Option<(f64, Fault)>) -> Metrics {
        let metrics = self.experiment.metrics(fault);
        if self.periods == self.whole.periods {
            return metrics;
        }
        let watched = self.in_tolerance.held(&self.whole);
        metrics.with_end(&self.ending.ending(), watched)
    }
}

/// The experiment alone, so many control periods of a run that was watched, and its figures.
pub(crate) fn judged(mut run: Run, periods: usize) -> (Run, Metrics) {
    let end = Ending::new(&run);
    let watched = within(&run, run.settling_tolerance);
    run.samples.truncate(periods);
    let metrics = Metrics::new(&run).with_end(&end, watched);
    (run, metrics)
}

/// Planned moves as one run, and each of them by itself with its figures; the last one is watched.
///
/// Forces from outside as for [`watched`].
///
/// # Errors
/// As [`simulate_moves`].
pub fn watched_moves(
    design: &Design,
    plant: &PlantFile,
    sequence: &MoveSequence,
    law: Law,
    duration: f64,
) -> Result<(Run, Vec<(Run, Metrics)>)> {
    let period = design.drive.control.sample_time;
    let plant = without_later_forces(plant, duration);
    let mut run = simulate_moves(design, &plant, sequence, law, duration + after(period))?;
    let periods = (duration / period).round() as usize;
    let last = sequence.moves().last().map_or(0, |last| last.at);
    let mut parts = sequence.parts(&run);
    let watched = parts
        .pop()
        .map(|part| judged(part, periods - last.min(periods)));
    let parts = parts.into_iter().map(|part| {
        let metrics = Metrics::new(&part);
        (part, metrics)
    });
    let parts = parts.chain(watched).collect();
    run.samples.truncate(periods);
    Ok((run, parts))
}

/// The figures of [`watched_moves`], move by move, without keeping a sample.
///
/// # Errors
/// As [`simulate_moves`].
pub fn measure_moves(
    design: &Design,
    plant: &PlantFile,
    sequence: &MoveSequence,
    law: Law,
    duration: f64,
) -> Result<Vec<Metrics>> {
    let period = design.drive.control.sample_time;
    let plant = without_later_forces(plant, duration);
    let whole = Time::new(period, duration + after(period));
    let periods = Time::new(period, duration).periods;
    // Number of samples until each move begins; the last one ends with the run.
    let parts = sequence.windows(whole.periods);
    let last = parts.len().saturating_sub(1);
    let meters = parts.iter().enumerate().map(|(number, part)| {
        let of = Time {
            period,
            periods: part.samples.len(),
        };
        let frame = Frame {
            target: part.target,
            ..Frame::on(&plant, &AT_THE_ORIGIN, of)
        };
        let frame = frame.with_tolerance(design.motion.settling_tolerance);
        let experiment = if number == last {
            periods.saturating_sub(part.at)
        } else {
            of.periods
        };
        let experiment = Time {
            period,
            periods: experiment,
        };
        WatchMeter::new(frame, experiment)
    });
    let mut meters: Vec<WatchMeter> = meters.collect();
    let (mut sample, mut number) = (0, 0);
    let look = |instant: &Instant<'_>| {
        while parts
            .get(number)
            .is_some_and(|part| part.samples.end <= sample)
        {
            number += 1;
        }
        if let Some(part) = parts.get(number)
            && part.samples.contains(&sample)
        {
            let time = (sample - part.samples.start) as f64 * period;
            meters[number].look(&Seen {
                time,
                ..instant.seen()
            });
        }
        sample += 1;
    };
    let fault = follow_moves(design, &plant, sequence, law, whole, look)?;
    let each = meters.iter().zip(&parts);
    Ok(each
        .map(|(meter, part)| meter.metrics(part.fault(fault, period)))
        .collect())
}

/// The plant without forces that begin when the experiment is over.
pub(crate) fn without_later_forces(plant: &PlantFile, duration: f64) -> PlantFile {
    let mut plant = plant.clone();
    plant.forces.retain(|force| force.start < duration);
    plant
}
