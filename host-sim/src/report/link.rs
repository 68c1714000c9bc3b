//! What a drive says over the link: its status, its faults; as tables, and as JSON.

use super::record::json as one_move;
use super::table::{right, table};
use crate::capture::{LastMoves, short};
use crate::error::{Error, Result};
use crate::link::{Connection, mode_name};
use crate::output::significant;
use crate::simulate::corridor::settings_said;
use arso_core::Fault;
use arso_core::link::image::Header;
use arso_core::link::message::{PastFault, Source, Status};
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
        ("settings", source_words(status.source)),
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

/// Where settings are from, in words.
fn source_words(source: Source) -> String {
    match source {
        Source::CompiledIn => "compiled in".into(),
        Source::Kept(serial) => format!("kept in flash, set {serial}"),
        Source::Fallback => "compiled in, for those in flash cannot be run".into(),
        Source::Changed => "changed since the reset, kept nowhere".into(),
    }
}

/// The settings of a drive for JSON, SI units, but for the rows of its planned moves.
///
/// * `set`: as the drive says it, header first
///
/// # Errors
/// [`Error::Link`] for what is no set.
pub fn settings_json(header: &Header, set: &[u8], source: Source) -> Result<Value> {
    let mut value = settings_said(header, set)?;
    value["source"] = plain(&source)?;
    value["kind"] = json!(header.kind());
    value["loads"] = json!(header.loads);
    value["fingerprint"] = json!(format!("{:08x}", header.fingerprint));
    Ok(value)
}

/// The same as TOML for people, of the planned moves what they are.
///
/// # Errors
/// [`Error::Report`] when it cannot be formed.
pub fn settings(drive: &Connection, value: Value, source: Source) -> Result<String> {
    let Value::Object(mut value) = value else {
        return Err(Error::Report("the settings are no table".into()));
    };
    let plans = value.remove("plans").unwrap_or_default();
    let displacements = plans["displacements"].as_array();
    let (number, reach) = displacements.map_or((0, None), |plans| {
        (
            plans.len(),
            plans.last().and_then(|plan| plan["reach"].as_f64()),
        )
    });
    let settings = as_toml(value.remove("settings").unwrap_or_default());
    let text = toml::to_string(&settings)
        .map_err(|error| Error::Report(format!("the settings as TOML: {error}")))?;
    let reach = reach.unwrap_or_default();
    Ok(format!(
        "# drive: {}\n# settings: {}\n# planned moves: {number}, the longest without a cruise {}\n\n{text}",
        drive.origin(),
        source_words(source),
        drive.shown(reach)
    ))
}

/// A value as TOML has it; what there is none of is left out.
fn as_toml(value: Value) -> Option<toml::Value> {
    Some(match value {
        Value::Null => return None,
        Value::Bool(value) => value.into(),
        Value::Number(number) => match number.as_i64() {
            Some(whole) => whole.into(),
            None => number.as_f64()?.into(),
        },
        Value::String(text) => text.into(),
        Value::Array(values) => values
            .into_iter()
            .filter_map(as_toml)
            .collect::<Vec<_>>()
            .into(),
        Value::Object(table) => table
            .into_iter()
            .filter_map(|(key, value)| Some((key, as_toml(value)?)))
            .collect::<toml::Table>()
            .into(),
    })
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
