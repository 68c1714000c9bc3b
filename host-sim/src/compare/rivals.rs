//! Single rivals for others: tuned once by the search of the comparison, then run on any plant.
//!
//! What a rival is tuned to is a point of its box, and the box is in ratios to the drive: so the same point is
//! also a law for a drive that differs a little from the one it was found on.

use super::laws::{self, Make};
use super::tune::Moving;
use super::{Bench, Case, Effort, duration_over, require_comparable, require_short};
use crate::design::Design;
use crate::drive::PlantFile;
use crate::error::{Error, Result};
use crate::output::Progress;
use crate::simulate::metrics::Metrics;
use crate::simulate::scenario::{Approach, Scenario};
use crate::simulate::watch::{after, measure_loop, without_later_forces};

/// The first PD law: the others of its family also start from what it has come to.
const PLAIN: &str = "PD";

/// A law that has been tuned.
#[derive(Clone, Debug)]
pub struct Rival {
    name: &'static str,
    point: Vec<f64>,
}

/// A rival for one drive.
pub struct FormedRival<'a> {
    design: &'a Design,
    scenario: &'a Scenario,
    make: Make<'a>,
}

/// The names of the laws that can be tuned for a drive.
#[must_use]
pub fn rival_names(design: &Design, scenario: &Scenario) -> Vec<&'static str> {
    let laws = laws::tuned(design, scenario);
    laws.into_iter().map(|law| law.name).collect()
}

/// Tunes rivals on the named plants of the comparison.
///
/// * `names`: some of [`rival_names`]
/// * `evaluations`: for each of them
/// * `progress`: told of each rival as its turn comes, and how far it is
///
/// # Errors
/// [`Error::Comparison`] when the runs are too long, or no law can be formed in a whole box.
pub fn tune_rivals(
    design: &Design,
    scenario: &Scenario,
    names: &[&str],
    evaluations: usize,
    progress: &Progress<'_>,
) -> Result<Vec<Rival>> {
    if names.is_empty() {
        return Ok(Vec::new());
    }
    require_comparable(design)?;
    let effort = Effort {
        evaluations,
        plants: 0,
    };
    let mut bench = Bench::new(design, effort);
    bench.scenario = *scenario;
    bench.moving = Moving::Any;
    bench.duration = duration_over(design, scenario.target);
    if scenario.approach == Approach::Move {
        bench.go_by(design, scenario);
        let planned = bench.period * design.plans()?.duration(scenario.target, bench.period);
        bench.duration = bench.duration.max(2.0 * planned);
    }
    require_short(design, bench.duration)?;
    let of_pd = names.iter().any(|name| name.starts_with(PLAIN));
    let laws = laws::tuned(design, scenario).into_iter();
    let laws = laws.filter(|law| names.contains(&law.name) || (of_pd && law.name == PLAIN));
    let laws: Vec<_> = laws.collect();
    let count = laws.len();
    let mut rivals = Vec::new();
    let told = |left: usize, what: &str| progress(count - left, count, what);
    bench.tune_each(laws, &[], &told, |found| {
        if names.contains(&found.name) {
            rivals.push(Rival {
                name: found.name,
                point: found.point,
            });
        }
    })?;
    Ok(rivals)
}

impl Rival {
    /// Which law.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The law for a drive, the one it was tuned for or another.
    ///
    /// # Errors
    /// [`Error::Comparison`] when it cannot be formed for this one.
    pub fn form<'a>(&self, design: &'a Design, scenario: &'a Scenario) -> Result<FormedRival<'a>> {
        let wrong = |error: &dyn std::fmt::Display| {
            let name = self.name;
            Error::Comparison(format!("{name} cannot be formed for this drive: {error}"))
        };
        let laws = laws::tuned(design, scenario).into_iter();
        let law = laws.into_iter().find(|law| law.name == self.name);
        let law = law.ok_or_else(|| wrong(&"there is no such law"))?;
        if law.space.ends.len() != self.point.len() {
            return Err(wrong(&"it has another number of masses"));
        }
        let (_, make) = (law.form)(&self.point).map_err(|error| wrong(&error))?;
        Ok(FormedRival {
            design,
            scenario,
            make,
        })
    }
}

impl FormedRival<'_> {
    /// The figures of one run on a plant, with the end as it is after the loop has run on.
    ///
    /// * `duration`: of the experiment, s
    ///
    /// # Errors
    /// As [`simulate`](crate::simulate::simulate).
    pub fn watched(&self, plant: &PlantFile, duration: f64) -> Result<Metrics> {
        let period = self.design.drive.control.sample_time;
        let case = Case {
            name: String::new(),
            plant: without_later_forces(plant, duration),
            late: 0,
            tuned: false,
        };
        let mut control = (self.make)(&case)?;
        measure_loop(
            control.as_mut(),
            (&case.plant, 0),
            self.scenario,
            (period, duration, duration + after(period)),
            self.design.motion.settling_tolerance,
        )
    }
}
