//! Experiments in closed loop, as a table and JSON.

use super::settled::settled;
use super::table::{right, table};
use crate::chain::controlled_mass;
use crate::design::Design;
use crate::simulate::metrics::Metrics;
use crate::simulate::watch::WATCHED;
use crate::simulate::{Law, Run};
use comfy_table::Cell;
use serde_json::json;

/// Name of a control law in tables.
#[must_use]
pub fn law_name(law: Law, design: &Design) -> &'static str {
    match law {
        Law::Core => design.drive.control.observer.name(),
        Law::FullState => "full state",
        Law::Rival(name) => name,
    }
}

/// The experiments' figures, one row per run.
#[must_use]
pub fn tables(design: &Design, runs: &[(Run, Metrics)]) -> String {
    let mass = controlled_mass(design.loads());
    let units = design.drive.kind.units();
    let micro = units.micro_position;
    let settling = format!("settling mass {mass} [ms]");
    let residual = format!("residual [{micro} p-p]");
    let offset = format!("off at the end [{micro}]");
    let motion = format!("still moving [{micro} p-p]");
    let error = format!("estimate error [{micro} rms]");
    let mut table = table(&[
        "experiment",
        "control",
        &settling,
        "overshoot [%]",
        &residual,
        &offset,
        &motion,
        "peak [A]",
        &error,
    ]);
    let micrometres = |values: &Option<Vec<f64>>| {
        let list = values
            .iter()
            .flatten()
            .map(|value| format!("{:.1}", value * 1e6));
        let list = list.collect::<Vec<_>>().join("  ");
        if list.is_empty() { "-".into() } else { list }
    };
    let both = |values: [f64; 2]| micrometres(&Some(values.to_vec()));
    for (run, metrics) in runs {
        table.add_row([
            Cell::new(run.scenario.name),
            Cell::new(law_name(run.law, design)),
            right(settled(metrics, units)),
            right(format!("{:.1}", metrics.overshoot)),
            right(micrometres(&metrics.residual_vibration)),
            right(both(metrics.end.offset)),
            right(both(metrics.end.motion)),
            right(format!("{:.2}", metrics.peak_current)),
            right(micrometres(&metrics.estimation_error)),
        ]);
    }
    let still = runs
        .first()
        .map_or(0.0, |(_, metrics)| metrics.end.tolerance);
    let titles = runs
        .iter()
        .filter(|(run, _)| run.law == Law::Core)
        .map(|(run, _)| format!("{}: {}\n", run.scenario.name, run.scenario.title(run.kind)));
    format!(
        "{}\n{table}\n\
         Settling: within 2 % of the motion for good, and at rest at the end. Residual vibration: from 0.5 s on. \
         Off at the end: in the last fifth of the run (0.2 s at least). Still moving: in the last fifth of the \
         run and {WATCHED} s more, up to {:.0} {micro} is rest. Lists: actuator first, then loads, or mass {mass} \
         alone.\n",
        titles.collect::<String>(),
        1e6 * still
    )
}

/// The experiments' figures for JSON, and the files that hold every step.
#[must_use]
pub fn json(design: &Design, runs: &[(Run, Metrics)], files: &[String]) -> serde_json::Value {
    let experiments = runs.iter().map(|(run, metrics)| {
        json!({
            "scenario": run.scenario.name,
            "law": run.law,
            "observer": (run.law == Law::Core).then(|| design.drive.control.observer.name()),
            "metrics": metrics,
        })
    });
    let experiments: Vec<_> = experiments.collect();
    json!({ "experiments": experiments, "files": files })
}
