//! How moves go on the plants of each set, as tables, and as JSON.

use super::comparison::tuning;
use super::table::{right, table};
use crate::chain::controlled_mass;
use crate::compare::Spread;
use crate::compare::moves::{Campaign, OnPlants, OnSet};
use crate::design::Design;
use crate::output::significant;
use comfy_table::Cell;
use serde_json::json;

/// Everything for JSON, SI units.
#[must_use]
pub fn json(design: &Design, campaign: &Campaign) -> serde_json::Value {
    let mut json = json!(campaign);
    json["kind"] = json!(design.drive.kind);
    json["current_limit"] = json!(design.drive.actuator.current_limit);
    json
}

/// What was done, a table for each set, and what the rivals were tuned to.
#[must_use]
pub fn text(design: &Design, campaign: &Campaign) -> String {
    let units = design.drive.kind.units();
    let mass = controlled_mass(design.loads());
    let milliseconds = |time: f64| 1e3 * time;
    let mut text = format!(
        "Move of {} {} in {:.0} ms by plan, at most {} A; friction of {} {} fed forward{}. Seed {}; runs of {:.2} s.\n",
        significant(1e3 * campaign.distance, 3),
        units.milli_position,
        milliseconds(campaign.planned),
        design.drive.actuator.current_limit,
        significant(campaign.friction, 3),
        units.force,
        if campaign.friction_assumed {
            " (the drive file states none: 0.2/12 of the motor's largest force is taken for plants and drive)"
        } else {
            ""
        },
        campaign.seed,
        campaign.duration,
    );
    for set in &campaign.sets {
        text += &format!("\n{}\n{}\n", title(set), on_set(set));
    }
    text += &format!(
        "\nEach: median / 95 % / worst of the plants. Settling: mass {mass} within 2 % for good, and all at rest at \
         the end; x bound: over the least time on that plant. In the band: the same whatever moves at the end. \
         In tolerance: actuator and mass {mass} within {} {} for good. Residual: mass {mass}, from 0.5 s on. Off: \
         actuator or mass {mass}, the larger. Not still: the actuator moves by more than one count each way after \
         {:.2} s; hunting: by more than what counts as rest, and goes on.\n\n",
        significant(1e6 * campaign.settling_tolerance, 3),
        units.micro_position,
        campaign.still_after,
    );
    text += &format!(
        "Rivals tuned with {} evaluations each on plants of the rough set drawn with seed {}.\n",
        campaign.evaluations,
        campaign.seed.wrapping_add(1),
    );
    for (law, tuned, criterion) in &campaign.tunings {
        text += &format!(
            "{law}: {}; criterion {:.1} ms\n",
            tuning(tuned, units),
            1e3 * criterion
        );
    }
    for set in &campaign.sets {
        for law in &set.laws {
            if let Some(failure) = &law.failure {
                text += &format!("{}, {}: {failure}\n", law.law, set.set.name());
            }
        }
    }
    text
}

fn title(set: &OnSet) -> String {
    let [stiffness, last, force_constant, friction] =
        set.set.differences().map(|most| 100.0 * most);
    if friction == 0.0 {
        return format!("{}: the drive itself", set.set.name());
    }
    format!(
        "{}: {} plants, stiffness +-{stiffness:.0} %, last load +-{last:.0} %, force constant \
         +-{force_constant:.0} %, friction +-{friction:.0} %",
        set.set.name(),
        set.plants
    )
}

fn on_set(set: &OnSet) -> String {
    let mut table = table(&[
        "law",
        "settling [ms]",
        "x bound",
        "in the band [ms]",
        "x bound",
        "in tolerance [ms]",
        "residual [um p-p]",
        "off [um]",
        "peak [A]",
        "not settled",
        "not in tolerance",
        "not still",
        "hunting",
        "failed",
    ]);
    let least = spread(&set.bound, 1e3, 0, set.plants);
    let mut row = vec![Cell::new("bound"), right(least)];
    row.resize_with(14, || right("-".into()));
    table.add_row(row);
    for law in &set.laws {
        table.add_row(cells(law, set.plants));
    }
    table.to_string()
}

fn cells(law: &OnPlants, plants: usize) -> Vec<Cell> {
    let figures = [
        (&law.settled, 1e3, 0),
        (&law.times_bound, 1.0, 2),
        (&law.within_band, 1e3, 0),
        (&law.within_band_times_bound, 1.0, 2),
        (&law.within_tolerance, 1e3, 0),
        (&law.residual, 1e6, 0),
        (&law.offset, 1e6, 0),
        (&law.peak_current, 1.0, 2),
    ];
    let numbers = [
        law.not_settled,
        law.not_within_tolerance,
        law.not_still,
        law.hunting,
        law.failed,
    ];
    let figures = figures
        .iter()
        .map(|(figure, factor, decimals)| right(spread(figure, *factor, *decimals, plants)));
    let numbers = numbers.iter().map(|number| right(number.to_string()));
    std::iter::once(Cell::new(law.law))
        .chain(figures)
        .chain(numbers)
        .collect()
}

fn spread(of: &Spread, factor: f64, decimals: usize, plants: usize) -> String {
    let shown = |figure: Option<f64>| {
        figure.map_or("-".into(), |value| format!("{:.decimals$}", factor * value))
    };
    if plants == 1 {
        return shown(of.worst);
    }
    [of.median, of.most, of.worst].map(shown).join(" / ")
}
