//! What was learned from records of ordinary moves, and what it buys, in plain words and as JSON.

use super::bound::{failures, over};
use super::identification;
use super::settled::settled;
use crate::capture::Stretch;
use crate::chain::Mode;
use crate::design::checks::{Check, Verdict};
use crate::drive::Drive;
use crate::identify::{Drift, Identification, Identified, Quantity};
use crate::machine::{Units, chain_of};
use crate::output::significant;
use crate::simulate::benefit::Benefit;
use crate::simulate::bound::times;
use crate::simulate::metrics::Metrics;
use serde_json::{Value, json};

/// Changes up to this are none, relative.
const NONE: f64 = 0.01;

/// A drive file before and after.
pub struct Learned<'a> {
    /// As it was.
    pub old: &'a Drive,
    /// With what was learned.
    pub new: &'a Drive,
    /// What that is.
    pub identification: &'a Identification,
}

/// What has changed, part by part, of what is known.
#[must_use]
pub fn changes(learned: &Learned<'_>) -> String {
    let units = learned.old.kind.units();
    let mut text = String::new();
    let mut unknown = Vec::new();
    let mut lines: Vec<(String, Vec<String>)> = Vec::new();
    for identified in &learned.identification.quantities {
        if identified.held {
            continue;
        }
        let (part, what) = named(identified.quantity);
        if !identified.known {
            unknown.push(format!("{part}, {what}"));
            continue;
        }
        let said = format!("{what} {}", change(identified, units));
        match lines.iter_mut().find(|line| line.0 == part) {
            Some(line) => line.1.push(said),
            None => lines.push((part, vec![said])),
        }
    }
    for (part, changes) in lines {
        text += &format!("{part}: {}\n", changes.join(", "));
    }
    let modes = modes(learned.old).into_iter().zip(modes(learned.new));
    let modes = modes.map(|(old, new)| {
        format!(
            "{} -> {} Hz ({})",
            significant(old.frequency_hz, 4),
            significant(new.frequency_hz, 4),
            percent(new.frequency_hz / old.frequency_hz - 1.0),
        )
    });
    text += &format!("modes: {}\n", modes.collect::<Vec<_>>().join(", "));
    if !unknown.is_empty() {
        text += &format!("not known from this record: {}\n", unknown.join("; "));
    }
    for remark in &learned.identification.remarks {
        text += &format!("note: {remark}\n");
    }
    text
}

/// Which part of the machine, and what of it.
fn named(quantity: Quantity) -> (String, &'static str) {
    let actuator = |what| ("actuator".to_owned(), what);
    let load = |load: usize, what| (format!("load {}", load + 1), what);
    match quantity {
        Quantity::ActuatorMass => actuator("mass"),
        Quantity::ForceConstant => actuator("force constant"),
        Quantity::Delay => actuator("delay"),
        Quantity::Lag => actuator("lag"),
        Quantity::HoldingForce => actuator("holding force"),
        Quantity::Mass(number) => load(number, "mass"),
        Quantity::Stiffness(number) => load(number, "stiffness"),
        Quantity::Damping(number) => load(number, "damping"),
        Quantity::LoadViscous(number) => load(number, "viscous friction"),
        Quantity::LoadCoulomb(number) => load(number, "Coulomb friction"),
        Quantity::Viscous => ("friction".to_owned(), "viscous"),
        Quantity::Coulomb => ("friction".to_owned(), "Coulomb"),
        Quantity::CoulombBackward => ("friction".to_owned(), "Coulomb backwards"),
        Quantity::Static => ("friction".to_owned(), "static"),
        Quantity::Backlash(number) => load(number, "gap"),
        Quantity::Ripple(_) => actuator("ripple"),
    }
}

/// A change in percent, or from nothing to something.
fn change(identified: &Identified, units: &Units) -> String {
    let (value, before) = (identified.value, identified.before);
    let difference = (value - before).abs();
    if before == 0.0 {
        if difference <= 3.0 * identified.std {
            return "none".into();
        }
        let unit = identified.quantity.unit(units);
        return format!("{} {unit} (was none)", significant(value, 3));
    }
    if difference <= NONE * before.abs() || difference <= 3.0 * identified.std {
        return "as it was".into();
    }
    percent(value / before - 1.0)
}

fn percent(share: f64) -> String {
    format!("{:+.1} %", 100.0 * share)
}

fn modes(drive: &Drive) -> Vec<Mode> {
    chain_of(&drive.actuator, &drive.loads, drive.friction.viscous).modes()
}

/// What the new gains buy, in two sentences.
#[must_use]
pub fn benefit(drive: &Drive, benefit: &Benefit) -> String {
    let units = drive.kind.units();
    let before = match &benefit.before {
        Ok(metrics) => taken(metrics, units),
        Err(why) => format!("not at all ({why})"),
    };
    let mut text = format!(
        "A planned move of {} {} on this machine: before {before}, after {}",
        significant(1e3 * benefit.distance, 3),
        units.milli_position,
        taken(&benefit.after, units)
    );
    match &benefit.bound {
        Ok(bound) => {
            text += &format!(", bound {:.0} ms", 1e3 * bound.settled);
            let times = times(benefit.after.settling_time, &benefit.bound);
            if times.is_some() {
                text += &format!(" ({} times)", over(times));
            }
            text += ".\n";
        }
        Err(_) => text += &format!(".\n{}", failures([("it", &benefit.bound)])),
    }
    text
}

/// How long a move took, or what became of it.
fn taken(metrics: &Metrics, units: &Units) -> String {
    match (metrics.fault, metrics.settling_time) {
        (None, Some(time)) => format!("{:.0} ms", 1e3 * time),
        (Some(fault), _) => format!("never (the drive stops with fault {fault})"),
        _ => format!("never ({})", settled(metrics, units)),
    }
}

/// Checks that warn, a line each.
#[must_use]
pub fn warnings(checks: &[Check]) -> String {
    let warned = checks.iter().filter(|check| check.verdict == Verdict::Warn);
    let each = warned.map(|check| format!("the check {} warns: {}\n", check.name, check.advice));
    each.collect()
}

/// All of it for programs, times in s.
///
/// * `benefit`: none where the design is refused, with the reason
#[must_use]
pub fn json(
    learned: &Learned<'_>,
    benefit: std::result::Result<&Benefit, &str>,
    checks: &[Check],
    files: &Value,
) -> Value {
    let mut value = identification::json(learned.old, learned.identification);
    let frequencies =
        |drive: &Drive| -> Vec<f64> { modes(drive).iter().map(|mode| mode.frequency_hz).collect() };
    value["modes_hz"] =
        json!({"before": frequencies(learned.old), "after": frequencies(learned.new)});
    value["checks"] = json!(checks);
    value["files"] = files.clone();
    match benefit {
        Err(why) => value["refused"] = json!(why),
        Ok(benefit) => {
            let bound = benefit.bound.as_ref();
            let failed = benefit.before.as_ref().err().map(ToString::to_string);
            value["move"] = json!({
                "distance": benefit.distance,
                "before": benefit.before.as_ref().ok().and_then(|metrics| metrics.settling_time),
                "before_metrics": benefit.before.as_ref().ok(),
                "before_failure": failed,
                "after": benefit.after.settling_time,
                "after_metrics": benefit.after,
                "bound": bound.ok().map(|bound| bound.settled),
                "times_bound": times(benefit.after.settling_time, &benefit.bound),
            });
        }
    }
    value
}

/// In whole percent.
fn whole(share: f64) -> i64 {
    (100.0 * share).round() as i64
}

/// What a move says of the load, in one sentence.
#[must_use]
pub fn drift(drift: &Drift) -> String {
    let times = match drift.times_least {
        times if times < 10.0 => significant(times, 2),
        times => format!("{times:.0}"),
    };
    let error = format!("prediction error {times} times the least");
    let change = format!(
        "stiffness about {:+} %, last mass {:+} %",
        whole(drift.stiffness),
        whole(drift.last_mass)
    );
    if !drift.changed() {
        return if drift.size > NONE && drift.explained {
            format!("the load is nearly as the drive file says: {change} ({error})")
        } else {
            format!("the load is as the drive file says ({error})")
        };
    }
    if drift.explained {
        return format!("the load has changed: {change} ({error}): run learn");
    }
    format!("the load has changed, not in stiffness and last mass alone ({error}): run learn")
}

/// The same for programs.
///
/// * `stretch`: what it is of
#[must_use]
pub fn drift_json(stretch: &Stretch, drift: std::result::Result<&Drift, &str>) -> Value {
    let mut value = json!({"from": stretch.from, "to": stretch.to});
    match drift {
        Err(why) => value["failure"] = json!(why),
        Ok(drift) => {
            value["changed"] = json!(drift.changed());
            value["error_rms_counts"] = json!(drift.error_rms);
            value["times_least"] = json!(drift.times_least);
            value["size"] = json!(drift.size);
            value["stiffness"] = json!(drift.stiffness);
            value["last_mass"] = json!(drift.last_mass);
        }
    }
    value
}
