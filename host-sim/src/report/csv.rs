//! One row per control period; `name[unit]` headers, time first.
//!
//! The columns are the same for simulation and drive log as far as both know them; the true
//! motion stands in the `…_true` columns.

use crate::error::{Error, Result};
use crate::machine::Units;
use crate::simulate::Run;

/// The run as CSV.
///
/// # Errors
/// [`Error::Simulation`] when the rows cannot be formed.
pub fn csv(run: &Run) -> Result<Vec<u8>> {
    let failed = |error: String| Error::Simulation(format!("its CSV cannot be formed: {error}"));
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let masses = run
        .samples
        .first()
        .map_or(0, |sample| sample.truth.len() / 2);
    let observed = run.samples.iter().any(|sample| sample.record.is_some());
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
            row.extend(record.estimate.iter().map(f64::to_string));
            row.push(record.reaction_force.to_string());
            row.push(record.disturbance.to_string());
            row.push(record.disturbance_state.to_string());
        }
        writer
            .write_record(row)
            .map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}

fn header(units: &Units, masses: usize, observed: bool) -> Vec<String> {
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
    let mut motion = |suffix: &str| {
        for mass in 0..masses {
            let name = if mass == 0 {
                "actuator".into()
            } else {
                format!("load{mass}")
            };
            names.push(format!("{name}_position{suffix}[{position}]"));
            names.push(format!("{name}_velocity{suffix}[{velocity}]"));
        }
        names.push(format!("reaction_force{suffix}[{force}]"));
    };
    motion("_true");
    if observed {
        motion("");
        names.push(format!("disturbance[{force}]"));
        names.push(format!("disturbance_state[{force}]"));
    }
    names
}
