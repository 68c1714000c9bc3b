//! The least time in which any control can move a chain: what a settling time is to be held against.
//!
//! The chain is sampled exactly, the current held over a period and no more than the limit in either
//! direction, the whole future known. Two times, whole control periods both:
//!
//! ```text
//! settled   the controlled mass is within its band from then on, the current free as before
//! rest      every mass is at rest at the target
//! ```
//!
//! Whether a time is enough is a linear programme (`programme`); the least one is searched for. It is the
//! bound of feedback, feed-forward and reference alike, for the chain without Coulomb friction (which may help
//! to brake), forces from outside or delay, and with a current that is not rounded.
//!
//! After settling the current stays free, and the masses beyond the controlled one may swing, but not for ever:
//! all are to be at rest `PERIODS` periods of the slowest mode later, or half the least time to rest later
//! where that is more. The horizon is part of the definition. With a longer one the controlled mass could be held
//! in its band while the last mass swings ever wilder beside it (default drive, 30 mm: 57 ms with this horizon,
//! 52 ms with twice, 46 ms with two and a half times as much), which no one would call settled.
//!
//! Where a horizon would have more than `HOLDS` periods, the current is held over several of them, and the
//! first hold is shorter, so that every whole number of periods can still be told. Such a time can be kept, as
//! far as the band is kept between the instants at which it is looked at (eight in a hold at most), so it is an
//! upper estimate of the bound. How far above is not known in general; the tests have it within one hold.

mod programme;

use super::Chain;
use super::modal::Modal;
use crate::error::NoSolution;
use crate::linear::Result;
use nalgebra::DVector;
use programme::{Horizon, Programme};
use serde::Serialize;

/// Most holds of the current in a horizon.
const HOLDS: usize = 400;

/// Least free horizon between settling and rest, in periods of the slowest mode.
const PERIODS: f64 = 1.5;

/// Longest time that is tried, control periods.
const LONGEST: usize = 1 << 30;

/// How many times longer than a rigid body and a period of the slowest mode is not tried.
const HOPELESS: usize = 1000;

/// Where the least time is looked for first between two times of which nothing is known: settling takes about
/// this share of the time to rest.
const UNKNOWN: f64 = 0.72;

/// A solver's reach of one is only so near to one.
const ROUNDING: f64 = 1e-6;

/// What is to be moved, and by what.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The chain; its Coulomb friction, if it has any, is left out.
    pub chain: &'a Chain,
    /// State `x_a v_a x_1 v_1 …` at the start, m and m/s.
    pub start: &'a DVector<f64>,
    /// Where all masses are to be, m.
    pub target: f64,
    /// Most current in either direction, A.
    pub current_limit: f64,
    /// Control period, s.
    pub period: f64,
    /// Element of the chain that settles: 0 the actuator, 1 the first load, ….
    pub controlled: usize,
    /// Half width of the band in which it is settled, over the span of its motion.
    pub band: f64,
}

/// The least times, from the start on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MinimumTime {
    /// After which the controlled mass stays within its band, s.
    pub settled: f64,
    /// After which all masses are at rest at the target, s.
    pub rest: f64,
    /// Over how many control periods the current was held: both times are the bound's own where it is 1,
    /// upper estimates of it otherwise.
    pub hold: usize,
}

/// The least times in which a task can be done.
///
/// # Errors
/// [`NoSolution`] where a mass cannot be moved by the current (a spring that is broken), the controlled mass
/// is at its target at the start and so has no band, or the solver fails.
pub fn minimum_time(task: &Task<'_>) -> Result<MinimumTime> {
    let error = DVector::from_fn(task.start.len(), |row, _| {
        task.start[row] - if row % 2 == 0 { task.target } else { 0.0 }
    });
    let span = error[2 * task.controlled].abs();
    let usable = [span, task.current_limit, task.period];
    if !usable.iter().all(|value| *value > 0.0) || !error.iter().all(|x| x.is_finite()) {
        return Err(NoSolution(
            "the least time of a motion needs a span, a current limit and a control period above zero"
                .into(),
        ));
    }
    if task
        .chain
        .stiffness
        .iter()
        .any(|stiffness| *stiffness <= 0.0)
    {
        return Err(NoSolution(
            "no current brings every mass to rest at the target: a spring is broken".into(),
        ));
    }
    let modal = Modal::new(task.chain, task.current_limit)?;
    let programme = Programme {
        start: modal.state(&error),
        output: modal.position(task.controlled),
        band: task.band * span,
        span,
        period: task.period,
        modal: &modal,
    };
    let periods = |seconds: f64| ((seconds / task.period).ceil() as usize).clamp(1, LONGEST);

    let slowest = modal.slowest_period();
    let rigid = 2.0 * (span / modal.rigid_acceleration()).sqrt();
    let mut enough = periods(rigid + slowest);
    let longest = enough.saturating_mul(HOPELESS);
    let mut short = (0, None);
    let to_rest = |time, hold| programme.reach(&Horizon::to_rest(time, hold));
    let reached = loop {
        let reached = to_rest(enough, hold(enough))?;
        if suffices(reached) {
            break reached;
        }
        if enough >= longest {
            return Err(NoSolution(
                "no current brings every mass of this chain to rest at the target".into(),
            ));
        }
        short = (enough, Some(reached));
        enough *= 2;
    };
    let held = hold(enough);
    let rest = least(short, (enough, Some(reached)), |time| to_rest(time, held))?;

    let free = periods(PERIODS * slowest).max(rest.div_ceil(2));
    let held_longer = hold(rest + free);
    let settled = least((0, None), (rest, None), |time| {
        programme.reach(&Horizon::to_settle(time, held_longer, free))
    })?;
    Ok(MinimumTime {
        settled: settled as f64 * task.period,
        rest: rest as f64 * task.period,
        hold: held.max(held_longer),
    })
}

/// Over how many periods the current is held in a horizon of so many.
fn hold(periods: usize) -> usize {
    periods.div_ceil(HOLDS)
}

fn suffices(reach: f64) -> bool {
    reach >= 1.0 - ROUNDING
}

/// The least time that suffices. The reach grows with a power of the time, so the next guess is where a
/// straight line through its logarithms is zero; every other one halves what is left.
///
/// * `short`: does not suffice; `enough`: does; each with its reach as far as that is known
/// * `reach`: see [`Programme::reach`]
fn least(
    mut short: (usize, Option<f64>),
    mut enough: (usize, Option<f64>),
    reach: impl Fn(usize) -> Result<f64>,
) -> Result<usize> {
    let mut halve = false;
    while enough.0 - short.0 > 1 {
        let width = enough.0 - short.0;
        let share = match (short.1, enough.1) {
            (Some(low), Some(high)) if !halve && low > 0.0 => {
                let (low, high) = (low.ln(), high.ln());
                (-low / (high - low)).clamp(0.0, 1.0)
            }
            _ if halve => 0.5,
            _ => UNKNOWN,
        };
        let step = ((share * width as f64) as usize).clamp(1, width - 1);
        let middle = short.0 + step;
        let reached = reach(middle)?;
        let end = (middle, Some(reached));
        if suffices(reached) {
            enough = end;
        } else {
            short = end;
        }
        halve = enough.0 - short.0 > width / 2 && !halve;
    }
    Ok(enough.0)
}

#[cfg(test)]
mod tests;
