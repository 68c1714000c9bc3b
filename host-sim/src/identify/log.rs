//! The log that is identified from: a CSV with `time[s]`, `count[1]` and `applied_current[A]`, one row per
//! control period, as `simulate --csv` and `capture` write it, or as a spreadsheet saves that: separated by
//! semicolons or tabs, with decimal commas, with a byte-order mark.
//!
//! `count` is the encoder at `time`, `applied_current` the current over the period that ends then. Other
//! columns are ignored but two: where a `mode[name]` (`state[name]` in older captures) says what the drive was
//! doing, the longest stretch of excitation is taken, or else of closed loop; `drive[name]` says which drive it
//! was. The stretch must begin at rest; a longer rest is left
//! out, and so is what comes after the first minute at a control period of a millisecond.

use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::machine::encoder::LEAST_COUNTS;
use std::io::Read;
use std::path::Path;

/// A log, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// Its name, for messages.
    pub name: String,
    /// The drive that wrote it, as `capture` marks it; nothing where it does not say.
    pub drive: Option<String>,
    /// Control period, s.
    pub period: f64,
    /// Position of the actuator at each sample, from the first one on, m.
    pub position: Vec<f64>,
    /// Current over the period that follows each sample but the last, A.
    pub current: Vec<f64>,
    /// Control periods at the end that were left out.
    pub left_out: usize,
    /// Energy that the current gave to the motion, over all that went to and fro between them, -1 to 1. From
    /// rest a current can only give to a machine, whatever its springs.
    pub work: f64,
}

/// Fewer rows say nothing.
const FEWEST: usize = 200;
/// More rows say little more, and take minutes.
const MOST: usize = 60_000;
/// Rows of standstill at the end that are kept: more say nothing.
const STANDING: usize = 100;
/// Counts by which the first period may move the actuator beyond what its current can do.
const REST: f64 = 8.0;

const COLUMNS: [&str; 3] = ["time[s]", "count[1]", "applied_current[A]"];

/// One row: line in the file, time, count, current, mode.
struct Row {
    line: usize,
    time: f64,
    count: i64,
    current: f64,
    mode: String,
}

impl Log {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Read`] or [`Error::Input`].
    pub fn load(path: &Path, drive: &Drive) -> Result<Self> {
        let file = std::fs::File::open(path).map_err(Error::read(path))?;
        Self::parse(file, &path.display().to_string(), drive)
    }

    /// * `name`: of the file, for messages
    /// * `drive`: whose log it is: its sample time and encoder
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn parse(text: impl Read, name: &str, drive: &Drive) -> Result<Self> {
        let error = |line: Option<usize>, message: String| Error::Input {
            place: line.map_or(name.into(), |line| format!("{name}:{line}")),
            message,
        };
        let (rows, drive_name) = rows(text, &error)?;
        let rows = moving(stretch(&rows));
        let left_out = rows.len().saturating_sub(MOST);
        let rows = &rows[..rows.len() - left_out];
        if rows.len() < FEWEST {
            let message = format!("{} control periods: must be {FEWEST} at least", rows.len());
            return Err(error(None, message));
        }
        let period = drive.control.sample_time;
        for pair in rows.windows(2) {
            let step = (pair[1].time - pair[0].time) / period;
            if (step - 1.0).abs() > 0.1 {
                let message = format!(
                    "{} is {:.6} s after the row before: must be one control period of {period} s, \
                     none may be missing",
                    COLUMNS[0],
                    pair[1].time - pair[0].time
                );
                return Err(error(Some(pair[1].line), message));
            }
        }
        let actuator = &drive.actuator;
        let allowed = actuator.current_limit + actuator.current_resolution;
        if let Some(row) = rows.iter().find(|row| row.current.abs() > allowed) {
            let message = format!(
                "{} = {}: is beyond the drive's current_limit of {} A",
                COLUMNS[2], row.current, actuator.current_limit
            );
            return Err(error(Some(row.line), message));
        }
        if rows.iter().all(|row| row.current == rows[0].current) {
            let message = format!(
                "{} never changes: nothing can be identified without excitation",
                COLUMNS[2]
            );
            return Err(error(None, message));
        }
        let position = unwrapped(rows, drive.encoder.counter_bits).map_err(|(line, jump)| {
            let message = format!(
                "{} jumps by {jump} counts: more than a quarter of the counter's range in one period",
                COLUMNS[1]
            );
            error(Some(line), message)
        })?;
        let (low, high) = position
            .iter()
            .fold((i64::MAX, i64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
        if ((high - low) as f64) < LEAST_COUNTS {
            let message = format!(
                "the actuator moves by {} counts: must be {LEAST_COUNTS} at least, so that rounding does not \
                 hide the motion; excite with more current or use a finer encoder",
                high - low
            );
            return Err(error(None, message));
        }
        // From rest the current alone moves it; thrice that, the mass being known roughly.
        let acceleration =
            actuator.actual_force_constant() * rows[1].current.abs() / actuator.actual_mass();
        let moved = position[1].abs() as f64;
        let most = REST + 1.5 * acceleration * period * period / drive.encoder.resolution;
        if moved > most {
            let message = format!(
                "the actuator moves by {moved} counts in the first period, more than its current can do \
                 from rest: the log must begin at rest"
            );
            return Err(error(Some(rows[1].line), message));
        }
        let steps = position.windows(2).map(|pair| pair[1] - pair[0]);
        let (mut work, mut exchanged) = (0.0, 0.0);
        for (step, row) in steps.zip(&rows[1..]) {
            let given = step as f64 * row.current;
            work += given;
            exchanged += given.abs();
        }
        Ok(Self {
            name: name.into(),
            drive: drive_name,
            work: if exchanged > 0.0 {
                work / exchanged
            } else {
                0.0
            },
            period,
            position: position
                .iter()
                .map(|count| *count as f64 * drive.encoder.resolution)
                .collect(),
            current: rows[1..].iter().map(|row| row.current).collect(),
            left_out,
        })
    }

    /// The log's first periods.
    #[must_use]
    pub(super) fn beginning(&self, periods: usize) -> Self {
        let periods = periods.min(self.current.len());
        Self {
            position: self.position[..=periods].to_vec(),
            current: self.current[..periods].to_vec(),
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

/// The text of a log without what spreadsheets put before it, and what separates its fields: the one of
/// comma, semicolon and tab that is most in the header.
fn separated(mut text: impl Read) -> std::result::Result<(String, u8, u64), String> {
    let mut bytes = Vec::new();
    text.read_to_end(&mut bytes)
        .map_err(|problem| format!("cannot be read: {problem}"))?;
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err("is text in UTF-16: save it as CSV in UTF-8".into());
    }
    let text = String::from_utf8(bytes).map_err(|_| "is no CSV: it is not text in UTF-8")?;
    let mut text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut skipped = 0;
    // The line by which a spreadsheet is told the separator.
    if text.to_ascii_lowercase().starts_with("sep=") {
        text = text.split_once('\n').map_or("", |(_, rest)| rest);
        skipped = 1;
    }
    let header = text.lines().next().unwrap_or("");
    let count = |separator: &u8| header.bytes().filter(|byte| byte == separator).count();
    // The last of equals is taken.
    let separator = [b'\t', b';', b','].into_iter().max_by_key(count);
    Ok((text.to_owned(), separator.unwrap_or(b','), skipped))
}

/// A number; with a comma for its point where fields are separated by something else.
fn number(text: &str, separator: u8) -> Option<f64> {
    let comma = separator != b',' && !text.contains('.') && text.matches(',').count() == 1;
    let number = if comma {
        text.replace(',', ".").parse::<f64>()
    } else {
        text.parse::<f64>()
    };
    number.ok().filter(|value| value.is_finite())
}

/// All rows, and the drive that they say they are of.
fn rows(
    text: impl Read,
    error: &impl Fn(Option<usize>, String) -> Error,
) -> Result<(Vec<Row>, Option<String>)> {
    let (text, separator, skipped) = separated(text).map_err(|problem| error(None, problem))?;
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = reader
        .headers()
        .map_err(|problem| error(None, format!("is no CSV: {problem}")))?
        .clone();
    let column = |name: &str| header.iter().position(|title| title == name);
    let mut columns = [0; 3];
    for (index, name) in columns.iter_mut().zip(COLUMNS) {
        *index = column(name).ok_or_else(|| {
            error(
                Some(1),
                format!("has no column {name}: must have {}", COLUMNS.join(", ")),
            )
        })?;
    }
    let mode = column("mode[name]").or(column("state[name]"));
    let drive = column("drive[name]");
    let mut drive_name = None;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|problem| error(None, format!("is no CSV: {problem}")))?;
        let line = record
            .position()
            .map_or(0, |at| (at.line() + skipped) as usize);
        if record.len() > header.len() {
            let mut message = format!(
                "has {} fields where the header has {}",
                record.len(),
                header.len()
            );
            if separator == b',' {
                message +=
                    ": where numbers have a decimal comma, fields must be separated by ; or tab";
            }
            return Err(error(Some(line), message));
        }
        let number = |index: usize| {
            let text = record.get(columns[index]).unwrap_or("");
            number(text, separator).ok_or_else(|| {
                let message = format!("{} = \"{text}\": must be a number", COLUMNS[index]);
                error(Some(line), message)
            })
        };
        if drive_name.is_none() {
            drive_name = drive
                .and_then(|drive| record.get(drive))
                .filter(|name| !name.is_empty())
                .map(str::to_owned);
        }
        let count = number(1)?;
        if count.fract() != 0.0 || count.abs() > f64::from(u32::MAX) {
            let message = format!(
                "{} = {count}: must be a whole number of 32 bits",
                COLUMNS[1]
            );
            return Err(error(Some(line), message));
        }
        rows.push(Row {
            line,
            time: number(0)?,
            count: count as i64,
            current: number(2)?,
            mode: mode
                .and_then(|mode| record.get(mode))
                .unwrap_or("")
                .to_owned(),
        });
    }
    Ok((rows, drive_name))
}

/// The longest run of rows in which the drive was excited, or else ran; everything where no row says.
fn stretch(rows: &[Row]) -> &[Row] {
    for mode in ["Exciting", "Running"] {
        let runs = rows.chunk_by(|a, b| (a.mode == mode) == (b.mode == mode));
        let longest = runs
            .filter(|run| run.first().is_some_and(|row| row.mode == mode))
            .max_by_key(|run| run.len());
        if let Some(run) = longest {
            return run;
        }
    }
    rows
}

/// Without the rest before anything moves, but for its last row.
fn moving(rows: &[Row]) -> &[Row] {
    let first = rows.first().map_or(0, |row| row.count);
    let moves = |row: &Row| row.current != 0.0 || (row.count - first).abs() as f64 > REST;
    let at = rows.iter().position(moves).unwrap_or(0);
    let last = rows.last().map_or(0, |row| row.count);
    let end = rows.iter().rposition(|row| (row.count - last).abs() > 1);
    let end = end.map_or(rows.len(), |end| (end + 1 + STANDING).min(rows.len()));
    &rows[at.saturating_sub(1)..end]
}

/// Counts from the first row on, without the counter's wrapping; line and size of a jump.
fn unwrapped(rows: &[Row], bits: u32) -> std::result::Result<Vec<i64>, (usize, i64)> {
    let range = 1_i64 << bits;
    let mut total = 0;
    let mut positions = vec![0];
    for pair in rows.windows(2) {
        let difference = (pair[1].count - pair[0].count).rem_euclid(range);
        let signed = if difference >= range / 2 {
            difference - range
        } else {
            difference
        };
        if signed.abs() > range / 4 {
            return Err((pair[1].line, signed));
        }
        total += signed;
        positions.push(total);
    }
    Ok(positions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    /// What spreadsheets make of a log is the same log; what cannot be told apart is refused by name.
    #[test]
    fn spreadsheets_are_read() {
        let drive = Drive::default_drive();
        let mut plain = "time[s],count[1],applied_current[A]\n".to_owned();
        for k in 0..400 {
            let time = f64::from(k) * 1e-3;
            let count = (40_000.0 * (3.0 * time).sin().powi(4)) as i64;
            let current = if k > 0 { (5.0 * time).cos() } else { 0.0 };
            let _ = writeln!(plain, "{time:.3},{count},{current:.6}");
        }
        let parse = |text: &str| Log::parse(text.as_bytes(), "log", &drive);
        let expected = parse(&plain).unwrap();
        let semicolons = plain.replace(',', ";");
        for text in [
            format!("\u{feff}{plain}"),
            semicolons.clone(),
            semicolons.replace('.', ","),
            plain.replace(',', "\t"),
            plain.replace(',', "\t").replace('.', ","),
            format!("sep=;\r\n{}", semicolons.replace('\n', "\r\n")),
        ] {
            assert_eq!(parse(&text).unwrap(), expected, "{}", &text[..80]);
        }
        let commas = plain.replace('.', ",");
        let error = parse(&commas).unwrap_err().to_string();
        assert!(error.contains("log:2: has 5 fields"), "{error}");
        assert!(error.contains("decimal comma"), "{error}");
        let wide: Vec<u8> = [0xFF, 0xFE].into_iter().chain(plain.bytes()).collect();
        let error = Log::parse(&wide[..], "log", &drive)
            .unwrap_err()
            .to_string();
        assert!(error.contains("UTF-16"), "{error}");
    }

    /// A rest before the motion and a day after it change nothing.
    #[test]
    fn rest_and_excess_are_left_out() {
        let drive = Drive::default_drive();
        let text = |rest: usize, periods: usize| {
            let mut text = "time[s],count[1],applied_current[A]\n".to_owned();
            for k in 0..rest + periods {
                let time = k as f64 * 1e-3;
                let moving = k.saturating_sub(rest) as f64 * 1e-3;
                let count = (40_000.0 * (3.0 * moving).sin().powi(4)) as i64 & 0xffff;
                let current = if k > rest { (5.0 * moving).cos() } else { 0.0 };
                let _ = writeln!(text, "{time},{count},{current}");
            }
            text
        };
        let parse = |text: String| Log::parse(text.as_bytes(), "log", &drive).unwrap();
        let plain = parse(text(0, 1000));
        assert_eq!(parse(text(5000, 1000)), plain);
        let long = parse(text(0, MOST + 777));
        assert_eq!((long.left_out, long.position.len()), (777, MOST));
        assert_eq!(long.position[..1000], plain.position[..]);
    }
}
