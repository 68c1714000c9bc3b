//! Experiments in closed loop, as a table and JSON.

use super::bound::{failures, ratio};
use super::settled::settled;
use super::table::{right, table};
use crate::chain::controlled_mass;
use crate::design::Design;
use crate::simulate::bound::{Bound, times};
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

/// One run, its figures, and the bound of its experiment.
pub type Judged = (Run, Metrics, Bound);

/// The experiments' figures, one row per run.
#[must_use]
pub fn tables(design: &Design, runs: &[Judged]) -> String {
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
        "x bound",
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
    for (run, metrics, bound) in runs {
        table.add_row([
            Cell::new(run.scenario.name),
            Cell::new(law_name(run.law, design)),
            right(settled(metrics, units)),
            right(ratio(metrics.settling_time, bound)),
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
        .map_or(0.0, |(_, metrics, _)| metrics.end.tolerance);
    let titles = runs
        .iter()
        .filter(|(run, ..)| run.law == Law::Core)
        .map(|(run, ..)| format!("{}: {}\n", run.scenario.name, run.scenario.title(run.kind)));
    let core = runs.iter().filter(|(run, ..)| run.law == Law::Core);
    let named = core.map(|(run, _, bound)| (run.scenario.name, bound));
    format!(
        "{}\n{table}\n\
         Settling: within 2 % of the motion for good, and at rest at the end. x bound: over the least time any \
         control can take on this plant, without friction and forces from outside (`host-sim bound`). Residual vibration: from 0.5 s on. \
         Off at the end: in the last fifth of the run (0.2 s at least). Still moving: in the last fifth of the \
         run and {WATCHED} s more, up to {:.0} {micro} is rest. Lists: actuator first, then loads, or mass {mass} \
         alone.\n{}",
        titles.collect::<String>(),
        1e6 * still,
        failures(named)
    )
}

/// The experiments' figures for JSON, and the files that hold every step.
#[must_use]
pub fn json(design: &Design, runs: &[Judged], files: &[String]) -> serde_json::Value {
    let experiments = runs.iter().map(|(run, metrics, bound)| {
        json!({
            "scenario": run.scenario.name,
            "law": run.law,
            "observer": (run.law == Law::Core).then(|| design.drive.control.observer.name()),
            "metrics": metrics,
            "bound": bound.as_ref().ok(),
            "times_bound": times(metrics.settling_time, bound),
        })
    });
    let experiments: Vec<_> = experiments.collect();
    json!({ "experiments": experiments, "files": files })
}
