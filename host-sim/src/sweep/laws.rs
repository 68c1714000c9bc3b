//! The laws of a sweep and one run of each: design, plant and scenario in, figures out.

use crate::compare::{FormedRival, Rival, rival_names, tune_rivals};
use crate::design::Design;
use crate::drive::PlantFile;
use crate::error::Result;
use crate::output::Progress;
use crate::simulate::Law;
use crate::simulate::metrics::Metrics;
use crate::simulate::scenario::Scenario;
use crate::simulate::watch::measure_watched;

/// The laws that need no tuning.
const DESIGNED: [(&str, Law); 2] = [("drive", Law::Core), ("full state", Law::FullState)];

/// A law, tuned where it has to be.
pub(super) enum Chosen {
    /// As designed.
    Designed(Law),
    /// Tuned.
    Rival(Rival),
}

/// A law for one drive.
enum Formed<'a> {
    Designed(Law),
    Rival(FormedRival<'a>),
}

/// All laws for one drive.
pub(super) struct Bench<'a> {
    design: &'a Design,
    scenario: &'a Scenario,
    duration: f64,
    laws: Vec<std::result::Result<Formed<'a>, String>>,
}

/// Names of all laws that a sweep of this drive can have.
pub(super) fn names(design: &Design, scenario: &Scenario) -> Vec<&'static str> {
    let designed = DESIGNED.iter().map(|(name, _)| *name);
    designed.chain(rival_names(design, scenario)).collect()
}

/// Tunes what has to be tuned.
///
/// * `names`: some of [`names`]
///
/// # Errors
/// As [`tune_rivals`].
pub(super) fn choose(
    design: &Design,
    scenario: &Scenario,
    names: &[String],
    evaluations: usize,
    progress: &Progress<'_>,
) -> Result<Vec<Chosen>> {
    let designed = |name: &str| DESIGNED.iter().find(|(own, _)| *own == name);
    let rivals: Vec<&str> = names
        .iter()
        .map(|name| &name[..])
        .filter(|name| designed(name).is_none())
        .collect();
    let rivals = tune_rivals(design, scenario, &rivals, evaluations, progress)?;
    let chosen = names.iter().filter_map(|name| {
        if let Some((_, law)) = designed(name) {
            return Some(Chosen::Designed(*law));
        }
        let rival = rivals.iter().find(|rival| rival.name() == name)?;
        Some(Chosen::Rival(rival.clone()))
    });
    Ok(chosen.collect())
}

impl<'a> Bench<'a> {
    /// * `duration`: of a run, s
    pub(super) fn new(
        design: &'a Design,
        scenario: &'a Scenario,
        duration: f64,
        chosen: &[Chosen],
    ) -> Self {
        let laws = chosen.iter().map(|law| match law {
            Chosen::Designed(law) => Ok(Formed::Designed(*law)),
            Chosen::Rival(rival) => {
                let formed = rival.form(design, scenario);
                formed.map(Formed::Rival).map_err(|error| error.to_string())
            }
        });
        Self {
            design,
            scenario,
            duration,
            laws: laws.collect(),
        }
    }

    /// The figures of every law on a plant, or why it has none.
    pub(super) fn run(&self, plant: &PlantFile) -> Vec<std::result::Result<Metrics, String>> {
        let laws = self.laws.iter().map(|law| match law {
            Ok(law) => self.figures(law, plant).map_err(|error| error.to_string()),
            Err(why) => Err(why.clone()),
        });
        laws.collect()
    }

    /// One run.
    fn figures(&self, law: &Formed<'_>, plant: &PlantFile) -> Result<Metrics> {
        match law {
            Formed::Designed(law) => {
                measure_watched(self.design, plant, self.scenario, *law, self.duration)
            }
            Formed::Rival(rival) => rival.watched(plant, self.duration),
        }
    }
}
