//! The drive's log as table, CSV and plot.
//!
//! The CSV has the column names of the simulation wherever both know the quantity. What the drive
//! estimates and follows while its loop is closed is left blank while it is open.

use crate::capture::{Capture, LogRecord};
use crate::error::{Error, Result};
use crate::machine::{Kind, Units};
use crate::report::plot::{Panel, Series, panels};
use comfy_table::{Cell, CellAlignment, Table, presets};
use std::collections::{BTreeMap, BTreeSet};

/// Unit and name in a CSV header of a quantity of the telemetry.
fn column(units: &Units, name: &str) -> String {
    let unit = match name {
        _ if name.ends_with("velocity") => units.velocity,
        _ if name.ends_with("position") || name == "reference" => units.position,
        "applied_current" | "command" => "A",
        "disturbance" | "reaction_force" | "disturbance_state" => units.force,
        _ => "1",
    };
    match name {
        "position" | "velocity" => format!("actuator_{name}[{unit}]"),
        _ => format!("{name}[{unit}]"),
    }
}

/// A quantity of a record, if it had a meaning at the time.
fn value(record: &LogRecord, name: &str) -> Option<f64> {
    let closed_loop = match name {
        "reference" | "velocity" | "disturbance" | "reaction_force" | "disturbance_state" => true,
        _ => name.starts_with("load"),
    };
    let known = !closed_loop || record.state == "Running";
    record.values.get(name).copied().filter(|_| known)
}

/// Every quantity that had a meaning at some time.
fn names(capture: &Capture) -> BTreeSet<&str> {
    capture
        .records
        .iter()
        .flat_map(|record| {
            let names = record.values.keys().map(String::as_str);
            names.filter(|name| value(record, name).is_some())
        })
        .collect()
}

/// Time of a record from the first one on, s.
fn time(capture: &Capture, record: &LogRecord, period: f64) -> f64 {
    let first = capture.records.first().map_or(0, |record| record.step);
    super::time(f64::from(record.step.wrapping_sub(first)) * period)
}

/// One row per record.
///
/// # Errors
/// [`Error::Simulation`] when the rows cannot be formed.
pub fn csv(capture: &Capture, period: f64, kind: Kind) -> Result<Vec<u8>> {
    let failed =
        |error: String| Error::Simulation(format!("the log's CSV cannot be formed: {error}"));
    let names = names(capture);
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let header = ["time[s]".into(), "step[1]".into(), "state[name]".into()];
    let header = header
        .into_iter()
        .chain(names.iter().map(|name| column(kind.units(), name)));
    writer
        .write_record(header)
        .map_err(|e| failed(e.to_string()))?;
    for record in &capture.records {
        let mut row = vec![
            time(capture, record, period).to_string(),
            record.step.to_string(),
            record.state.clone(),
        ];
        let values = names.iter().map(|name| value(record, name));
        row.extend(values.map(|value| value.map_or(String::new(), |value| value.to_string())));
        writer
            .write_record(row)
            .map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}

/// How long the drive was in which state, and the range of every quantity.
#[must_use]
pub fn table(capture: &Capture, period: f64, kind: Kind) -> String {
    let mut ranges: BTreeMap<&str, (f64, f64, f64)> = BTreeMap::new();
    let mut states: BTreeMap<&str, u32> = BTreeMap::new();
    for record in &capture.records {
        *states.entry(&record.state).or_default() += 1;
        for name in record.values.keys() {
            if let Some(value) = value(record, name) {
                let range = ranges.entry(name).or_insert((f64::MAX, f64::MIN, 0.0));
                *range = (range.0.min(value), range.1.max(value), value);
            }
        }
    }
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["quantity", "least", "greatest", "last"]);
    let right = |value: f64| Cell::new(format!("{value:.6}")).set_alignment(CellAlignment::Right);
    for (name, (least, greatest, last)) in ranges {
        table.add_row([
            Cell::new(column(kind.units(), name)),
            right(least),
            right(greatest),
            right(last),
        ]);
    }
    let states = states
        .iter()
        .map(|(state, count)| format!("{state} {:.3} s", f64::from(*count) * period));
    format!(
        "{} control steps, {} lost, {} damaged frames; {}\n{table}\n",
        capture.records.len(),
        capture.lost,
        capture.malformed,
        states.collect::<Vec<_>>().join(", ")
    )
}

/// Motion, current, forces and cycles over time.
///
/// # Errors
/// [`Error::Simulation`] when the drawing cannot be made.
pub fn plot(capture: &Capture, period: f64, kind: Kind) -> Result<String> {
    let known = names(capture);
    let series = |names: &[&str], scale: f64| -> Vec<Series> {
        names
            .iter()
            .filter(|name| known.contains(**name))
            .map(|name| {
                let points = capture.records.iter().filter_map(|record| {
                    let value = value(record, name)?;
                    Some((time(capture, record, period), scale * value))
                });
                ((*name).to_owned(), points.collect())
            })
            .collect()
    };
    let loads: Vec<String> = (1..=crate::drive::MAX_LOADS)
        .map(|i| format!("load{i}_position"))
        .collect();
    let mut motion = vec!["position"];
    motion.extend(loads.iter().map(String::as_str));
    motion.push("reference");
    let units = kind.units();
    let over = "time [s]";
    panels(
        "log of the drive",
        &[
            Panel {
                caption: "motion as estimated",
                axes: (over, &format!("position [{}]", units.milli_position)),
                series: series(&motion, 1e3),
            },
            Panel {
                caption: "current",
                axes: (over, "current [A]"),
                series: series(&["command"], 1.0),
            },
            Panel {
                caption: "forces",
                axes: (over, &format!("force [{}]", units.force)),
                series: series(&["reaction_force", "disturbance", "disturbance_state"], 1.0),
            },
            Panel {
                caption: "control step",
                axes: (over, "processor cycles"),
                series: series(&["cycles"], 1.0),
            },
        ],
    )
}
