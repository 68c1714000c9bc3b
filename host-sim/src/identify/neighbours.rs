//! Whether another number of loads explains a record better, or as well.
//!
//! One load more is tried where the innovations are not white: each load of the machine that was found is
//! parted in two, with a spring between them. One less is tried where a record does not tell the masses
//! apart: each two neighbours are joined.

use super::estimate::{Residuals, closely};
use super::log::{intervals, period};
use super::parameters::Machine;
use super::settle::Estimate;
use super::{Log, Parameters, Quantity};
use crate::drive::MAX_LOADS;
use crate::machine::DryFriction;
use rayon::prelude::*;

/// Share of the squared errors that is left with one load more, for it to be named.
const FEWER_ERRORS: f64 = 0.8;
/// Chi square by which one load less may be worse and still be as good.
const AS_GOOD: f64 = 10.0;
/// Springs between the halves of a parted load, over the spring before it.
const SPRINGS: [f64; 2] = [1.0, 4.0];
/// Least share of all mass that a load is.
const LEAST: f64 = 0.005;

/// What is left of the squared errors with one load more, if that is much less.
pub(super) fn one_more(logs: &[Log], parameters: &Parameters, estimate: &Estimate) -> Option<f64> {
    let machine = &estimate.machine;
    let loads = machine.chain().loads();
    if loads >= MAX_LOADS {
        return None;
    }
    let trials: Vec<Machine> = (0..loads)
        .flat_map(|load| SPRINGS.map(|spring| parted(machine, load, spring)))
        .collect();
    let best = best(logs, parameters, estimate, &trials)?;
    let chain = best.0.chain();
    let least = LEAST * chain.mass.iter().sum::<f64>();
    let period = period(logs);
    // A load that is next to nothing, or a mode that no sample shows, is something else.
    let sensible = chain.mass.iter().all(|mass| *mass > least)
        && chain
            .modes()
            .iter()
            .all(|mode| mode.frequency_hz < 0.25 / period);
    let left = best.1 / estimate.cost;
    (sensible && left < FEWER_ERRORS).then_some(left)
}

/// Whether one load less explains the records as well.
pub(super) fn one_less(logs: &[Log], parameters: &Parameters, estimate: &Estimate) -> bool {
    let (machine, cost) = (&estimate.machine, estimate.cost);
    let loads = machine.chain().loads();
    if loads < 2 {
        return false;
    }
    let trials: Vec<Machine> = (1..loads).map(|load| joined(machine, load)).collect();
    let periods = intervals(logs);
    let best = best(logs, parameters, estimate, &trials);
    best.is_some_and(|(_, found)| found - cost < 0.5 * AS_GOOD * 2.0 * cost / periods as f64)
}

/// The best fit from some machines of the same number of loads and the noise of an estimate: machine and cost.
fn best(
    logs: &[Log],
    parameters: &Parameters,
    estimate: &Estimate,
    trials: &[Machine],
) -> Option<(Machine, f64)> {
    let noise = &estimate.coordinates[parameters.free().count()..];
    trials
        .par_iter()
        .map(|machine| {
            let parameters = parameters.around(machine.clone());
            let residuals = Residuals::new(logs, &parameters);
            let mut x = parameters.coordinates(machine);
            let quantities = x.len();
            x.extend(noise);
            let end = closely(logs, &residuals, &x);
            (parameters.machine(&end.coordinates[..quantities]), end.cost)
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// One load in two halves.
fn parted(machine: &Machine, load: usize, spring: f64) -> Machine {
    let mut parted = machine.clone();
    let chain = &mut parted.mechanics.chain;
    let half = 0.5 * chain.mass[load + 1];
    chain.mass[load + 1] = half;
    chain.mass.insert(load + 2, half);
    chain
        .stiffness
        .insert(load + 1, spring * chain.stiffness[load]);
    chain.damping.insert(load + 1, chain.damping[load]);
    chain.ground.insert(load + 1, 0.0);
    parted
        .mechanics
        .friction
        .insert(load + 2, DryFriction::default());
    parted.backlash.insert(load + 1, 0.0);
    parted
}

/// A load joined with the one before it.
fn joined(machine: &Machine, load: usize) -> Machine {
    let mut joined = machine.clone();
    let chain = &mut joined.mechanics.chain;
    chain.mass[load] += chain.mass.remove(load + 1);
    chain.stiffness.remove(load);
    chain.damping.remove(load);
    chain.ground.remove(load);
    joined.mechanics.friction.remove(load + 1);
    joined.backlash.remove(load);
    joined
}

/// The quantities of a number of loads, held as those that are there.
pub(super) fn of_loads(all: &[(Quantity, bool)], loads: usize) -> Vec<(Quantity, bool)> {
    let of_chain = |quantity: &Quantity| {
        matches!(
            quantity,
            Quantity::Mass(_) | Quantity::Stiffness(_) | Quantity::Damping(_)
        )
    };
    let of_load = |quantity: &Quantity| match *quantity {
        Quantity::LoadViscous(load) | Quantity::LoadCoulomb(load) | Quantity::Backlash(load) => {
            Some(load)
        }
        _ => None,
    };
    let mut result: Vec<(Quantity, bool)> = all
        .iter()
        .filter(|(quantity, _)| !of_chain(quantity) && of_load(quantity).is_none_or(|l| l < loads))
        .copied()
        .collect();
    for load in 0..loads {
        result.extend([
            (Quantity::Mass(load), false),
            (Quantity::Stiffness(load), false),
            (Quantity::Damping(load), false),
        ]);
    }
    result
}
