//! The rows of a record as numbers.

use super::Refusal;
use super::columns::{Columns, Found, Layout, layout};
use super::text::{Table, last_decimal, number};
use crate::drive::Drive;

/// One row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Row {
    /// Line in the file.
    pub(super) line: usize,
    /// s.
    pub(super) time: f64,
    /// Counts.
    pub(super) count: f64,
    /// A.
    pub(super) current: f64,
    /// What the drive was doing; empty where the record does not say.
    pub(super) mode: String,
}

/// What a record holds.
pub(super) struct Content {
    /// The rows.
    pub(super) rows: Vec<Row>,
    /// Which drive wrote it, where it says.
    pub(super) drive: Option<String>,
    /// Where all that was found.
    pub(super) layout: Layout,
    /// What the times are rounded to, s; 0 where that cannot be told.
    pub(super) rounding: f64,
}

/// Beyond that a number of counts is not exact.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// Reads them.
pub(super) fn rows(table: &Table, columns: &Columns, drive: &Drive) -> Result<Content, Refusal> {
    let layout = layout(&table.header, table.line, columns, drive.kind)?;
    let (mut rows, mut name, mut decimal) = (Vec::new(), None, Some(1.0_f64));
    for (line, record) in &table.rows {
        let field = |index: usize| record.get(index).unwrap_or("");
        let value = |column: &Found| {
            let text = field(column.index);
            number(text).ok_or_else(|| {
                let message = format!("{} = \"{text}\": must be a number", column.title);
                Refusal::of(*line, message)
            })
        };
        if name.is_none() {
            let said = layout.drive.map(field).filter(|name| !name.is_empty());
            name = said.map(str::to_owned);
        }
        let time = value(&layout.time)? * layout.time.scale;
        let mut count = value(&layout.place)? * layout.place.scale;
        if !layout.counts {
            count /= drive.encoder.resolution;
        }
        if count.abs() > EXACT {
            let message = format!(
                "{} = {}: must be {EXACT} counts at most",
                layout.place.title,
                field(layout.place.index)
            );
            return Err(Refusal::of(*line, message));
        }
        let last = last_decimal(field(layout.time.index));
        decimal = decimal.zip(last).map(|(least, last)| least.min(last));
        rows.push(Row {
            line: *line,
            time,
            count,
            current: value(&layout.current)? * layout.current.scale,
            mode: layout.mode.map(field).unwrap_or_default().to_owned(),
        });
    }
    Ok(Content {
        rows,
        drive: name,
        rounding: decimal.unwrap_or(0.0) * layout.time.scale,
        layout,
    })
}
