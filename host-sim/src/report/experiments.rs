//! Experiments in closed loop, as tables and JSON.

use super::bound::{failures, over, ratio};
use super::settled::{settled, within_tolerance};
use super::table::{right, table};
use crate::chain::controlled_mass;
use crate::design::Design;
use crate::simulate::Law;
use crate::simulate::bound::{times, times_rest};
use crate::simulate::experiment::Judged;
use crate::simulate::watch::WATCHED;
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

/// The experiments' figures, one row per run: when it is there, and what is left of the motion.
#[must_use]
pub fn tables(design: &Design, runs: &[Judged]) -> String {
    let core = || runs.iter().filter(|judged| judged.law == Law::Core);
    let titles = core().map(|judged| format!("{}: {}\n", judged.name, judged.title));
    let named = core().map(|judged| (judged.name.as_str(), &judged.bound));
    format!(
        "{}\n{}\n{}",
        titles.collect::<String>(),
        times_table(design, runs),
        left_table(design, runs),
    ) + &failures(named)
}

fn times_table(design: &Design, runs: &[Judged]) -> String {
    let mass = controlled_mass(design.loads());
    let tolerance = tolerance(design);
    let to_tolerance = format!("to {tolerance} [ms]");
    let mut table = table(&[
        "experiment",
        "control",
        "to 2 % [ms]",
        "x bound",
        &to_tolerance,
        "x rest",
        "overshoot",
        "peak [A]",
    ]);
    for judged in runs {
        let metrics = &judged.metrics;
        table.add_row([
            Cell::new(&judged.name),
            Cell::new(law_name(judged.law, design)),
            right(time(judged, settled(metrics, design.drive.kind.units()))),
            right(ratio(metrics.settling_time, &judged.bound)),
            right(time(judged, within_tolerance(metrics))),
            right(over(times_rest(
                metrics.within_tolerance_from,
                &judged.bound,
            ))),
            right(format!("{:.1} %", metrics.overshoot)),
            right(format!("{:.2}", metrics.peak_current)),
        ]);
    }
    format!(
        "{table}\n\
         To 2 %: mass {mass} within 2 % of the motion for good, and at rest at the end.\n\
         To {tolerance}: actuator and mass {mass} within {tolerance} of the target for good.\n\
         x bound, x rest: over the least time any control can take on this plant until mass {mass} is\n\
         within 2 %, until all masses are at rest, without friction and forces from outside (`host-sim bound`).\n"
    )
}

fn left_table(design: &Design, runs: &[Judged]) -> String {
    let mass = controlled_mass(design.loads());
    let micro = design.drive.kind.units().micro_position;
    let mut table = table(&[
        "experiment",
        "control",
        &format!("residual [{micro} p-p]"),
        &format!("off [{micro}]"),
        &format!("moving [{micro}]"),
        &format!("estimate [{micro} rms]"),
    ]);
    let micrometres = |values: &[f64]| {
        let list = values.iter().map(|value| format!("{:.1}", value * 1e6));
        let list = list.collect::<Vec<_>>().join(" ");
        right(if list.is_empty() { "-".into() } else { list })
    };
    for judged in runs {
        let metrics = &judged.metrics;
        table.add_row([
            Cell::new(&judged.name),
            Cell::new(law_name(judged.law, design)),
            micrometres(metrics.residual_vibration.as_deref().unwrap_or_default()),
            micrometres(&metrics.end.offset),
            micrometres(&metrics.end.motion),
            micrometres(metrics.estimation_error.as_deref().unwrap_or_default()),
        ]);
    }
    let still = runs
        .first()
        .map_or(0.0, |judged| judged.metrics.end.tolerance);
    format!(
        "{table}\n\
         Residual: after settling, and not before 5/12 of the run. Off: from the target, in the\n\
         last fifth of the run. Moving: peak to peak in the last fifth of the run and {WATCHED} s more, up to\n\
         {:.0} {micro} is rest. \
         Lists: actuator first, then loads, or mass {mass} alone.\n",
        1e6 * still,
    )
}

/// The settling tolerance with its unit.
fn tolerance(design: &Design) -> String {
    let micro = design.drive.kind.units().micro_position;
    format!(
        "{} {micro}",
        (1e7 * design.motion.settling_tolerance).round() / 10.0
    )
}

/// When something was reached; a move that another one was put upon has no end.
fn time(judged: &Judged, time: String) -> String {
    match judged.asked {
        Some((one, _)) if one.retargeted => "retargeted".into(),
        _ => time,
    }
}

/// The experiments' figures for JSON, and the files that hold every step.
#[must_use]
pub fn json(design: &Design, runs: &[Judged], files: &[String]) -> serde_json::Value {
    let experiments = runs.iter().map(|judged| {
        let (law, metrics, bound) = (judged.law, &judged.metrics, &judged.bound);
        json!({
            "scenario": judged.name,
            "move": judged.asked.map(|(one, at)| json!({
                "distance": one.distance,
                "target": one.target,
                "at": at,
                "retargeted": one.retargeted,
            })),
            "law": law,
            "observer": (law == Law::Core).then(|| design.drive.control.observer.name()),
            "metrics": metrics,
            "bound": bound.as_ref().ok(),
            "times_bound": times(metrics.settling_time, bound),
            "times_rest": times_rest(metrics.within_tolerance_from, bound),
        })
    });
    let experiments: Vec<_> = experiments.collect();
    json!({ "experiments": experiments, "files": files })
}
