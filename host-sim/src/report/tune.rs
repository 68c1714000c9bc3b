//! What tuning for a set of plants came to, as a table, and as JSON.

use super::comparison::tuning;
use super::table::{right, table};
use crate::chain::controlled_mass;
use crate::compare::Spread;
use crate::compare::robust::{Found, Judged, Ranges, Task};
use crate::design::Design;
use crate::output::significant;
use crate::simulate::scenario::Approach;
use comfy_table::Cell;
use serde_json::json;

/// Everything for JSON, SI units.
#[must_use]
pub fn json(design: &Design, task: &Task, found: &Found) -> serde_json::Value {
    json!({
        "kind": design.drive.kind,
        "approach": match task.approach {
            Approach::Step => "step",
            Approach::Move => "move",
        },
        "distance": task.distance,
        "ranges": task.ranges,
        "tuned_on": task.tuned_on,
        "judged_on": task.judged_on,
        "evaluations": task.evaluations,
        "seed": task.seed,
        "laws": found.laws,
    })
}

/// What was done, a table of the laws, and what they were tuned to.
#[must_use]
pub fn text(design: &Design, task: &Task, found: &Found) -> String {
    let units = design.drive.kind.units();
    let mass = controlled_mass(design.loads());
    let way = match task.approach {
        Approach::Step => "Raw step",
        Approach::Move => "Planned move",
    };
    let mut text = format!(
        "{way} of {} {}; {}.\nTuned on {} plants with {} evaluations for each law, judged on {} others; seed {}.\n\n",
        significant(1e3 * task.distance, 3),
        units.milli_position,
        ranges(&task.ranges, units.force),
        task.tuned_on,
        task.evaluations,
        task.judged_on,
        task.seed
    );
    let mut table = table(&[
        "law",
        "plan [ms]",
        "to 2 % [ms]",
        "and at rest [ms]",
        "peak [A]",
        "not settled",
        "not at rest",
        "hunting",
        "failed",
    ]);
    for law in &found.laws {
        table.add_row(cells(law, task.judged_on));
    }
    text += &format!(
        "{table}\n\nEach: median / 95 % / worst of the plants. To 2 %: mass {mass} within 2 % for good; and at rest: the same \
         where nothing moves any more at the end.\n\n"
    );
    for law in &found.laws {
        let Some(criterion) = law.criterion else {
            continue;
        };
        text += &format!(
            "{}: {}{}; criterion {:.1} ms\n",
            law.law,
            tuning(&law.tuning, units),
            law.plan.map_or(String::new(), |(share, _)| format!(
                ", plans with {share} of the current limit"
            )),
            1e3 * criterion
        );
    }
    for law in &found.laws {
        if let Some(failure) = &law.failure {
            text += &format!("{}: {failure}\n", law.law);
        }
    }
    text
}

fn ranges(ranges: &Ranges, force: &str) -> String {
    let factors = [
        ("springs", ranges.stiffness),
        ("last load", ranges.last_load),
        ("force constant", ranges.force_constant),
    ];
    let factors = factors.map(|(name, [low, high])| format!("{name} times {low} to {high}"));
    let [low, high] = ranges.friction.map(|newton| significant(newton, 3));
    format!("{}, friction {low} to {high} {force}", factors.join(", "))
}

fn cells(law: &Judged, plants: usize) -> Vec<Cell> {
    let plan = law
        .plan
        .map_or("-".into(), |(_, time)| format!("{:.0}", 1e3 * time));
    let mut cells = vec![
        Cell::new(law.law),
        right(plan),
        right(spread(&law.settled, 1e3, 0)),
        right(spread(&law.settled_and_at_rest, 1e3, 0)),
        right(spread(&law.peak_current, 1.0, 2)),
    ];
    let numbers = [law.not_settled, law.not_at_rest, law.hunting, law.failed];
    cells.extend(numbers.map(|number| right(format!("{number} of {plants}"))));
    cells
}

fn spread(of: &Spread, factor: f64, decimals: usize) -> String {
    let shown = |figure: Option<f64>| {
        figure.map_or("-".into(), |value| format!("{:.decimals$}", factor * value))
    };
    [of.median, of.most, of.worst].map(shown).join(" / ")
}
