//! The last moves of a drive: which there are, and each as CSV.

use crate::capture::{LastMoves, Origin, RecordedMove};
use crate::error::{Error, Result};
use comfy_table::{Cell, CellAlignment, Table, presets};
use serde_json::json;

/// One row per control period, as `identify` reads it.
///
/// # Errors
/// [`Error::Report`] when the rows cannot be formed.
pub fn csv(recorded: &RecordedMove, origin: &Origin) -> Result<Vec<u8>> {
    let failed =
        |error: String| Error::Report(format!("the record's CSV cannot be formed: {error}"));
    let mark = origin.mark();
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    writer
        .write_record(["time[s]", "count[1]", "applied_current[A]", "drive[name]"])
        .map_err(|e| failed(e.to_string()))?;
    for sample in &recorded.samples {
        let time = super::time(f64::from(sample.tick) * origin.period);
        let row = [
            time.to_string(),
            sample.count.0.to_string(),
            sample.applied.0.to_string(),
            mark.clone(),
        ];
        writer
            .write_record(row)
            .map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}

/// What the table holds of a move for JSON, SI units.
#[must_use]
pub fn json(recorded: &RecordedMove, origin: &Origin) -> serde_json::Value {
    json!({
        "number": recorded.number,
        "period": recorded.period,
        "duration": super::time(recorded.samples.len() as f64 * origin.period),
        "peak_current": peak(recorded),
        "ended": recorded.ended,
        "cut": recorded.cut,
    })
}

/// Largest current, A.
fn peak(recorded: &RecordedMove) -> f32 {
    let currents = recorded.samples.iter().map(|sample| sample.applied.0.abs());
    currents.fold(0.0, f32::max)
}

/// The moves, the oldest first.
#[must_use]
pub fn table(record: &LastMoves) -> String {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["move", "begins in period", "lasts [ms]", "peak [A]", ""]);
    for one in &record.moves {
        let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
        let lasts = 1e3 * one.samples.len() as f64 * record.origin.period;
        let end = match (one.ended, one.cut) {
            (_, true) => "went on; this is its first part",
            (true, false) => "",
            (false, false) => "was going on",
        };
        table.add_row([
            right(one.number.to_string()),
            right(one.period.to_string()),
            right(format!("{lasts:.0}")),
            right(format!("{:.3}", peak(one))),
            Cell::new(end),
        ]);
    }
    format!("drive: {}\n{table}\n", record.origin)
}
