//! What the gains printed in the paper do, as tables and JSON.

use crate::design::paper::{DAMPING, Point, STIFFNESS};
use comfy_table::{Table, presets};

/// The grid of plants for JSON.
#[must_use]
pub fn json(grid: &[Point]) -> serde_json::Value {
    serde_json::json!({ "grid": grid })
}

/// Which plants of the grid are stable, with either gain.
#[must_use]
pub fn tables(grid: &[Point]) -> String {
    let table = |value: fn(&Point) -> f64| {
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        let damping = DAMPING.iter().map(|c| format!("c = {c}"));
        table.set_header(std::iter::once("k [N/m]".to_owned()).chain(damping));
        for (stiffness, row) in STIFFNESS.iter().zip(grid.chunks(DAMPING.len())) {
            let cells = row.iter().map(|point| {
                let real = value(point);
                format!(
                    "{} {real:.2}",
                    if real < 0.0 { "stable" } else { "UNSTABLE" }
                )
            });
            table.add_row(std::iter::once(stiffness.to_string()).chain(cells));
        }
        table
    };
    format!(
        "Largest real part of the poles, 1/s; c in N s/m. The paper does not publish k and c.\n\n\
         A - B K, printed K, input current:\n{}\n\n\
         A - M C_f, printed M, without the rigid motion, which eq. (17) does not observe:\n{}\n",
        table(|point| point.regulator),
        table(|point| point.observer),
    )
}
