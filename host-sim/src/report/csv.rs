//! One row per control period; `name[unit]` headers, time first.
//!
//! The columns are the same for simulation and drive log as far as both know them; the true
//! motion stands in the `…_true` columns.

use super::columns;
use crate::error::{Error, Result};
use crate::machine::Units;
use crate::simulate::Run;
use crate::simulate::corridor::Record;
use arso_core::telemetry::Column;

/// The run as CSV.
///
/// # Errors
/// [`Error::Report`] when the rows cannot be formed.
pub fn csv(run: &Run) -> Result<Vec<u8>> {
    let failed = |error: String| Error::Report(format!("its CSV cannot be formed: {error}"));
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let masses = run
        .samples
        .first()
        .map_or(0, |sample| sample.truth.len() / 2);
    let observed = run.samples.iter().find_map(|sample| sample.record.as_ref());
    writer
        .write_record(header(run.kind.units(), masses, observed))
        .map_err(|e| failed(e.to_string()))?;
    for sample in &run.samples {
        let mut row = vec![
            super::time(sample.time).to_string(),
            sample.count.to_string(),
            sample.applied_current.to_string(),
            sample.command.to_string(),
            u8::from(sample.limited).to_string(),
            sample.reference.to_string(),
        ];
        row.extend(sample.truth.iter().map(f64::to_string));
        row.push(sample.true_reaction_force.to_string());
        if let Some(record) = &sample.record {
            row.extend(found(record).map(|column| column.value.to_string()));
        }
        writer
            .write_record(row)
            .map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}

/// What the core found.
fn found(record: &Record) -> impl Iterator<Item = Column> {
    let estimated = |column: &Column| column.closed_loop && column.name != "reference";
    let columns = record.columns();
    columns.filter(move |column| column.mass.is_some() || estimated(column))
}

fn header(units: &Units, masses: usize, record: Option<&Record>) -> Vec<String> {
    let (position, velocity, force) = (units.position, units.velocity, units.force);
    let mut names: Vec<String> = [
        "time[s]",
        "count[1]",
        "applied_current[A]",
        "command[A]",
        "limited[1]",
    ]
    .map(String::from)
    .to_vec();
    names.push(format!("reference[{position}]"));
    for mass in 0..masses {
        let name = match mass {
            0 => "actuator".into(),
            load => format!("load{load}"),
        };
        names.push(format!("{name}_position_true[{position}]"));
        names.push(format!("{name}_velocity_true[{velocity}]"));
    }
    names.push(format!("reaction_force_true[{force}]"));
    let found = record.into_iter().flat_map(found);
    names.extend(found.map(|column| columns::title(units, &column)));
    names
}
