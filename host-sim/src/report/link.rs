//! What a drive says over the link: its status, its faults; as tables, and as JSON.

use super::record::json as one_move;
use super::table::{right, table};
use crate::capture::{LastMoves, short};
use crate::error::{Error, Result};
use crate::link::{Connection, mode_name};
use crate::output::significant;
use arso_core::Fault;
use arso_core::link::message::{PastFault, Status};
use comfy_table::Cell;
use serde::Serialize;
use serde_json::{Value, json};

/// A status for JSON, SI units: its fields, what follows from them, and which drive it is.
///
/// # Errors
/// [`Error::Report`] when it cannot be formed.
pub fn status_json(drive: &Connection, status: &Status) -> Result<Value> {
    let mut value = plain(status)?;
    value["state"] = json!(status.state().name());
    value["statusword"] = json!(status.statusword());
    value["mode_of_operation"] = json!(status.mode_of_operation());
    value["held_position"] = json!(status.held.map(|place| drive.position(place)));
    value["fault"] = status.mode.fault().map_or(Value::Null, described);
    value["drive"] = plain(drive.introduction())?;
    Ok(value)
}

/// A fault of the list.
fn described(fault: Fault) -> Value {
    json!({
        "number": fault.number(),
        "name": fault.name(),
        "sentence": fault.sentence(),
        "remedy": fault.remedy(),
        "setting": fault.setting(),
    })
}

/// Its fields, with the numbers that were meant: 0.03 and not 0.029999999.
fn plain(of: &impl Serialize) -> Result<Value> {
    let text = serde_json::to_string(of);
    let value = text.and_then(|text| serde_json::from_str(&text));
    value.map_err(|error| Error::Report(format!("the status as JSON: {error}")))
}

/// A status as a table, and which drive it is.
#[must_use]
pub fn status(drive: &Connection, status: &Status) -> String {
    let (introduction, origin) = (drive.introduction(), drive.origin());
    let units = origin.kind.units();
    let figures = |value: f32| significant(value.into(), 4);
    let yes = |yes: bool| String::from(if yes { "yes" } else { "no" });
    let fault = status.mode.fault();
    let named = fault.map_or(String::new(), |fault| format!(" ({})", fault.name()));
    let mode = format!("{}{named}", mode_name(status.mode));
    let held = match status.held {
        None => "no".into(),
        Some(place) => format!("at {}", drive.shown(drive.position(place))),
    };
    let rows = [
        ("state", status.state().name().into()),
        ("mode", mode),
        ("statusword", format!("{:#06x}", status.statusword())),
        ("mode of operation", status.mode_of_operation().to_string()),
        ("position", drive.shown(status.position.into())),
        ("reference", drive.shown(status.reference.into())),
        (
            "velocity",
            format!("{} {}", figures(status.velocity), units.velocity),
        ),
        (
            "current",
            format!(
                "{} A{}",
                figures(status.command),
                if status.limited { ", at its limit" } else { "" }
            ),
        ),
        ("held", held),
        (
            "vibration of the load",
            format!(
                "{} {} rms",
                figures(1e6 * status.vibration),
                units.micro_position
            ),
        ),
        (
            "run switch",
            if status.run_switch { "closed" } else { "open" }.into(),
        ),
        ("zero is known", yes(status.position_set)),
        ("commanded over the link", yes(status.remote)),
        ("jogs", yes(status.jogging)),
        ("homes", yes(status.homing)),
        ("control period", status.period.to_string()),
        ("most cycles of a period", status.worst_cycles.to_string()),
        ("records lost in the drive", status.lost.to_string()),
        ("damaged frames", status.damaged.to_string()),
    ];
    let mut found = table(&["of the drive", "value"]);
    for (name, value) in rows {
        found.add_row([Cell::new(name), Cell::new(value)]);
    }
    let mut text = format!(
        "drive: {origin}, firmware {}, {} {} per count\n{found}\n",
        introduction.firmware,
        significant(drive.resolution(), 4),
        units.position
    );
    if let Some(fault) = fault {
        let words = crate::link::fault_words(fault, status.fault_value);
        text += &format!("{words}\n");
    }
    text
}

/// Faults for JSON, the oldest first.
#[must_use]
pub fn faults_json(faults: &[PastFault]) -> Value {
    let each = faults.iter().map(|past| {
        let mut value = described(past.fault);
        value["fault"] = json!(past.fault);
        value["period"] = json!(past.period);
        value["value"] = json!(short(past.value));
        value
    });
    each.collect()
}

/// Faults as a table, the oldest first.
///
/// * `now`: control period of the drive
#[must_use]
pub fn faults(drive: &Connection, faults: &[PastFault], now: u32) -> String {
    if faults.is_empty() {
        return "no fault since the reset of the drive\n".into();
    }
    let mut found = table(&["before [s]", "fault", "name", "value", "what", "remedy"]);
    for PastFault {
        period,
        fault,
        value,
    } in faults
    {
        let before = f64::from(now.wrapping_sub(*period)) * drive.origin().period;
        found.add_row([
            right(format!("{before:.3}")),
            right(fault.number().to_string()),
            Cell::new(fault.name()),
            right(significant(f64::from(*value), 4)),
            Cell::new(fault.sentence()),
            Cell::new(fault.remedy()),
        ]);
    }
    format!("{found}\n")
}

/// The last moves for JSON, the oldest first, SI units.
#[must_use]
pub fn moves_json(record: &LastMoves) -> Value {
    record
        .moves
        .iter()
        .map(|one| one_move(one, &record.origin))
        .collect()
}
