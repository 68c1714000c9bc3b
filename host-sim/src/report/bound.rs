//! The least time that any control can take, by itself and as what a settling time is held against.

use super::table::{right, table};
use crate::chain::controlled_mass;
use crate::chain::minimum_time::MinimumTime;
use crate::drive::{Drive, PlantFile};
use crate::output::significant;
use crate::simulate::bound::{Bound, current_limit, times};
use comfy_table::Cell;
use serde_json::json;

/// A settling time over its bound, for a table.
pub(super) fn ratio(settling_time: Option<f64>, bound: &Bound) -> String {
    over(times(settling_time, bound))
}

/// A ratio, if there is one, for a table.
pub(super) fn over(ratio: Option<f64>) -> String {
    ratio.map_or("-".into(), |ratio| format!("{ratio:.2}"))
}

/// Why there is no bound, a line for each that is not there.
pub(super) fn failures<'a>(bounds: impl IntoIterator<Item = (&'a str, &'a Bound)>) -> String {
    let each = bounds.into_iter().filter_map(|(name, bound)| {
        let failure = bound.as_ref().err()?;
        Some(format!("no bound for {name}: {failure}\n"))
    });
    each.collect()
}

/// Both least times of a step from rest, as a table and what they mean.
///
/// * `distance`: m
#[must_use]
pub fn text(drive: &Drive, plant: &PlantFile, distance: f64, bound: &MinimumTime) -> String {
    let units = drive.kind.units();
    let mass = controlled_mass(drive.loads.len());
    let mut table = table(&["least time until", "[ms]"]);
    // As many decimals as a control period has.
    let decimals = (-(1e3 * drive.control.sample_time).log10() - 1e-9)
        .ceil()
        .clamp(0.0, 6.0);
    let milliseconds = |time: f64| right(format!("{:.*}", decimals as usize, 1e3 * time));
    table.add_row([
        Cell::new(format!("mass {mass} stays within 2 %")),
        milliseconds(bound.settled),
    ]);
    table.add_row([
        Cell::new("all masses are at rest"),
        milliseconds(bound.rest),
    ]);
    let limit = current_limit(drive, plant);
    let mut text = format!(
        "Step of {} {} with at most {limit} A, held over control periods of {} ms.\n\n{table}\n\n\
         No control does it sooner, whatever it knows: without friction and forces from outside, the current \
         free within its limit. From the first time on the other masses may swing, and all are at rest one and \
         a half periods of the slowest mode later, or half the second time later where that is more.\n",
        significant(1e3 * distance, 3),
        units.milli_position,
        1e3 * drive.control.sample_time,
    );
    if bound.hold > 1 {
        text += &format!(
            "The current was held over {} control periods at a time: upper estimates.\n",
            bound.hold
        );
    }
    text
}

/// The same for JSON, SI units.
#[must_use]
pub fn json(
    drive: &Drive,
    plant: &PlantFile,
    distance: f64,
    bound: &MinimumTime,
) -> serde_json::Value {
    json!({
        "kind": drive.kind,
        "distance": distance,
        "current_limit": current_limit(drive, plant),
        "settled": bound.settled,
        "rest": bound.rest,
        "hold": bound.hold,
    })
}
