//! Which column is what: the names that `capture` writes, or others that the user gives.

use super::Refusal;
use crate::machine::Kind;
use std::str::FromStr;

/// Names of columns where they are not those of `capture`; nothing where they are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Columns {
    /// Time of the row.
    pub time: Option<String>,
    /// Encoder's counter at that time.
    pub count: Option<String>,
    /// Position at that time, instead of counts.
    pub position: Option<String>,
    /// Current over the period that ends then.
    pub current: Option<String>,
    /// What the drive was doing.
    pub mode: Option<String>,
}

impl Columns {
    /// These, with the names that others have put in.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            time: other.time.or(self.time),
            count: other.count.or(self.count),
            position: other.position.or(self.position),
            current: other.current.or(self.current),
            mode: other.mode.or(self.mode),
        }
    }
}

impl FromStr for Columns {
    type Err = String;

    /// `time=t,count=enc,current=iq`.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut columns = Self::default();
        for pair in text.split(',') {
            let rule = "must be WHAT=NAME with time, count, position, current or mode for WHAT, such as \
                        time=t,count=enc";
            let (what, name) = pair
                .split_once('=')
                .map(|(what, name)| (what.trim(), name.trim()))
                .filter(|(_, name)| !name.is_empty())
                .ok_or_else(|| format!("\"{pair}\": {rule}"))?;
            let column = match what {
                "time" => &mut columns.time,
                "count" => &mut columns.count,
                "position" => &mut columns.position,
                "current" => &mut columns.current,
                "mode" => &mut columns.mode,
                _ => return Err(format!("\"{pair}\": {rule}")),
            };
            if column.replace(name.to_owned()).is_some() {
                return Err(format!("\"{pair}\": {what} is named twice"));
            }
        }
        Ok(columns)
    }
}

/// A column that was found.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    /// Which field of a row.
    pub(super) index: usize,
    /// As the header names it.
    pub(super) title: String,
    /// SI units, or counts, per unit of the column.
    pub(super) scale: f64,
}

/// The columns of a record.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    /// Time, in seconds by its scale unless the steps say otherwise.
    pub(super) time: Found,
    /// Counts or position.
    pub(super) place: Found,
    /// Whether `place` is in counts.
    pub(super) counts: bool,
    /// Current.
    pub(super) current: Found,
    /// What the drive was doing, where the record says.
    pub(super) mode: Option<usize>,
    /// Which drive it was, where the record says.
    pub(super) drive: Option<usize>,
}

const SECONDS: &[(&str, f64)] = &[
    ("s", 1.0),
    ("sec", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("µs", 1e-6),
    ("μs", 1e-6),
];
const AMPERES: &[(&str, f64)] = &[("A", 1.0), ("mA", 1e-3)];
const COUNTS: &[(&str, f64)] = &[
    ("1", 1.0),
    ("counts", 1.0),
    ("count", 1.0),
    ("inc", 1.0),
    ("-", 1.0),
];
const METRES: &[(&str, f64)] = &[("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("µm", 1e-6)];
const RADIANS: &[(&str, f64)] = &[
    ("rad", 1.0),
    ("mrad", 1e-3),
    ("deg", std::f64::consts::PI / 180.0),
    ("°", std::f64::consts::PI / 180.0),
];

/// Finds them in a header.
pub(super) fn layout(
    header: &[String],
    line: usize,
    columns: &Columns,
    kind: Kind,
) -> Result<Layout, Refusal> {
    let search = Search { header, line };
    let lengths = match kind {
        Kind::Linear => METRES,
        Kind::Rotary => RADIANS,
    };
    let count = search.find(columns.count.as_deref(), "count[1]");
    let position = search.find(columns.position.as_deref(), "position");
    let by_position = match (&columns.count, &columns.position) {
        (None, Some(_)) => true,
        (None, None) => count.is_none() && position.is_some(),
        (Some(_), _) => false,
    };
    let place = if by_position {
        search.found("position", columns.position.as_deref(), "position", lengths)
    } else {
        search.found("count", columns.count.as_deref(), "count[1]", COUNTS)
    };
    let mode = match &columns.mode {
        Some(name) => Some(
            search
                .find(Some(name), "")
                .ok_or_else(|| search.missing("mode", name))?,
        ),
        None => search
            .find(None, "mode[name]")
            .or_else(|| search.find(None, "state[name]")),
    };
    Ok(Layout {
        time: search.found("time", columns.time.as_deref(), "time[s]", SECONDS)?,
        place: place?,
        counts: !by_position,
        current: search.found(
            "current",
            columns.current.as_deref(),
            "applied_current[A]",
            AMPERES,
        )?,
        mode,
        drive: search.find(None, "drive[name]"),
    })
}

/// A header that is searched.
struct Search<'a> {
    header: &'a [String],
    line: usize,
}

impl Search<'_> {
    /// The column of this title, or else of this name in whatever unit.
    ///
    /// * `given`, `usual`: as the user names it, and its name if they do not
    fn find(&self, given: Option<&str>, usual: &str) -> Option<usize> {
        let wanted = given.unwrap_or(usual);
        let exact = self.header.iter().position(|title| title == wanted);
        exact.or_else(|| {
            let name = parts(wanted).0;
            let same = |title: &String| parts(title).0.eq_ignore_ascii_case(name);
            self.header.iter().position(same)
        })
    }

    /// The column in one of these units, the first of which it is where it has none.
    fn found(
        &self,
        what: &str,
        given: Option<&str>,
        usual: &str,
        units: &[(&str, f64)],
    ) -> Result<Found, Refusal> {
        let index = self
            .find(given, usual)
            .ok_or_else(|| self.missing(what, given.unwrap_or(usual)))?;
        let title = self.header[index].clone();
        let scale = match parts(&title).1 {
            None => Some(units[0].1),
            Some(unit) => units
                .iter()
                .find(|(name, _)| *name == unit)
                .map(|(_, scale)| *scale),
        };
        let scale = scale.ok_or_else(|| {
            let names: Vec<&str> = units.iter().map(|(name, _)| *name).collect();
            let message = format!(
                "has the column {title}: its unit must be one of {}",
                names.join(", ")
            );
            Refusal::of(self.line, message)
        })?;
        Ok(Found {
            index,
            title,
            scale,
        })
    }

    fn missing(&self, what: &str, name: &str) -> Refusal {
        let has = self.header.join(", ");
        let numbers = |title: &String| super::text::number(title).is_some();
        let message = if self.header.is_empty() {
            format!("has no column {name}: it is empty")
        } else if self.header.iter().all(numbers) {
            format!(
                "has no column {name}: its first line is of numbers; put a line of names before it, such as \
                 time[s],count[1],applied_current[A]"
            )
        } else {
            format!("has no column {name}: it has {has}; say which it is with --column {what}=NAME")
        };
        Refusal::of(self.line, message)
    }
}

/// Name and unit of a title: `time[ms]`, `time (ms)`, `time_ms`.
fn parts(title: &str) -> (&str, Option<&str>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((name, unit)) = title
            .strip_suffix(close)
            .and_then(|title| title.rsplit_once(open))
        {
            return (name.trim(), Some(unit.trim()));
        }
    }
    for unit in ["_ms", "_us"] {
        if let Some(name) = title.strip_suffix(unit) {
            return (name, Some(&unit[1..]));
        }
    }
    (title, None)
}
