//! How well the drive is known: sets of plants around it.
//!
//! | set | stiffness | last load | force constant | Coulomb friction |
//! |---|---|---|---|---|
//! | nominal | | | | the drive itself |
//! | identified | ±2 % | ±2 % | ±2 % | ±15 % |
//! | rough | ±5 % | ±10 % | ±3 % | ±30 % |
//!
//! Of each plant all springs have one factor; every factor is drawn evenly.

use crate::compare::Case;
use crate::design::Design;
use crate::drive::PlantFile;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// A set of plants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Set {
    /// The drive itself.
    Nominal,
    /// What an identification leaves open.
    Identified,
    /// What a data sheet leaves open.
    Rough,
}

impl Set {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Nominal, Self::Identified, Self::Rough];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nominal => "nominal",
            Self::Identified => "identified",
            Self::Rough => "rough",
        }
    }

    /// Most by which stiffness, last load, force constant and friction differ, over what they are.
    #[must_use]
    pub const fn differences(self) -> [f64; 4] {
        match self {
            Self::Nominal => [0.0; 4],
            Self::Identified => [0.02, 0.02, 0.02, 0.15],
            Self::Rough => [0.05, 0.1, 0.03, 0.3],
        }
    }
}

/// The plants of a set; one where nothing differs.
pub(super) fn draw(design: &Design, set: Set, count: usize, seed: u64) -> Vec<Case> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(set as u64);
    let count = if set == Set::Nominal { 1 } else { count };
    let plants = (0..count).map(|i| {
        let [stiffness, last, force_constant, friction] = set
            .differences()
            .map(|most| 1.0 + random.random_range(-most..=most));
        let mut plant = PlantFile::from(&design.drive);
        for load in &mut plant.loads {
            load.stiffness *= stiffness;
        }
        if let Some(load) = plant.loads.last_mut() {
            load.mass *= last;
        }
        plant.actuator.force_constant *= force_constant;
        plant.friction.coulomb *= friction;
        Case {
            name: format!("{} {}", set.name(), i + 1),
            plant,
            late: 0,
            tuned: true,
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
        let mut drive = Drive::default_drive();
        drive.friction.coulomb = 0.2;
        let design = Design::new(&drive).unwrap();
        for set in Set::ALL {
            let (all, few) = (draw(&design, set, 100, 7), draw(&design, set, 3, 7));
            assert_eq!(all[few.len() - 1].plant, few[few.len() - 1].plant);
            for case in &all {
                let plant = &case.plant;
                let factors = [
                    plant.loads[0].stiffness / drive.loads[0].stiffness,
                    plant.loads[2].mass / drive.loads[2].mass,
                    plant.actuator.force_constant / drive.actuator.force_constant,
                    plant.friction.coulomb / 0.2,
                ];
                for (factor, most) in factors.iter().zip(set.differences()) {
                    assert!((factor - 1.0).abs() <= most + 1e-12, "{set:?}: {factors:?}");
                }
            }
        }
        let nominal = draw(&design, Set::Nominal, 100, 7);
        assert_eq!(
            (nominal.len(), &nominal[0].plant),
            (1, &PlantFile::from(&drive))
        );
    }
}
