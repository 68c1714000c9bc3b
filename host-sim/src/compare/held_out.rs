//! Plants that no tuning sees, and what a law makes of them all.
//!
//! Named plants differ from the drive in one respect each, and a law that is tuned on them is told what
//! comes. Here all differ at once: every plant has its own factors, drawn with a fixed seed from
//!
//! ```text
//! stiffness ±30 %   last load 0 … +50 %   force constant ±10 %   Coulomb friction 0 … that of the friction case
//! ```

use super::{Case, Outcome, Spread};
use crate::design::Design;
use crate::drive::PlantFile;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;

const SEED: u64 = 2;

/// What a law makes of many plants.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOut {
    /// How many plants.
    pub plants: usize,
    /// On how many it does not come to rest within the band, or faults, or could not be run.
    pub not_settled: usize,
    /// Settling time that half of the plants keep, s; none where it is one of those that do not settle.
    pub median: Option<f64>,
    /// That of 95 %, s.
    pub most: Option<f64>,
    /// The longest of all, s.
    pub worst: Option<f64>,
}

impl HeldOut {
    pub(super) fn new(outcomes: &[Outcome]) -> Self {
        let settled = outcomes.iter().map(|outcome| {
            let metrics = outcome.metrics.as_ref().filter(|m| m.fault.is_none());
            metrics.and_then(|metrics| metrics.settling_time)
        });
        let times: Vec<Option<f64>> = settled.collect();
        let Spread {
            median,
            most,
            worst,
        } = Spread::of(&times);
        Self {
            plants: times.len(),
            not_settled: times.iter().filter(|time| time.is_none()).count(),
            median,
            most,
            worst,
        }
    }
}

/// Plants around a drive.
///
/// * `coulomb`: largest friction, N
pub(super) fn cases(design: &Design, coulomb: f64, count: usize) -> Vec<Case> {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut share = move |low: f64, high: f64| random.random_range(low..=high);
    let plants = (0..count).map(|i| {
        let mut plant = PlantFile::from(&design.drive);
        let stiffness = share(0.7, 1.3);
        for load in &mut plant.loads {
            load.stiffness *= stiffness;
        }
        let last = share(1.0, 1.5);
        if let Some(load) = plant.loads.last_mut() {
            load.mass *= last;
        }
        plant.actuator.force_constant *= share(0.9, 1.1);
        plant.friction.coulomb = coulomb * share(0.0, 1.0);
        Case {
            name: format!("drawn {}", i + 1),
            plant,
            late: 0,
            tuned: false,
        }
    });
    plants.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    #[test]
    fn plants_are_the_same_each_time_and_stay_in_their_box() {
        let design = Design::new(&Drive::default_drive()).unwrap();
        let (all, few) = (cases(&design, 0.2, 200), cases(&design, 0.2, 3));
        assert_eq!(all[2].plant, few[2].plant);
        let drive = &design.drive;
        for case in &all {
            let plant = &case.plant;
            let k = plant.loads[0].stiffness / drive.loads[0].stiffness;
            let mass = plant.loads[2].mass / drive.loads[2].mass;
            assert!((0.7..=1.3).contains(&k) && (1.0..=1.5).contains(&mass));
            assert!((0.0..=0.2).contains(&plant.friction.coulomb));
        }
    }

    #[test]
    fn what_does_not_settle_is_longer_than_all() {
        let none = |case: usize| Outcome {
            case: case.to_string(),
            tuned_on: false,
            metrics: None,
            failure: None,
        };
        let found = HeldOut::new(&(0..20).map(none).collect::<Vec<_>>());
        assert_eq!((found.plants, found.not_settled), (20, 20));
        assert_eq!((found.median, found.most, found.worst), (None, None, None));
    }
}
