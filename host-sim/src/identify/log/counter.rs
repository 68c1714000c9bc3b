//! Counts without the counter's wrapping.

use super::Refusal;
use super::cause::cause;
use super::columns::Found;
use super::plausible::{Plausible, span};
use super::rows::Row;
use crate::machine::encoder::LEAST_COUNTS;
use crate::machine::motion::PARTS;

/// How the counts of a record are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reading {
    /// They wrap at this many bits.
    Wrapping(u32),
    /// They go on: unwrapped already, or a position.
    Going,
}

/// Shares of the rows whose count is beyond the counter's range, or not whole, from which on it is no counter.
const BEYOND: f64 = 0.01;
const BROKEN: f64 = 0.1;

impl Reading {
    /// How a counter of a drive is read in these rows.
    ///
    /// # Errors
    /// A count of a counter that is not whole.
    pub(super) fn of(rows: &[Row], column: &Found, bits: u32) -> Result<Self, Refusal> {
        let range = 2_f64.powi(bits as i32);
        let beyond = |row: &&Row| !(-range / 2.0..range).contains(&row.count);
        let broken = |row: &&Row| row.count.fract() != 0.0;
        let share = |count: usize| count as f64 / rows.len() as f64;
        if share(rows.iter().filter(beyond).count()) > BEYOND
            || share(rows.iter().filter(broken).count()) > BROKEN
        {
            return Ok(Self::Going);
        }
        match rows.iter().find(broken) {
            None => Ok(Self::Wrapping(bits)),
            Some(row) => {
                let message = format!("{} = {}: must be a whole number", column.title, row.count);
                Err(Refusal::of(row.line, message))
            }
        }
    }

    /// Counts from one reading to the next, the nearest to what is expected.
    pub(super) fn difference(self, from: f64, to: f64, expected: f64) -> f64 {
        let difference = to - from;
        match self {
            Self::Going => difference,
            Self::Wrapping(bits) => {
                let range = 2_f64.powi(bits as i32);
                difference - range * ((difference - expected) / range).round()
            }
        }
    }
}

/// Whether an interval is too long for its counts to be those of a period.
fn long(parts: u32) -> bool {
    2 * parts > 3 * PARTS
}

/// Counts in each interval. In a period they are less than half of the range; over a longer interval they are
/// nearest to what the velocities before and after it make.
pub(super) fn differences(counts: &[f64], parts: &[u32], reading: Reading) -> Vec<f64> {
    let pairs = || counts.windows(2).zip(parts);
    let mut steps: Vec<f64> = pairs()
        .map(|(pair, _)| reading.difference(pair[0], pair[1], 0.0))
        .collect();
    for (k, (pair, part)) in pairs().enumerate().filter(|(_, (_, part))| long(**part)) {
        let expected = expected(&steps, parts, k) * f64::from(*part);
        steps[k] = reading.difference(pair[0], pair[1], expected);
    }
    steps
}

/// Counts per part of a period that the intervals around a long one make expect of it.
fn expected(steps: &[f64], parts: &[u32], k: usize) -> f64 {
    let speed = |k: usize| steps[k] / f64::from(parts[k]);
    // One long interval before it has been read already.
    let before = k.checked_sub(1).map(speed);
    let after = Some(k + 1).filter(|k| parts.get(*k).is_some_and(|part| !long(*part)));
    match (before, after.map(speed)) {
        (Some(before), Some(after)) => 0.5 * (before + after),
        (one, other) => one.or(other).unwrap_or(0.0),
    }
}

/// Counts from the first row on.
pub(super) fn positions(steps: &[f64]) -> Vec<f64> {
    let mut total = 0.0;
    let rest = steps.iter().map(|step| {
        total += step;
        total
    });
    std::iter::once(0.0).chain(rest).collect()
}

/// Positions of the rows, in counts from the first one on.
///
/// # Errors
/// A counter of another width, one that moves too far in a period, or a motion that no machine makes.
pub(super) fn unwrapped(
    rows: &[Row],
    parts: &[u32],
    reading: Reading,
    column: &Found,
    plausible: &Plausible,
) -> Result<Vec<f64>, Refusal> {
    let title = &column.title;
    let counts: Vec<f64> = rows.iter().map(|row| row.count).collect();
    if let Some(bits) = other_width(&counts, parts, reading, plausible) {
        let jump = counts.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let jumps: Vec<f64> = jump.collect();
        let largest = jumps.iter().copied().fold(0.0, f64::max);
        let at = jumps.iter().position(|jump| *jump == largest).unwrap_or(0);
        let message = format!(
            "{title} jumps by {largest} counts: it looks like a counter of {bits} bits: set encoder.counter_bits = \
             {bits}"
        );
        return Err(Refusal::of(rows[at + 1].line, message));
    }
    let steps = differences(&counts, parts, reading);
    if let Reading::Wrapping(bits) = reading {
        let quarter = 2_f64.powi(bits as i32 - 2);
        let uncertain = |k: &usize| {
            let expected = if long(parts[*k]) {
                expected(&steps, parts, *k) * f64::from(parts[*k])
            } else {
                0.0
            };
            (steps[*k] - expected).abs() > quarter
        };
        if let Some(k) = (0..steps.len()).find(uncertain) {
            let cause = cause(&counts, &steps, parts, k);
            let message = format!(
                "{title} jumps by {} counts: more than a quarter of the range of a counter of {bits} bits in {}, so \
                 that its direction is not certain: {cause}",
                steps[k],
                if long(parts[k]) {
                    "an interval without rows"
                } else {
                    "one period"
                },
            );
            return Err(Refusal::of(rows[k + 1].line, message));
        }
    }
    if let Some(k) = plausible.outlier(&steps, parts) {
        let cause = cause(&counts, &steps, parts, k);
        let message = format!(
            "{title} jumps by {:.0} counts from one row to the next, which no force of this drive can make of the \
             motion before and after: {cause}",
            steps[k]
        );
        return Err(Refusal::of(rows[k + 1].line, message));
    }
    Ok(positions(&steps))
}

/// The width of the counter, where it is another one than is read with: the narrowest that holds all counts, if
/// they step by less than a quarter of its range, or else by nearly all of it, and the motion without these
/// wraps is one that a machine makes.
fn other_width(
    counts: &[f64],
    parts: &[u32],
    reading: Reading,
    plausible: &Plausible,
) -> Option<u32> {
    if counts.iter().any(|count| count.fract() != 0.0) {
        return None;
    }
    let widest = span(counts);
    let bits = (2..=32).find(|bits| widest < 2_f64.powi(*bits))?;
    let other = Reading::Wrapping(bits as u32);
    if matches!(reading, Reading::Wrapping(read) if read <= bits as u32) {
        return None;
    }
    let range = 2_f64.powi(bits);
    let mut wraps = 0;
    for (pair, part) in counts.windows(2).zip(parts) {
        let step = (pair[1] - pair[0]).abs() / range;
        if step >= 0.75 {
            wraps += 1;
        } else if step > 0.25 && !long(*part) {
            return None;
        }
    }
    let steps = differences(counts, parts, other);
    let moves = span(&positions(&steps)) >= LEAST_COUNTS;
    let found = wraps > 0 && moves && plausible.outlier(&steps, parts).is_none();
    found.then_some(bits as u32)
}
