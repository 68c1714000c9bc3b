//! Tables for people.

use crate::design::Design;
use crate::design::checks::Verdict;
use crate::design::judgement::Judgement;
use crate::error::Result;
use crate::metrics::{Metrics, controlled_mass};
use crate::simulate::{Law, Run};
use arso_core::observer::Form;
use comfy_table::{Cell, CellAlignment, ContentArrangement, Table, presets};
use std::fmt::Write;

/// The name of an observer as drive files have it.
#[must_use]
pub fn observer_name(form: Form) -> &'static str {
    match form {
        Form::Anchored => "anchored",
        Form::Reaction => "reaction",
    }
}

/// Name of a control law in tables.
#[must_use]
pub fn law_name(law: Law, design: &Design) -> &'static str {
    match law {
        Law::Core => observer_name(design.form()),
        Law::FullState => "full state",
        Law::Rival(name) => name,
    }
}

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::ASCII_MARKDOWN)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header.iter().map(Cell::new));
    table
}

fn right(text: String) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

/// The experiments' figures, one row per run.
#[must_use]
pub fn experiments(design: &Design, runs: &[(Run, Metrics)]) -> String {
    let mass = controlled_mass(design.loads());
    let micro = design.drive.kind.units().micro_position;
    let settling = format!("settling mass {mass} [ms]");
    let residual = format!("residual [{micro} p-p]");
    let error = format!("estimate error [{micro} rms]");
    let mut table = table(&[
        "experiment",
        "control",
        &settling,
        "overshoot [%]",
        &residual,
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
    for (run, metrics) in runs {
        let settling = match (metrics.fault, metrics.settling_time) {
            (Some(fault), _) => format!("fault {fault}"),
            (None, Some(time)) => format!("{:.0}", time * 1e3),
            (None, None) => "not settled".into(),
        };
        table.add_row([
            Cell::new(run.scenario.name),
            Cell::new(law_name(run.law, design)),
            right(settling),
            right(format!("{:.1}", metrics.overshoot)),
            right(micrometres(&metrics.residual_vibration)),
            right(format!("{:.2}", metrics.peak_current)),
            right(micrometres(&metrics.estimation_error)),
        ]);
    }
    let titles = runs
        .iter()
        .filter(|(run, _)| run.law == Law::Core)
        .map(|(run, _)| format!("{}: {}\n", run.scenario.name, run.scenario.title(run.kind)));
    format!(
        "{}\n{table}\n\
         Settling: within 2 % of the motion for good. Residual vibration: from 0.5 s on. Lists: \
         actuator first.\n",
        titles.collect::<String>()
    )
}

/// Model and gains.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when poles cannot be computed.
pub fn design(design: &Design) -> Result<String> {
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
        observer_name(design.form()),
        slowest(design.observer_poles()?),
    );
    Ok(text)
}

/// Checks, margins and the gain over the time to go.
#[must_use]
pub fn judgement(judged: &Judgement) -> String {
    let mut text = String::new();
    let mut checks = table(&["check", "verdict", "value", "limit"]);
    for check in &judged.checks {
        let verdict = match check.verdict {
            Verdict::Pass => "pass",
            Verdict::Warn => "WARN",
            Verdict::Refuse => "REFUSE",
        };
        checks.add_row([
            Cell::new(check.name),
            Cell::new(verdict),
            right(format!("{:.4e}", check.value)),
            right(format!("{:.4e}", check.limit)),
        ]);
    }
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{checks}");
    for check in &judged.checks {
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
        ("drive", judged.margins.as_ref()),
        ("full state", Some(&judged.margins_full_state)),
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
    for gain in &judged.finite_horizon {
        horizon.add_row([
            right(format!("{:.1}", 1e3 * gain.time_to_go)),
            right(format!("{:.2e}", gain.distance)),
        ]);
    }
    let _ = writeln!(text, "{horizon}");
    text
}
