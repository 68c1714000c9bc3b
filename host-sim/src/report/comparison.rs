//! The drive beside its rivals: a table of all laws on all plants, what they were tuned to, and JSON.

use super::bound::{failures, ratio};
use super::plot::{Panel, Series, panels};
use super::settled::settled;
use crate::chain::controlled_mass;
use crate::compare::{Outcome, Row, Tuning, duration};
use crate::design::Design;
use crate::error::Result;
use crate::machine::Units;
use crate::simulate::bound::{Bound, times};
use comfy_table::{Table, presets};
use serde_json::json;

/// Every law's figures for JSON.
///
/// * `bounds`: of each plant
#[must_use]
pub fn json(design: &Design, rows: &[Row], bounds: &[Bound]) -> serde_json::Value {
    let laws = rows.iter().map(|row| {
        let mut law = json!(row);
        let settled = row.outcomes.iter().map(|outcome| {
            let metrics = outcome.metrics.as_ref();
            metrics.and_then(|metrics| metrics.settling_time)
        });
        for (case, (settled, bound)) in settled.zip(bounds).enumerate() {
            law["outcomes"][case]["times_bound"] = json!(times(settled, bound));
        }
        law
    });
    let laws: Vec<_> = laws.collect();
    let cases = rows.first().into_iter().flat_map(|row| &row.outcomes);
    let bounds: Vec<_> = cases
        .zip(bounds)
        .map(|(outcome, bound)| {
            json!({
                "case": outcome.case,
                "bound": bound.as_ref().ok(),
                "failure": bound.as_ref().err().map(ToString::to_string),
            })
        })
        .collect();
    json!({ "kind": design.drive.kind, "bounds": bounds, "laws": laws })
}

/// What is compared, the table, and what the rivals were tuned to.
///
/// * `bounds`: of each plant
#[must_use]
pub fn text(design: &Design, rows: &[Row], bounds: &[Bound]) -> String {
    let units = design.drive.kind.units();
    let mass = controlled_mass(design.loads());
    let cases = rows.first().into_iter().flat_map(|row| &row.outcomes);
    let named = cases.map(|outcome| outcome.case.as_str()).zip(bounds);
    format!(
        "Step of 30 {}, runs of {:.2} s. Each cell: settling time of mass {mass} to 2 % [ms] (over the bound) / \
         overshoot [%] / residual vibration [{} p-p]. Bound: least time any control can take on that plant, \
         without friction.\n\n{}\n\n{}{}",
        units.milli_position,
        duration(design),
        units.micro_position,
        table(rows, bounds, mass, units),
        tunings(rows, units),
        failures(named),
    )
}

/// Settling time and overshoot of every law on every plant, a row for each plant, as SVG. What does not settle
/// or fails stands at the right edge.
///
/// # Errors
/// [`Error::Report`](crate::error::Error::Report) when the drawing cannot be made.
pub fn plot(design: &Design, rows: &[Row]) -> Result<String> {
    let cases = rows.first().into_iter().flat_map(|row| &row.outcomes);
    let cases: Vec<String> = cases.map(|outcome| outcome.case.clone()).collect();
    let settled = |outcome: &Outcome| {
        let metrics = outcome.metrics.as_ref()?;
        metrics.settling_time.map(|time| 1e3 * time)
    };
    let overshoot = |outcome: &Outcome| {
        let metrics = outcome.metrics.as_ref()?;
        metrics.settling_time.map(|_| metrics.overshoot)
    };
    let dots = |value: &dyn Fn(&Outcome) -> Option<f64>| -> Vec<Series> {
        let all = rows.iter().flat_map(|row| &row.outcomes);
        let edge = 1.1 * all.filter_map(value).fold(0.0, f64::max);
        let each = rows.iter().enumerate().map(|(law, row)| {
            // Laws beside each other, so that none hides another.
            let aside = 0.09 * (law as f64 - (rows.len() - 1) as f64 / 2.0);
            let points = row.outcomes.iter().enumerate();
            let points = points
                .map(|(case, outcome)| (value(outcome).unwrap_or(edge), -(case as f64) - aside));
            Series::dots(row.law, law, points.collect())
        });
        each.collect()
    };
    let mass = controlled_mass(design.loads());
    let panel = |caption, title, series| Panel {
        caption,
        axes: (title, ""),
        series,
        rows: cases.clone(),
        ..Panel::default()
    };
    panels(
        &format!("step of 30 {}", design.drive.kind.units().milli_position),
        &[
            panel(
                &format!("settling of mass {mass} to 2 % (right edge: does not settle)"),
                "settling time [ms]",
                dots(&settled),
            ),
            panel(
                &format!("overshoot of mass {mass} (right edge: does not settle)"),
                "overshoot [%]",
                dots(&overshoot),
            ),
        ],
    )
}

fn table(rows: &[Row], bounds: &[Bound], mass: usize, units: &Units) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    let cases = rows.first().into_iter().flat_map(|row| &row.outcomes);
    table.set_header(
        std::iter::once("law".to_owned()).chain(cases.map(|outcome| outcome.case.clone())),
    );
    let least = bounds.iter().map(|bound| match bound {
        Ok(bound) => format!("{:.0}", 1e3 * bound.settled),
        Err(_) => "-".into(),
    });
    table.add_row(std::iter::once("bound".to_owned()).chain(least));
    for row in rows {
        let cells = row
            .outcomes
            .iter()
            .zip(bounds)
            .map(|(outcome, bound)| cell(outcome, bound, mass, units));
        table.add_row(std::iter::once(row.law.to_owned()).chain(cells));
    }
    table
}

fn cell(outcome: &Outcome, bound: &Bound, mass: usize, units: &Units) -> String {
    let Some(metrics) = &outcome.metrics else {
        return "failed".into();
    };
    let shown = settled(metrics, units);
    if metrics.fault.is_some() {
        return shown;
    }
    if metrics.settling_time.is_none() {
        return format!("{shown} / {:.1}", metrics.overshoot);
    }
    let residual = metrics.residual_vibration.as_ref();
    let residual = residual.and_then(|masses| masses.get(mass));
    format!(
        "{shown} ({}) / {:.1} / {}",
        ratio(metrics.settling_time, bound),
        metrics.overshoot,
        residual.map_or("-".into(), |x| format!("{:.0}", 1e6 * x))
    )
}

/// What the rivals were tuned to, a line each, and why a law failed.
fn tunings(rows: &[Row], units: &Units) -> String {
    let mut text = String::new();
    for row in rows {
        match &row.tuning {
            Tuning::Design => {}
            Tuning::Pd(pd) => {
                text += &format!(
                    "{}: {:.2} {}, {:.3} {}",
                    row.law,
                    pd.position_gain,
                    units.position_gain,
                    pd.velocity_gain,
                    units.velocity_gain
                );
                if row.law != "PD" {
                    text += &format!(
                        ", ramps of {:.1} ms, shaper for {:.2} Hz and damping ratio {:.2}",
                        1e3 * pd.ramp,
                        pd.frequency / std::f64::consts::TAU,
                        pd.damping
                    );
                }
                text += "\n";
            }
            Tuning::Encoder(filter) => {
                let force = units.force;
                text += &format!(
                    "{}: {:.2e} {force}/sqrt(Hz) on each load, disturbance {:.2e} {force}/sqrt(s)\n",
                    row.law, filter.load_force, filter.disturbance
                );
            }
        }
        for outcome in &row.outcomes {
            if let Some(failure) = &outcome.failure {
                text += &format!("{}, {}: {failure}\n", row.law, outcome.case);
            }
        }
    }
    text
}
