//! A run, and what comes after it.
//!
//! Friction can hold an actuator at rest for a second while the disturbance state winds up, and let it go again:
//! a drive that hunts looks settled in a run that ends too soon. So the loop runs on for a while after the
//! experiment, and what moves at its end is what moves at the end of the time it was watched.

use super::ending::Ending;
use super::metrics::{Metrics, controlled, within};
use super::scenario::Scenario;
use super::sequence::{MoveSequence, simulate_moves};
use super::{Law, Run, simulate};
use crate::design::Design;
use crate::drive::PlantFile;
use crate::error::Result;

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

/// How long a loop is watched after the experiment, s.
fn after(period: f64) -> f64 {
    WATCHED.min(LONGEST * period)
}

/// The experiment alone, so many control periods of a run that was watched, and its figures.
pub(crate) fn judged(mut run: Run, periods: usize) -> (Run, Metrics) {
    let end = Ending::new(&run, controlled(&run));
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

fn without_later_forces(plant: &PlantFile, duration: f64) -> PlantFile {
    let mut plant = plant.clone();
    plant.forces.retain(|force| force.start < duration);
    plant
}
