//! The bound of an experiment: the least time in which any control can do it, on one plant.
//!
//! That of [`minimum_time`](crate::chain::minimum_time), for the plant as it is, with as much current as drive
//! and amplifier both allow, but without Coulomb friction and forces from outside.

use super::scenario::{SCENARIOS, Scenario};
use crate::chain::controlled_mass;
use crate::chain::minimum_time::{MinimumTime, Task, minimum_time};
use crate::drive::{Drive, PlantFile, SETTLING_BAND};
use crate::error::{self, Error};
use crate::linear::Result;
use crate::machine::chain_of;
use nalgebra::DVector;

/// The bound, or why there is none.
pub type Bound = Result<MinimumTime>;

/// The bound of an experiment.
///
/// * `plant`: what is there; with as many loads as the drive
///
/// # Errors
/// [`NoSolution`](crate::error::NoSolution) as [`minimum_time`].
pub fn bound(drive: &Drive, plant: &PlantFile, scenario: &Scenario) -> Bound {
    let chain = chain_of(&plant.actuator, &plant.loads, plant.friction.viscous);
    let start = scenario.initial_state(&chain);
    bound_from(drive, plant, &start, scenario.target)
}

/// Shortest and longest distance, m.
const DISTANCES: (f64, f64) = (1e-9, 1e6);

/// The bound of a step from rest.
///
/// * `distance`: m; the sign is of no account
///
/// # Errors
/// [`Error::Usage`] for a plant of another make than the drive, [`Error::Parameter`] for a distance that is none,
/// [`Error::Bound`] where there is no bound.
pub fn step_bound(drive: &Drive, plant: &PlantFile, distance: f64) -> error::Result<MinimumTime> {
    plant.require_fit(drive)?;
    let (shortest, longest) = DISTANCES;
    if !(shortest..=longest).contains(&distance.abs()) {
        let unit = drive.kind.units().position;
        let rule = format!("must be from {shortest:e} to {longest:e} {unit}");
        return Err(Error::parameter("distance", distance, rule));
    }
    let step = Scenario {
        target: distance,
        ..SCENARIOS[0]
    };
    bound(drive, plant, &step).map_err(|why| Error::Bound(why.to_string()))
}

/// The bound of a motion from any state.
///
/// * `start`: state `x_a v_a x_1 v_1 …`, m and m/s
/// * `target`: m
///
/// # Errors
/// As [`bound`].
pub fn bound_from(drive: &Drive, plant: &PlantFile, start: &DVector<f64>, target: f64) -> Bound {
    let chain = chain_of(&plant.actuator, &plant.loads, plant.friction.viscous);
    minimum_time(&Task {
        chain: &chain,
        start,
        target,
        current_limit: current_limit(drive, plant),
        period: drive.control.sample_time,
        controlled: controlled_mass(chain.loads()),
        band: SETTLING_BAND,
    })
}

/// Most current that both the drive asks for and the plant's amplifier gives, A.
#[must_use]
pub fn current_limit(drive: &Drive, plant: &PlantFile) -> f64 {
    let (asked, given) = (&drive.actuator, &plant.actuator);
    asked.current_limit.min(given.current_limit)
}

/// How many times the bound a settling time is.
#[must_use]
pub fn times(settling_time: Option<f64>, bound: &Bound) -> Option<f64> {
    let bound = bound.as_ref().ok()?;
    settling_time.map(|time| time / bound.settled)
}

/// How many times the least time to rest the time until all stays within the settling tolerance is.
#[must_use]
pub fn times_rest(time: Option<f64>, bound: &Bound) -> Option<f64> {
    let bound = bound.as_ref().ok()?;
    time.map(|time| time / bound.rest)
}
