//! The record's clock: in which unit its time is, how long its period is, where rows are missing or late.

use super::Refusal;
use super::rows::{Content, Row};
use crate::machine::motion::PARTS;

/// Period of a record and length of each of its intervals.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clock {
    /// s.
    pub(super) period: f64,
    /// Twentieths of a period between each row and the next.
    pub(super) parts: Vec<u32>,
    /// What the reader should be told.
    pub(super) remarks: Vec<String>,
}

/// Periods after which a row counts as late, or as following a missing one.
const LATE: f64 = 1.5;
/// Share of rows that may be.
const MOST_LATE: f64 = 0.2;
/// Share of steps that must be regular for the others to be left out of the period.
const MOST_REGULAR: f64 = 0.9;
/// Periods by which a row may come early or late and count as regular.
const JITTER: f64 = 0.1;
/// Relative difference from the drive file's sample time that is rounding of the times.
const ROUNDING: f64 = 1e-6;
/// And beyond which the reader is told.
const OTHER: f64 = 0.01;
/// Factor from the drive file's sample time beyond which it is no period of a drive that it describes.
const ABSURD: f64 = 50.0;

/// Puts the times into seconds where their steps show that they are in milliseconds or microseconds, whatever
/// the header says: the median step is then half to twice 10³ or 10⁶ sample times. Returns the median step, s.
pub(super) fn in_seconds(
    record: &mut Content,
    sample_time: f64,
    remarks: &mut Vec<String>,
) -> Result<f64, Refusal> {
    let title = record.layout.time.title.clone();
    let steps: Vec<f64> = steps(&record.rows).collect();
    let step = median(&steps);
    if step.is_nan() || step <= 0.0 {
        let at = steps.iter().position(|step| *step <= 0.0).unwrap_or(0);
        return Err(back(&title, record.rows.get(at + 1), steps.get(at)));
    }
    let ratio = step / sample_time;
    let units = [("milliseconds", 1e-3), ("microseconds", 1e-6)];
    let guessed = units
        .into_iter()
        .find(|(_, scale)| (0.5..=2.0).contains(&(ratio * scale)));
    if let Some((unit, scale)) = guessed {
        for row in &mut record.rows {
            row.time *= scale;
        }
        record.rounding *= scale;
        remarks.push(format!(
            "{title} steps by {}: taken as {unit}, the drive file's sample time being {}",
            short(step),
            milliseconds(sample_time)
        ));
        return Ok(step * scale);
    }
    if !(1.0 / ABSURD..=ABSURD).contains(&ratio) {
        let message = format!(
            "{title} steps by {} s and the drive file's sample time is {}: name its unit in the header, such as \
             time[ms], or give the times of the control periods where it is none",
            short(step),
            milliseconds(sample_time)
        );
        return Err(Refusal::of_all(message));
    }
    Ok(step)
}

impl Clock {
    /// Of rows whose times are in seconds.
    ///
    /// The period is the mean of the steps that are within a tenth of the median, or within what the times are
    /// rounded to where that is more; where a tenth of all steps is not, of those within half of it.
    pub(super) fn of(
        rows: &[Row],
        title: &str,
        sample_time: f64,
        rounding: f64,
    ) -> Result<Self, Refusal> {
        let steps: Vec<f64> = steps(rows).collect();
        if let Some(at) = steps.iter().position(|step| *step <= 0.0) {
            return Err(back(title, rows.get(at + 1), steps.get(at)));
        }
        let middle = median(&steps);
        let mean = |within: f64| {
            let regular = steps
                .iter()
                .filter(|step| (*step / middle - 1.0).abs() <= within);
            let count = regular.clone().count();
            (count, regular.sum::<f64>() / count as f64)
        };
        let jitter = |period: f64| JITTER.max(1.01 * rounding / period).min(0.499);
        let (regular, period) = mean(jitter(middle));
        let enough = regular as f64 >= MOST_REGULAR * steps.len() as f64;
        let mut period = if enough { period } else { mean(0.499).1 };
        let mut remarks = Vec::new();
        let other = (period / sample_time - 1.0).abs();
        if other < ROUNDING {
            period = sample_time;
        } else if other > OTHER {
            remarks.push(format!(
                "the record has a row every {}, the drive file says {}: the record's is used",
                milliseconds(period),
                milliseconds(sample_time)
            ));
        }
        let jitter = jitter(period);
        let parts = steps.iter().map(|step| {
            let periods = step / period;
            if (periods - 1.0).abs() <= jitter {
                PARTS
            } else {
                ((periods * f64::from(PARTS)).round() as u32).max(1)
            }
        });
        let clock = Self {
            period,
            parts: parts.collect(),
            remarks,
        };
        clock.with_late_rows(rows, &steps, title)
    }

    /// Counts the rows that are late; refused where there are too many.
    fn with_late_rows(mut self, rows: &[Row], steps: &[f64], title: &str) -> Result<Self, Refusal> {
        let late = |step: &f64| *step > LATE * self.period;
        let count = steps.iter().filter(|step| late(step)).count();
        if count == 0 {
            return Ok(self);
        }
        let longest = steps.iter().copied().fold(0.0, f64::max);
        if count as f64 > MOST_LATE * steps.len() as f64 {
            let at = steps.iter().position(late).unwrap_or(0);
            let message = format!(
                "{title} is {} after the row before, and so in {count} of {} rows: must be one period of {}, \
                 at most a fifth of the rows may be missing or late",
                milliseconds(steps[at]),
                steps.len(),
                milliseconds(self.period)
            );
            return Err(Refusal::of(rows[at + 1].line, message));
        }
        let are = if count == 1 { "row is" } else { "rows are" };
        self.remarks.push(format!(
            "{count} {are} missing or late, the longest interval {}: predicted across",
            milliseconds(longest)
        ));
        Ok(self)
    }
}

/// Times between rows, s.
fn steps(rows: &[Row]) -> impl Iterator<Item = f64> {
    rows.windows(2).map(|pair| pair[1].time - pair[0].time)
}

/// The median; not a number of nothing.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    if values.is_empty() {
        return f64::NAN;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The time does not go on.
fn back(title: &str, row: Option<&Row>, step: Option<&f64>) -> Refusal {
    let message = format!(
        "{title} is {:.6} s after the row before: must grow from row to row, by one control period",
        step.copied().unwrap_or(0.0)
    );
    Refusal {
        line: row.map(|row| row.line),
        message,
    }
}

/// A time as people read it.
pub(super) fn milliseconds(seconds: f64) -> String {
    format!("{} ms", short(1e3 * seconds))
}

/// A number in at most five figures.
fn short(value: f64) -> String {
    let text = format!("{value:.4e}");
    text.parse::<f64>().unwrap_or(value).to_string()
}
