//! The records that a machine is identified from: time, encoder and current, one row per control period, as
//! `simulate --csv` and `capture` write them, or as a spreadsheet or another program does.
//!
//! ```text
//! file --text--> fields --columns, rows--> numbers --clock--> seconds --stretch, rest--> the part used
//!      --clock--> period, intervals --counter, plausible--> positions --rest--> Log
//! ```
//!
//! The count (or position) is that at the row's time, the current the one over the period that ends then.
//! What can be made good is, and the reader told: times in milliseconds, a period other than the drive
//! file's, missing and late rows, a beginning in motion. What cannot is refused with its row and its likely
//! cause: counts that no machine makes, a counter of another width, times that go back.

mod cause;
mod clock;
mod columns;
mod counter;
mod plausible;
mod rest;
mod rows;
mod stretch;
#[cfg(test)]
mod tests;
mod text;

pub use columns::Columns;

use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::machine::Actuator;
use crate::machine::encoder::LEAST_COUNTS;
use clock::Clock;
use counter::Reading;
use plausible::Plausible;
use rows::Row;
use std::io::Read;
use std::path::Path;

/// A record, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// Its name, for messages.
    pub name: String,
    /// The drive that wrote it, as `capture` marks it; nothing where it does not say.
    pub drive: Option<String>,
    /// Period of the record, s: the drive file's sample time where its times say the same to 1e-6.
    pub period: f64,
    /// What one count is, m.
    pub resolution: f64,
    /// Position of the actuator at each sample that the record has, from the first one on, m.
    pub position: Vec<f64>,
    /// Current over the interval that follows each sample but the last, A.
    pub current: Vec<f64>,
    /// Length of that interval, in parts of a period of which there are
    /// [`PARTS`](crate::machine::motion::PARTS): so many where rows are regular, more where some are missing or
    /// late.
    pub parts: Vec<u32>,
    /// Whether it begins at rest.
    pub at_rest: bool,
    /// Rows at the end that were left out: after the longest record that is read, and in which the machine
    /// stands.
    pub left_out: usize,
    /// Energy that the current gave to the motion, over all that went to and fro between them, -1 to 1. From
    /// rest a current can only give to a machine, whatever its springs.
    pub work: f64,
    /// What the reader should be told, a sentence each.
    pub remarks: Vec<String>,
}

/// Fewer rows say nothing.
const FEWEST: usize = 200;
/// More rows say little more, and take minutes.
const MOST: usize = 60_000;
/// Share by which a measured current may be beyond the drive's limit.
const OVERSHOOT: f64 = 0.03;
/// How many times the limit a current is that must be in other units.
const MILLIAMPERES: f64 = 50.0;

/// Why a record is not taken, and at which line.
#[derive(Clone, Debug, PartialEq)]
struct Refusal {
    line: Option<usize>,
    message: String,
}

impl Refusal {
    const fn of(line: usize, message: String) -> Self {
        Self {
            line: Some(line),
            message,
        }
    }

    const fn of_all(message: String) -> Self {
        Self {
            line: None,
            message,
        }
    }
}

impl Log {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Read`] or [`Error::Input`].
    pub fn load(path: &Path, drive: &Drive, columns: &Columns) -> Result<Self> {
        let file = std::fs::File::open(path).map_err(Error::read(path))?;
        Self::parse(file, &path.display().to_string(), drive, columns)
    }

    /// * `name`: of the file, for messages
    /// * `drive`: whose record it is: sample time, encoder, and roughly its forces and masses
    /// * `columns`: where they have other names
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn parse(text: impl Read, name: &str, drive: &Drive, columns: &Columns) -> Result<Self> {
        read(text, name, drive, columns).map_err(|refusal| Error::Input {
            place: refusal
                .line
                .map_or(name.into(), |line| format!("{name}:{line}")),
            message: refusal.message,
        })
    }

    /// The log's first intervals.
    #[must_use]
    pub(super) fn beginning(&self, intervals: usize) -> Self {
        let intervals = intervals.min(self.current.len());
        Self {
            position: self.position[..=intervals].to_vec(),
            current: self.current[..intervals].to_vec(),
            parts: self.parts[..intervals].to_vec(),
            ..self.clone()
        }
    }

    /// The log of the same motion under the opposite current.
    #[must_use]
    pub(super) fn reversed(&self) -> Self {
        Self {
            current: self.current.iter().map(|current| -current).collect(),
            work: -self.work,
            ..self.clone()
        }
    }
}

/// Intervals of all records.
pub(super) fn intervals(logs: &[Log]) -> usize {
    logs.iter().map(|log| log.current.len()).sum()
}

/// Period of records of one drive, s.
pub(super) fn period(logs: &[Log]) -> f64 {
    logs.first().map_or(1.0, |log| log.period)
}

fn read(
    text: impl Read,
    name: &str,
    drive: &Drive,
    columns: &Columns,
) -> std::result::Result<Log, Refusal> {
    let sample_time = drive.control.sample_time;
    let table = text::table(text)?;
    let mut record = rows::rows(&table, columns, drive)?;
    require_enough(&record.rows)?;
    let mut remarks = Vec::new();
    let step = clock::in_seconds(&mut record, sample_time, &mut remarks)?;
    let place = &record.layout.place;
    let reading = if record.layout.counts {
        Reading::of(&record.rows, place, drive.encoder.counter_bits)?
    } else {
        Reading::Going
    };

    let (stretch, part) = stretch::most_moving(&record.rows, step, reading);
    remarks.extend(part);
    let stretch = rest::without_rest(stretch, reading);
    let rows = &stretch[..stretch.len().min(MOST)];
    require_enough(rows)?;
    let clock = Clock::of(
        rows,
        &record.layout.time.title,
        sample_time,
        record.rounding,
    )?;
    remarks.extend(clock.remarks);
    require_current(rows, &record.layout.current.title, &drive.actuator)?;
    let plausible = Plausible::new(drive, clock.period);
    let counts = counter::unwrapped(rows, &clock.parts, reading, place, &plausible)?;
    require_motion(&counts)?;

    let samples = rest::until_stand(&counts).max(FEWEST);
    let (rows, counts) = (&rows[..samples], &counts[..samples]);
    let parts = clock.parts[..samples - 1].to_vec();
    let current: Vec<f64> = rows[1..].iter().map(|row| row.current).collect();
    let at_rest = rest::at_rest(counts, &current, &parts, clock.period, drive);
    if !at_rest {
        remarks.push("begins in motion: its first part serves to find the state".into());
    }
    Ok(Log {
        name: name.into(),
        drive: record.drive,
        period: clock.period,
        resolution: drive.encoder.resolution,
        position: counts
            .iter()
            .map(|count| count * drive.encoder.resolution)
            .collect(),
        work: work(counts, &current),
        current,
        parts,
        at_rest,
        left_out: stretch.len() - samples,
        remarks,
    })
}

fn require_enough(rows: &[Row]) -> std::result::Result<(), Refusal> {
    if rows.len() >= FEWEST {
        return Ok(());
    }
    Err(Refusal::of_all(format!(
        "{} control periods: must be {FEWEST} at least",
        rows.len()
    )))
}

/// The current excites, within what the drive can do.
fn require_current(
    rows: &[Row],
    title: &str,
    actuator: &Actuator,
) -> std::result::Result<(), Refusal> {
    let limit = actuator.current_limit;
    let allowed = limit * (1.0 + OVERSHOOT) + actuator.current_resolution;
    if let Some(row) = rows.iter().find(|row| row.current.abs() > allowed) {
        let largest = rows.iter().map(|row| row.current.abs()).fold(0.0, f64::max);
        let mut message = format!(
            "{title} = {}: is beyond the drive's current_limit of {limit} A",
            row.current
        );
        if largest > MILLIAMPERES * limit {
            message += "; where it is in mA, name the column applied_current[mA]";
        }
        return Err(Refusal::of(row.line, message));
    }
    if rows.iter().all(|row| row.current == rows[0].current) {
        return Err(Refusal::of_all(format!(
            "{title} never changes: nothing can be identified without excitation"
        )));
    }
    Ok(())
}

/// The actuator moves through enough counts.
fn require_motion(counts: &[f64]) -> std::result::Result<(), Refusal> {
    let range = plausible::span(counts);
    if range >= LEAST_COUNTS {
        return Ok(());
    }
    Err(Refusal::of_all(format!(
        "the actuator moves by {range:.0} counts: must be {LEAST_COUNTS} at least, so that rounding does not \
         hide the motion; excite with more current or use a finer encoder"
    )))
}

/// Energy given over energy exchanged.
fn work(counts: &[f64], current: &[f64]) -> f64 {
    let (mut work, mut exchanged) = (0.0, 0.0);
    for (pair, current) in counts.windows(2).zip(current) {
        let given = (pair[1] - pair[0]) * current;
        work += given;
        exchanged += given.abs();
    }
    if exchanged > 0.0 {
        work / exchanged
    } else {
        0.0
    }
}
