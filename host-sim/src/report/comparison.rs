//! The drive beside its rivals: a table of all laws on all plants, what they were tuned to, and JSON.

use super::bound::{failures, ratio};
use super::plot::{Panel, Series, panels};
use super::settled::settled;
use crate::chain::controlled_mass;
use crate::compare::{Comparison, Effort, Outcome, Row, Tuning, duration, evaluations};
use crate::design::Design;
use crate::error::Result;
use crate::machine::Units;
use crate::output::significant;
use crate::simulate::bound::{Bound, times};
use comfy_table::{Table, presets};
use serde_json::json;

/// Every law's figures for JSON.
///
/// * `bounds`: of each plant
#[must_use]
pub fn json(design: &Design, found: &Comparison, bounds: &[Bound]) -> serde_json::Value {
    let cases = found
        .steps
        .first()
        .into_iter()
        .flat_map(|row| &row.outcomes);
    let least: Vec<_> = cases
        .zip(bounds)
        .map(|(outcome, bound)| {
            json!({
                "case": outcome.case,
                "bound": bound.as_ref().ok(),
                "failure": bound.as_ref().err().map(ToString::to_string),
            })
        })
        .collect();
    json!({
        "kind": design.drive.kind,
        "bounds": least,
        "laws": laws(&found.steps, bounds),
        "moves": laws(&found.moves, bounds),
    })
}

fn laws(rows: &[Row], bounds: &[Bound]) -> Vec<serde_json::Value> {
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
    laws.collect()
}

/// What is compared, the table, and what the rivals were tuned to.
///
/// * `bounds`: of each plant
#[must_use]
pub fn text(
    design: &Design,
    Comparison { steps, moves }: &Comparison,
    bounds: &[Bound],
    effort: Effort,
) -> String {
    let units = design.drive.kind.units();
    let mass = controlled_mass(design.loads());
    let cases = steps.first().into_iter().flat_map(|row| &row.outcomes);
    let named = cases.map(|outcome| outcome.case.as_str()).zip(bounds);
    let evaluations = evaluations(design, effort);
    format!(
        "Step of 30 {}, runs of {:.2} s. Each cell: settling time of mass {mass} to 2 % [ms] (over the bound) / \
         overshoot [%] / residual vibration [{} p-p]. Bound: least time any control can take on that plant, \
         without friction.\n\n{}\n\n{}\n\n{}\n\n\
         Planned move over the same distance: all laws on the drive's own plan, with the friction of the drive file \
         fed forward; PD behind input shapers on ramps of its own. Worst: of the plants whose springs, last load \
         and force constant differ.\n\n{}\n\n{}\n\n{}{}{}",
        units.milli_position,
        duration(design),
        units.micro_position,
        table(steps, bounds, mass, units),
        in_words(steps, "By the step, on the nominal plant"),
        held_out(steps),
        of_moves(moves, bounds, mass, units),
        in_words(moves, "By planned moves, on the nominal plant"),
        tunings(steps, units, evaluations, "the step"),
        tunings(moves, units, evaluations, "planned moves"),
        failures(named),
    )
}

/// Every law by planned moves: the nominal plant, the worst of those it is tuned on, the others that are named, and
/// those that were drawn.
fn of_moves(rows: &[Row], bounds: &[Bound], mass: usize, units: &Units) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    let cases = rows.first().into_iter().flat_map(|row| &row.outcomes);
    let others = cases.filter(|outcome| !outcome.tuned_on);
    let mut header = vec!["law".to_owned(), "nominal".into(), "worst".into()];
    header.extend(others.map(|outcome| outcome.case.clone()));
    let drawn = rows.first().map_or(0, |row| row.held_out.plants);
    header.push(format!("{drawn} drawn: median / 95 % / worst [ms]"));
    header.push("not settled".into());
    table.set_header(header);
    for row in rows {
        let named: Vec<_> = row.outcomes.iter().zip(bounds).collect();
        let mut cells = vec![row.law.to_owned()];
        let nominal = named.first();
        cells.push(nominal.map_or("-".into(), |(outcome, bound)| {
            cell(outcome, bound, mass, units)
        }));
        // What does not settle is longest.
        let time = |outcome: &Outcome| {
            let metrics = outcome.metrics.as_ref().filter(|m| m.fault.is_none());
            let time = metrics.and_then(|metrics| metrics.settling_time);
            time.unwrap_or(f64::INFINITY)
        };
        let tuned_on = named.iter().filter(|(outcome, _)| outcome.tuned_on);
        let worst = tuned_on.max_by(|(a, _), (b, _)| time(a).total_cmp(&time(b)));
        cells.push(worst.map_or("-".into(), |(outcome, bound)| {
            format!("{}: {}", outcome.case, cell(outcome, bound, mass, units))
        }));
        let others = named.iter().filter(|(outcome, _)| !outcome.tuned_on);
        cells.extend(others.map(|(outcome, bound)| cell(outcome, bound, mass, units)));
        let found = &row.held_out;
        let times = [found.median, found.most, found.worst];
        let times = times.map(|time| time.map_or("-".into(), |time| format!("{:.0}", 1e3 * time)));
        cells.push(times.join(" / "));
        cells.push(found.not_settled.to_string());
        table.add_row(cells);
    }
    table
}

/// How the drive as designed stands beside the best PD law on the plant it was designed for, the first.
fn in_words(rows: &[Row], on: &str) -> String {
    let nominal = |row: &Row| {
        let metrics = row.outcomes.first()?.metrics.as_ref()?;
        metrics.settling_time.filter(|_| metrics.fault.is_none())
    };
    let drive = rows.iter().find(|row| row.law == "drive").and_then(nominal);
    let rivals = rows
        .iter()
        .filter(|row| matches!(row.tuning, Tuning::Pd(_)));
    let times = rivals.filter_map(|row| Some((row.law, nominal(row)?)));
    let Some((law, time)) = times.min_by(|a, b| a.1.total_cmp(&b.1)) else {
        return format!("{on} no PD law settles.");
    };
    let rival = format!("{law} in {:.0} ms", 1e3 * time);
    match drive {
        None => {
            format!("{on} the drive does not settle, {rival}: PD is better there.")
        }
        Some(drive) => {
            let verdict = if drive < time {
                "the drive is sooner there"
            } else {
                "PD is as good there, or better"
            };
            format!(
                "{on} the drive settles in {:.0} ms, {rival}: {verdict}.",
                1e3 * drive
            )
        }
    }
}

/// What the laws make of plants that none of them was tuned on.
fn held_out(rows: &[Row]) -> String {
    let plants = rows.first().map_or(0, |row| row.held_out.plants);
    if plants == 0 {
        return "No plants were drawn at random.".into();
    }
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header([
        "law",
        "median [ms]",
        "95 % [ms]",
        "worst [ms]",
        "not settled",
    ]);
    for row in rows {
        let found = &row.held_out;
        let time = |time: Option<f64>| time.map_or("-".into(), |time| format!("{:.0}", 1e3 * time));
        table.add_row([
            row.law.to_owned(),
            time(found.median),
            time(found.most),
            time(found.worst),
            found.not_settled.to_string(),
        ]);
    }
    format!(
        "The same step on {plants} plants drawn at random, on which nothing was tuned: stiffness +-30 %, last \
         load 0 to +50 %, force constant +-10 %, friction from none to that of the last column, all at \
         once. What does not settle counts as longest.\n\n{table}"
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
fn tunings(rows: &[Row], units: &Units, evaluations: usize, way: &str) -> String {
    let mut text = format!(
        "Tuned for {way} with {evaluations} evaluations each; criterion: mean settling time to 1, 1.4, 2 and 2.8 % on \
         the worst plant.\n"
    );
    for row in rows {
        if !matches!(row.tuning, Tuning::Design) {
            text += &format!("{}: {}\n", row.law, tuning(&row.tuning, units));
        }
        if let Some(criterion) = row.criterion {
            text.pop();
            text += &format!("; criterion {:.1} ms\n", 1e3 * criterion);
        }
        for outcome in &row.outcomes {
            if let Some(failure) = &outcome.failure {
                text += &format!("{}, {}: {failure}\n", row.law, outcome.case);
            }
        }
    }
    text
}

/// What a law was tuned to.
pub(super) fn tuning(tuning: &Tuning, units: &Units) -> String {
    match tuning {
        Tuning::Design => "as designed".into(),
        Tuning::Pd(pd) => {
            let mut text = format!(
                "{:.2} {}, {:.3} {}",
                pd.position_gain, units.position_gain, pd.velocity_gain, units.velocity_gain
            );
            if let Some(notch) = &pd.notch {
                text += &format!(
                    ", notch at {:.2} Hz with damping ratios {:.3} over {:.3}",
                    notch.centre / std::f64::consts::TAU,
                    notch.depth,
                    notch.width
                );
            } else if let Some(disturbance) = &pd.disturbance {
                text += &format!(
                    ", observer of {:.1} rad/s for {} {}",
                    disturbance.cutoff,
                    significant(disturbance.mass, 3),
                    units.mass
                );
            } else if let Some(reference) = &pd.reference {
                text += &format!(
                    ", ramps of {:.1} ms, shaper for {:.2} Hz and damping ratio {:.2}",
                    1e3 * reference.ramp,
                    reference.frequency / std::f64::consts::TAU,
                    reference.damping
                );
            }
            text
        }
        Tuning::Gain(gain) => {
            let list = |values: &[f64]| {
                let values = values.iter().map(|value| significant(*value, 4));
                values.collect::<Vec<_>>().join(", ")
            };
            format!(
                "gain [{}] {}, [{}] {}, load_force_ratio {}, disturbance_rate {} 1/s",
                list(&gain.position),
                units.position_gain,
                list(&gain.velocity),
                units.velocity_gain,
                significant(gain.load_force_ratio, 4),
                significant(gain.disturbance_rate, 4)
            )
        }
        Tuning::Weights(weights) => {
            let list = |values: &[f64]| {
                let values = values.iter().map(|value| significant(*value, 3));
                values.collect::<Vec<_>>().join(", ")
            };
            format!(
                "position [{}] {}, velocity [{}] {}, load_force_ratio {}, disturbance_rate {} 1/s",
                list(&weights.position),
                units.position_weight,
                list(&weights.velocity),
                units.velocity_weight,
                significant(weights.load_force_ratio, 3),
                significant(weights.disturbance_rate, 3)
            )
        }
        Tuning::Encoder(filter) => {
            let force = units.force;
            format!(
                "{:.2e} {force}/sqrt(Hz) on each load, disturbance {:.2e} {force}/sqrt(s)",
                filter.load_force, filter.disturbance
            )
        }
    }
}
