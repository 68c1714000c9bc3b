//! What a sweep came to, as a table.

use super::table::{right, table};
use crate::sweep::{OfLaw, Summary};
use comfy_table::Cell;

/// A table of the laws, and why runs failed.
#[must_use]
pub fn text(summary: &Summary) -> String {
    let [number, of] = summary.shard;
    let part = if of == 1 {
        String::new()
    } else {
        format!(", part {number} of {of}")
    };
    let mut table = table(&[
        "law",
        "settling, median [ms]",
        "95 %",
        "worst",
        "not settled",
        "stopped by a fault",
        "failed",
    ]);
    for law in &summary.laws {
        table.add_row(cells(law));
    }
    let mut text = format!(
        "{} samples, seed {}{part}\n{table}\n",
        summary.samples, summary.seed
    );
    for law in &summary.laws {
        if let Some(failure) = &law.failure {
            text += &format!("{}, the first that failed: {failure}\n", law.law);
        }
    }
    text
}

fn cells(law: &OfLaw) -> Vec<Cell> {
    let times = &law.settling_time;
    let times = [times.median, times.most, times.worst].map(|time| {
        let shown = time.map(|time| format!("{:.0}", 1e3 * time));
        right(shown.unwrap_or("-".into()))
    });
    let counts = [law.not_settled, law.faults, law.failed];
    std::iter::once(Cell::new(&law.law))
        .chain(times)
        .chain(counts.map(|count| right(count.to_string())))
        .collect()
}
