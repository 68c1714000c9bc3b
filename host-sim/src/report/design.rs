//! A design and its assessment, as tables and JSON.

use super::table::{right, table};
use crate::design::Design;
use crate::design::assessment::Assessment;
use crate::design::checks::{Check, Verdict};
use crate::drive::PlantFile;
use crate::error::Result;
use crate::output::significant;
use crate::simulate::bound::bound;
use crate::simulate::corridor::fingerprint;
use crate::simulate::scenario::SCENARIOS;
use comfy_table::Cell;
use nalgebra::{Complex, DMatrix};
use serde::Serialize;
use serde_json::json;
use std::fmt::Write;

/// The limits of a running drive.
#[must_use]
pub fn protection(design: &Design) -> String {
    let limits = design.protection();
    let units = design.drive.kind.units();
    let (position, force) = (units.position, units.force);
    let mut table = table(&["protection, limit of", "value", "unit"]);
    for (name, value, unit) in [
        ("encoder_step", limits.encoder_step, position),
        ("velocity", limits.velocity, units.velocity),
        ("following_error", limits.following_error, position),
        ("reaction_force", limits.reaction_force, force),
        ("disturbance", limits.disturbance, force),
        ("innovation", limits.innovation, force),
        ("tracking_error", limits.tracking_error, position),
        ("stiction", limits.stiction, force),
        ("saturation_time", limits.saturation_time, "s"),
        ("continuous_current", limits.continuous_current, "A"),
        ("thermal_time", limits.thermal_time, "s"),
    ] {
        table.add_row([
            Cell::new(name),
            right(significant(value, 4)),
            Cell::new(unit),
        ]);
    }
    let springs = limits.deflection.iter().map(|limit| significant(*limit, 3));
    table.add_row([
        Cell::new("deflection of each spring"),
        right(springs.collect::<Vec<_>>().join("  ")),
        Cell::new(position),
    ]);
    if let Some(ends) = limits.travel {
        table.add_row([
            Cell::new("travel, once zero is known"),
            right(ends.map(|end| significant(end, 4)).join(" to ")),
            Cell::new(position),
        ]);
    }
    format!("{table}\n")
}

/// Model and gains.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when poles cannot be computed.
pub fn tables(design: &Design) -> Result<String> {
    let mut text = String::new();
    let mut modes = table(&[
        "mode",
        "frequency [Hz]",
        "damping ratio [%]",
        "shape x_a x_1 ...",
    ]);
    for (number, mode) in design.modes().iter().enumerate() {
        let shape = mode.shape.iter().map(|amplitude| format!("{amplitude:.2}"));
        modes.add_row([
            right((number + 1).to_string()),
            right(format!("{:.3}", mode.frequency_hz)),
            right(format!("{:.2}", 100.0 * mode.damping_ratio)),
            right(shape.collect::<Vec<_>>().join("  ")),
        ]);
    }
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{modes}");

    let units = design.drive.kind.units();
    let mut gains = table(&[
        "mass",
        &format!("position gain [{}]", units.position_gain),
        &format!("velocity gain [{}]", units.velocity_gain),
    ]);
    for mass in 0..=design.loads() {
        let name = if mass == 0 {
            "actuator".into()
        } else {
            format!("load {mass}")
        };
        gains.add_row([
            Cell::new(name),
            right(format!("{:.4}", design.regulator[2 * mass])),
            right(format!("{:.4}", design.regulator[2 * mass + 1])),
        ]);
    }
    let _ = writeln!(text, "{gains}");

    let slowest = |poles: Vec<nalgebra::Complex<f64>>| {
        let radius = poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
        if radius < 1.0 - 1e-9 {
            format!(
                "{:.1} ms",
                1e3 * design.drive.control.sample_time / -radius.ln()
            )
        } else {
            "none (errors of the rigid motion stay)".into()
        }
    };
    let _ = writeln!(
        text,
        "slowest time constant: regulator {}, {} observer {}",
        slowest(design.regulator_poles()?),
        design.drive.control.observer.name(),
        slowest(design.observer_poles()?),
    );
    // Of a refused design there may be none.
    if let Ok(fingerprint) = fingerprint(design) {
        let _ = writeln!(
            text,
            "fingerprint of the settings, as the log has it: {fingerprint:08x}"
        );
    }
    Ok(text)
}

/// The table of planned moves, and an example beside its bound.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when there are no plans.
pub fn moves(design: &Design) -> Result<String> {
    let moves = moves_of(design)?;
    let units = design.drive.kind.units();
    let milliseconds = |time: f64| format!("{:.1}", 1e3 * time);
    let mut table = table(&["planned moves", "value", "unit"]);
    let cruising = format!(
        "the same just beyond {} {}, where it cruises",
        significant(1e3 * moves.farthest_plan, 3),
        units.milli_position
    );
    let cruise_loss = moves
        .cruise_loss
        .map(|loss| (&*cruising, format!("{:.1}", 100.0 * loss), "%"));
    let rows = [
        (
            "plans, and a change of velocity",
            moves.plans.to_string(),
            "",
        ),
        ("table in flash", moves.bytes.to_string(), "bytes"),
        (
            "longer than the shortest move, beside one step",
            format!("{:.1}", 100.0 * moves.loss),
            "%",
        ),
    ];
    let rest = [
        ("step of the plans", milliseconds(moves.step), "ms"),
        (
            "velocity limit",
            significant(moves.velocity, 4),
            units.velocity,
        ),
        (
            &format!(
                "{} {}",
                significant(1e3 * moves.distance, 3),
                units.milli_position
            ),
            milliseconds(moves.duration),
            "ms",
        ),
        (
            "the least that any control needs for that",
            moves.bound.map_or("-".into(), milliseconds),
            "ms",
        ),
    ];
    for (name, value, unit) in rows.into_iter().chain(cruise_loss).chain(rest) {
        table.add_row([Cell::new(name), right(value), Cell::new(unit)]);
    }
    Ok(format!("{table}\n"))
}

/// What is said of the planned moves, SI units.
#[derive(Serialize)]
struct MovesSummary {
    /// Displacements.
    plans: usize,
    bytes: usize,
    /// See [`PlanTable::loss`](crate::design::plans::PlanTable::loss).
    loss: f64,
    /// How far the longest plan reaches, m.
    farthest_plan: f64,
    /// See [`PlanTable::cruise_loss`](crate::design::plans::PlanTable::cruise_loss).
    cruise_loss: Option<f64>,
    /// s.
    step: f64,
    /// m/s.
    velocity: f64,
    /// Of the example, m.
    distance: f64,
    /// From rest to rest, s.
    duration: f64,
    /// From rest to rest with all current and no other limit, s.
    bound: Option<f64>,
}

fn moves_of(design: &Design) -> Result<MovesSummary> {
    let drive = &design.drive;
    let period = drive.control.sample_time;
    let table = design.plans()?;
    let plans = table.plans();
    let example = &SCENARIOS[0];
    let bound = bound(drive, &PlantFile::from(drive), example);
    Ok(MovesSummary {
        plans: plans.displacements.len(),
        bytes: table.bytes(),
        loss: table.loss,
        farthest_plan: plans
            .displacements
            .last()
            .map_or(0.0, |plan| plan.reach.into()),
        cruise_loss: table.cruise_loss,
        step: f64::from(plans.stride) * period,
        velocity: design.motion.velocity,
        distance: example.target,
        duration: table.duration(example.target, period) * period,
        bound: bound.ok().map(|bound| bound.rest),
    })
}

/// Checks, margins and the gain over the time to go.
#[must_use]
pub fn assessment(assessment: &Assessment) -> String {
    let mut text = String::new();
    let mut checks = table(&["check", "verdict", "value", "limit"]);
    for check in &assessment.checks {
        let verdict = match check.verdict {
            Verdict::Pass => "pass",
            Verdict::Warn => "WARN",
            Verdict::Refuse => "REFUSE",
        };
        checks.add_row([
            Cell::new(check.name),
            Cell::new(verdict),
            right(
                check
                    .value
                    .map_or("-".into(), |value| format!("{value:.4e}")),
            ),
            right(format!("{:.4e}", check.limit)),
        ]);
    }
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{checks}");
    let open = |check: &&Check| check.verdict != Verdict::Pass;
    for check in assessment.checks.iter().filter(open) {
        let _ = writeln!(text, "{}: {}", check.name, check.advice);
    }

    let mut margins = table(&[
        "margins",
        "gain [dB]",
        "phase [deg]",
        "delay [ms]",
        "peak sensitivity",
    ]);
    for (name, m) in [
        ("drive", assessment.margins.as_ref()),
        ("drive, held at rest", assessment.margins_held.as_ref()),
        ("full state", Some(&assessment.margins_full_state)),
    ] {
        let Some(m) = m else {
            margins.add_row([name, "not stable"]);
            continue;
        };
        let shown = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.1}"));
        margins.add_row([
            Cell::new(name),
            right(match m.gain_reduction_db {
                Some(reduction) => format!("{reduction:.1} to +{}", shown(m.gain_margin_db)),
                None => shown(m.gain_margin_db),
            }),
            right(shown(m.phase_margin_deg)),
            right(shown(m.delay_margin.map(|delay| 1e3 * delay))),
            right(format!(
                "{:.2} at {:.1} Hz",
                m.peak_sensitivity, m.peak_sensitivity_hz
            )),
        ]);
    }
    let _ = writeln!(text, "{margins}");

    let mut horizon = table(&[
        "time to go [ms]",
        "distance of K(t), eq. (14), from the gain it tends to",
    ]);
    for gain in &assessment.finite_horizon {
        horizon.add_row([
            right(format!("{:.1}", 1e3 * gain.time_to_go)),
            right(format!("{:.2e}", gain.distance)),
        ]);
    }
    match &assessment.finite_horizon_failure {
        None => {
            let _ = writeln!(text, "{horizon}");
        }
        Some(why) => {
            let _ = writeln!(text, "K(t), eq. (14), cannot be computed: {why}");
        }
    }
    text
}

/// Everything about a design for JSON, SI units.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when poles or plans cannot be computed.
pub fn json(design: &Design, assessment: &Assessment) -> Result<serde_json::Value> {
    let rows = |matrix: &DMatrix<f64>| -> Vec<Vec<f64>> {
        matrix
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect()
    };
    let poles = |poles: Vec<Complex<f64>>| -> Vec<[f64; 2]> {
        poles.iter().map(|pole| [pole.re, pole.im]).collect()
    };
    // Of a refused design there may be none.
    let moves = match moves_of(design) {
        Err(error) if assessment.require_sound().is_ok() => return Err(error),
        moves => moves.ok(),
    };
    let observer = &design.observer;
    Ok(json!({
        "kind": design.drive.kind,
        "fingerprint": fingerprint(design).ok(),
        "a": rows(&design.chain.a()),
        "b": design.chain.b().as_slice(),
        "ad": rows(&design.ad),
        "bd": design.bd.as_slice(),
        "k": design.regulator.as_slice(),
        "regulator_poles": poles(design.regulator_poles()?),
        "observer": design.drive.control.observer.name(),
        "observer_transition": rows(&observer.transition),
        "observer_input": observer.input.as_slice(),
        "observer_output": observer.output.as_slice(),
        "observer_gain": observer.correction.as_slice(),
        "observer_poles": poles(design.observer_poles()?),
        "protection": design.protection(),
        "moves": moves,
        "modes": design.modes(),
        "distinct_eigenvalues": assessment.distinct_eigenvalues,
        "checks": assessment.checks,
        "margins": assessment.margins,
        "margins_held": assessment.margins_held,
        "margins_full_state": assessment.margins_full_state,
        "finite_horizon": assessment.finite_horizon,
        "finite_horizon_failure": assessment.finite_horizon_failure,
    }))
}
