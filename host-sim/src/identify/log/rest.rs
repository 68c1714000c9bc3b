//! Rest before and after the motion, and whether the record begins with it.

use super::counter::Reading;
use super::plausible::span;
use super::rows::Row;
use crate::drive::Drive;
use crate::machine::motion::PARTS;

/// Counts within which a machine stands.
const STANDING: f64 = 8.0;
/// Or this share of all its motion, where that is less.
const SHARE: f64 = 0.05;
/// Rows of standing still at the end that are kept: more say nothing.
const KEPT: usize = 100;
/// Rows in which a motion that no current made shows.
const FIRST: usize = 20;
/// How many times what the current can do from rest counts as being done by it: masses are known roughly.
const CURRENTS: f64 = 3.0;

/// Without the rest before anything moves, but for its last row.
pub(super) fn without_rest(rows: &[Row], reading: Reading) -> &[Row] {
    let first = rows.first().map_or(0.0, |row| row.count);
    let moves = |row: &Row| {
        row.current != 0.0 || reading.difference(first, row.count, 0.0).abs() > STANDING
    };
    let at = rows.iter().position(moves).unwrap_or(0);
    &rows[at.saturating_sub(1)..]
}

/// Samples up to where the machine comes to a stand for good, if it stands for long.
///
/// * `position`: counts
pub(super) fn until_stand(position: &[f64]) -> usize {
    let Some(last) = position.last() else {
        return 0;
    };
    let standing = STANDING.min(SHARE * span(position));
    let moving = position
        .iter()
        .rposition(|x| (x - last).abs() > standing)
        .map_or(0, |at| at + 1);
    (moving + 1 + KEPT).min(position.len())
}

/// Whether a record begins at rest: the first rows move no further than their currents can have done.
///
/// * `position`: counts from the first sample on; `parts`: lengths of the intervals
pub(super) fn at_rest(
    position: &[f64],
    current: &[f64],
    parts: &[u32],
    period: f64,
    drive: &Drive,
) -> bool {
    let actuator = &drive.actuator;
    let per_ampere = actuator.actual_force_constant() / actuator.actual_mass();
    let (mut velocity, mut distance) = (0.0, 0.0);
    let intervals = current.iter().zip(parts).zip(&position[1..]);
    intervals.take(FIRST).all(|((current, parts), position)| {
        let time = period * f64::from(*parts) / f64::from(PARTS);
        let acceleration = CURRENTS * per_ampere * current.abs() / drive.encoder.resolution;
        distance += velocity * time + 0.5 * acceleration * time * time;
        velocity += acceleration * time;
        position.abs() <= STANDING + distance
    })
}
