//! Which part of a record is used: the one in which the drive moves the machine most.

use super::FEWEST;
use super::counter::Reading;
use super::rows::Row;

/// Periods without a row that part a record in two.
const APART: f64 = 50.0;

/// The part, and what the reader should be told of it.
///
/// Of all stretches in which the drive was exciting, or else running, or else of all, that one in which the
/// actuator moves through most counts; a stretch ends where rows are missing for long.
///
/// * `period`: about, s
pub(super) fn most_moving(rows: &[Row], period: f64, reading: Reading) -> (&[Row], Option<String>) {
    let together = |a: &Row, b: &Row| b.time - a.time <= APART * period;
    for mode in ["Exciting", "Running"] {
        let runs = rows
            .chunk_by(|a, b| (a.mode == mode) == (b.mode == mode) && together(a, b))
            .filter(|run| run[0].mode == mode);
        if let Some(found) = best(runs.collect(), reading) {
            return found;
        }
    }
    let all = rows.chunk_by(together).collect();
    best(all, reading).unwrap_or((rows, None))
}

/// The one that moves most, among those that are long enough if there are such.
fn best(mut runs: Vec<&[Row]>, reading: Reading) -> Option<(&[Row], Option<String>)> {
    if runs.iter().any(|run| run.len() > FEWEST) {
        runs.retain(|run| run.len() > FEWEST);
    }
    let run = runs.iter().copied().max_by(|a, b| {
        let (range_a, range_b) = (range(a, reading), range(b, reading));
        range_a.total_cmp(&range_b).then(a.len().cmp(&b.len()))
    })?;
    let remark = (runs.len() > 1).then(|| {
        format!(
            "the record has {} parts: the one from {:.3} s to {:.3} s is used, in which the actuator moves most",
            runs.len(),
            run[0].time,
            run[run.len() - 1].time
        )
    });
    Some((run, remark))
}

/// Counts through which the actuator moves.
fn range(rows: &[Row], reading: Reading) -> f64 {
    let (mut at, mut low, mut high) = (0.0_f64, 0.0_f64, 0.0_f64);
    for pair in rows.windows(2) {
        at += reading.difference(pair[0].count, pair[1].count, 0.0);
        (low, high) = (low.min(at), high.max(at));
    }
    high - low
}
