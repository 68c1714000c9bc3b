//! The drive's log as table, CSV and plot.
//!
//! The CSV has the column names of the simulation wherever both know the quantity. What the drive
//! estimates and follows while its loop is closed is left blank while it is open.

use super::columns;
use crate::capture::Capture;
use crate::error::{Error, Result};
use crate::machine::Kind;
use crate::report::plot::{Panel, Series, panels};
use crate::simulate::corridor::Record;
use arso_core::Mode;
use arso_core::telemetry::{Column, Quantity};
use comfy_table::{Cell, CellAlignment, Table, presets};
use std::collections::BTreeMap;

/// Whether a column of a record means something.
fn known(record: &Record, column: &Column) -> bool {
    !column.closed_loop || record.mode == Mode::Running
}

/// Every column that means something in some record, as the first of these has it.
fn shown(capture: &Capture) -> Vec<Column> {
    let running = capture.records.iter().find(|r| r.mode == Mode::Running);
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

/// Time of a record from the first one on, s.
fn time(capture: &Capture, record: &Record, period: f64) -> f64 {
    let first = capture.records.first().map_or(0, |record| record.period);
    super::time(f64::from(record.period.wrapping_sub(first)) * period)
}

/// One row per record.
///
/// # Errors
/// [`Error::Report`] when the rows cannot be formed.
pub fn csv(capture: &Capture, period: f64, kind: Kind) -> Result<Vec<u8>> {
    let failed = |error: String| Error::Report(format!("the log's CSV cannot be formed: {error}"));
    let shown = shown(capture);
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let header = ["time[s]".into(), "period[1]".into(), "mode[name]".into()];
    let titles = shown
        .iter()
        .map(|column| columns::title(kind.units(), column));
    writer
        .write_record(header.into_iter().chain(titles))
        .map_err(|e| failed(e.to_string()))?;
    for record in &capture.records {
        let mut row = vec![
            time(capture, record, period).to_string(),
            record.period.to_string(),
            format!("{:?}", record.mode),
        ];
        row.extend(shown.iter().map(|column| {
            value(record, column).map_or(String::new(), |value| text(column, value))
        }));
        writer
            .write_record(row)
            .map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}

/// How long the drive was in which mode, and the range of every quantity.
#[must_use]
pub fn table(capture: &Capture, period: f64, kind: Kind) -> String {
    let mut modes: BTreeMap<String, u32> = BTreeMap::new();
    for record in &capture.records {
        *modes.entry(format!("{:?}", record.mode)).or_default() += 1;
    }
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["quantity", "least", "greatest", "last"]);
    let right = |value: f64| Cell::new(format!("{value:.6}")).set_alignment(CellAlignment::Right);
    for column in shown(capture) {
        let mut range = (f64::MAX, f64::MIN, 0.0);
        for value in capture
            .records
            .iter()
            .filter_map(|record| value(record, &column))
        {
            range = (f64::min(range.0, value), f64::max(range.1, value), value);
        }
        table.add_row([
            Cell::new(columns::title(kind.units(), &column)),
            right(range.0),
            right(range.1),
            right(range.2),
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
    let series = |wanted: &dyn Fn(&Column) -> bool, scale: f64| -> Vec<Series> {
        let wanted = shown.iter().filter(|column| wanted(column));
        let series = wanted.map(|column| {
            let points = capture.records.iter().filter_map(|record| {
                let value = value(record, column)?;
                Some((time(capture, record, period), scale * value))
            });
            (columns::name(column), points.collect())
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
            },
            Panel {
                caption: "current",
                axes: (over, "current [A]"),
                series: series(&|column| column.name == "command", 1.0),
            },
            Panel {
                caption: "forces",
                axes: (over, &format!("force [{}]", units.force)),
                series: series(&|column| column.quantity == Quantity::Force, 1.0),
            },
            Panel {
                caption: "control interrupt",
                axes: (over, "processor cycles"),
                series: series(&|column| column.name == "cycles", 1.0),
            },
        ],
    )
}
