//! The drive's log as table, CSV and plot.
//!
//! The CSV has the column names of the simulation wherever both know the quantity. What the drive
//! estimates and follows while its loop is closed is left blank while it is open.

use super::columns;
use crate::capture::{Capture, Origin};
use crate::error::{Error, Result};
use crate::machine::Kind;
use crate::report::plot::{Panel, Series, panels};
use crate::simulate::corridor::Record;
use arso_core::telemetry::{Column, Quantity};
use comfy_table::{Cell, CellAlignment, Table, presets};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write;

/// Whether a column of a record means something.
fn known(record: &Record, column: &Column) -> bool {
    !column.closed_loop || record.mode.closed_loop()
}

/// Every column that means something in some record, as the first of these has it.
fn shown(capture: &Capture) -> Vec<Column> {
    let running = capture.records.iter().find(|r| r.mode.closed_loop());
    let record = running.or(capture.records.first());
    let columns = record.into_iter().flat_map(|record| {
        let columns = record.columns();
        columns.filter(|column| known(record, column))
    });
    columns.collect()
}

/// A column of a record, if it has it and it means something.
fn value(record: &Record, wanted: &Column) -> Option<f64> {
    let mut columns = record.columns();
    let found = columns.find(|column| (column.mass, column.name) == (wanted.mass, wanted.name));
    found
        .filter(|column| known(record, column))
        .map(|column| column.value)
}

/// In as few figures as read back to the same number.
fn text(column: &Column, value: f64) -> String {
    match column.quantity {
        Quantity::Number => value.to_string(),
        _ => (value as f32).to_string(),
    }
}

/// How many control periods the drive was in which mode.
fn modes(capture: &Capture) -> BTreeMap<String, u32> {
    let mut modes = BTreeMap::new();
    for record in &capture.records {
        *modes.entry(format!("{:?}", record.mode)).or_default() += 1;
    }
    modes
}

/// Least, greatest and last value of a column.
fn range(capture: &Capture, column: &Column) -> [f64; 3] {
    let values = capture.records.iter();
    let values = values.filter_map(|record| value(record, column));
    values.fold([f64::MAX, f64::MIN, 0.0], |[least, greatest, _], value| {
        [least.min(value), greatest.max(value), value]
    })
}

/// What the table holds for JSON, SI units, and what the drive said.
#[must_use]
pub fn json(capture: &Capture, period: f64, kind: Kind) -> serde_json::Value {
    let columns = shown(capture).into_iter().map(|column| {
        let [least, greatest, last] = range(capture, &column);
        let title = columns::title(kind.units(), &column);
        let range = json!({ "least": least, "greatest": greatest, "last": last });
        (title, range)
    });
    let modes = modes(capture).into_iter();
    let modes: BTreeMap<String, f64> = modes
        .map(|(mode, count)| (mode, f64::from(count) * period))
        .collect();
    json!({
        "kind": kind,
        "sample_time": period,
        "drives": capture.origins,
        "control_periods": capture.records.len(),
        "lost": capture.lost,
        "damaged": capture.malformed,
        "resets": capture.restarts.len(),
        "mode_durations": modes,
        "columns": columns.collect::<serde_json::Map<_, _>>(),
        "messages": capture.messages,
    })
}

/// One row per record.
///
/// # Errors
/// [`Error::Report`] when the rows cannot be formed.
pub fn csv(capture: &Capture, period: f64, kind: Kind) -> Result<Vec<u8>> {
    let failed = |error: String| Error::Report(format!("the log's CSV cannot be formed: {error}"));
    let write = || -> ::csv::Result<Rows<Vec<u8>>> {
        let mut rows = Rows::new(Vec::new(), shown(capture), kind, capture.origins.first())?;
        for (record, time) in capture.records.iter().zip(capture.times(period)) {
            rows.add(record, time)?;
        }
        Ok(rows)
    };
    let rows = write().map_err(|e| failed(e.to_string()))?;
    rows.writer.into_inner().map_err(|e| failed(e.to_string()))
}

/// The same, row by row.
#[derive(Debug)]
pub struct Rows<W: Write> {
    writer: ::csv::Writer<W>,
    shown: Vec<Column>,
    mark: Option<String>,
}

impl<W: Write> Rows<W> {
    /// Begins with the header for records of which this is the first.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn of(into: W, first: &Record, origin: &Origin) -> ::csv::Result<Self> {
        Self::new(into, first.columns().collect(), origin.kind, Some(origin))
    }

    fn new(
        into: W,
        shown: Vec<Column>,
        kind: Kind,
        origin: Option<&Origin>,
    ) -> ::csv::Result<Self> {
        let mut writer = ::csv::Writer::from_writer(into);
        let header = ["time[s]".into(), "period[1]".into(), "mode[name]".into()];
        // Last, and the same in every row: which drive wrote this must not get lost.
        let mark = origin.map(Origin::mark);
        let titles = shown
            .iter()
            .map(|column| columns::title(kind.units(), column));
        let last = mark.as_ref().map(|_| "drive[name]".into());
        writer.write_record(header.into_iter().chain(titles).chain(last))?;
        Ok(Self {
            writer,
            shown,
            mark,
        })
    }

    /// Writes a record.
    ///
    /// * `time`: s
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, record: &Record, time: f64) -> ::csv::Result<()> {
        let mut row = vec![
            super::time(time).to_string(),
            record.period.to_string(),
            format!("{:?}", record.mode),
        ];
        row.extend(self.shown.iter().map(|column| {
            value(record, column).map_or(String::new(), |value| text(column, value))
        }));
        row.extend(self.mark.clone());
        self.writer.write_record(row)
    }

    /// Passes on what has been written.
    ///
    /// # Errors
    /// When it cannot be.
    pub fn flush(&mut self) -> std::io::Result<()> {
        self.writer.flush()
    }

    /// What was written into.
    ///
    /// # Errors
    /// When what has been written cannot be passed on.
    pub fn into_inner(self) -> std::io::Result<W> {
        self.writer
            .into_inner()
            .map_err(::csv::IntoInnerError::into_error)
    }
}

/// How long the drive was in which mode, and the range of every quantity.
#[must_use]
pub fn table(capture: &Capture, period: f64, kind: Kind) -> String {
    let modes = modes(capture);
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["quantity", "least", "greatest", "last"]);
    let right = |value: f64| Cell::new(format!("{value:.6}")).set_alignment(CellAlignment::Right);
    for column in shown(capture) {
        let [least, greatest, last] = range(capture, &column);
        table.add_row([
            Cell::new(columns::title(kind.units(), &column)),
            right(least),
            right(greatest),
            right(last),
        ]);
    }
    let modes = modes
        .iter()
        .map(|(mode, count)| format!("{mode} {:.3} s", f64::from(*count) * period));
    format!(
        "{} control periods, {} lost, {} damaged frames; {}\n{table}\n",
        capture.records.len(),
        capture.lost,
        capture.malformed,
        modes.collect::<Vec<_>>().join(", ")
    )
}

/// Motion, current, forces and cycles over time.
///
/// # Errors
/// [`Error::Simulation`] when the drawing cannot be made.
pub fn plot(capture: &Capture, period: f64, kind: Kind) -> Result<String> {
    let shown = shown(capture);
    let times = capture.times(period);
    let series = |wanted: &dyn Fn(&Column) -> bool, scale: f64| -> Vec<Series> {
        let wanted = shown.iter().filter(|column| wanted(column));
        let series = wanted.enumerate().map(|(colour, column)| {
            let points = capture.records.iter().zip(&times);
            let points = points.filter_map(|(record, time)| {
                let value = value(record, column)?;
                Some((*time, scale * value))
            });
            Series::line(columns::name(column), colour, points.collect())
        });
        series.collect()
    };
    let units = kind.units();
    let over = "time [s]";
    panels(
        "log of the drive",
        &[
            Panel {
                caption: "motion as estimated",
                axes: (over, &format!("position [{}]", units.milli_position)),
                series: series(&|column| column.quantity == Quantity::Position, 1e3),
                ..Panel::default()
            },
            Panel {
                caption: "current",
                axes: (over, "current [A]"),
                series: series(&|column| column.name == "command", 1.0),
                ..Panel::default()
            },
            Panel {
                caption: "forces",
                axes: (over, &format!("force [{}]", units.force)),
                series: series(&|column| column.quantity == Quantity::Force, 1.0),
                ..Panel::default()
            },
            Panel {
                caption: "control interrupt",
                axes: (over, "processor cycles"),
                series: series(&|column| column.name == "cycles", 1.0),
                ..Panel::default()
            },
        ],
    )
}
