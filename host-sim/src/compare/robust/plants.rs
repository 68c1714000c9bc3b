//! The plants that a drive is tuned for: ranges around what its file says, and plants drawn from them.
//!
//! | known | stiffness | last load | force constant | Coulomb friction |
//! |---|---|---|---|---|
//! | wide | ±30 % | 0 … +50 % | ±10 % | 0 … what the drive file states, or 1.55 % of the motor's force where it states none |
//! | rough | ±5 % | ±10 % | ±3 % | what the drive file states, ±30 % |
//! | identified | ±2 % | ±2 % | ±2 % | what the drive file states, ±15 % |
//!
//! Of each plant all springs have one factor; every factor is drawn evenly, and the friction in newtons.

use crate::compare::moves::Set;
use crate::compare::{Case, coulomb};
use crate::drive::{Drive, PlantFile};
use crate::error::{Error, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// How well a drive is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Known {
    /// As before anything was measured.
    Wide,
    /// As from data sheets.
    Rough,
    /// As from an identification.
    Identified,
}

/// What plants are drawn from, each from its lower to its upper end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ranges {
    /// Factor of all springs.
    pub stiffness: [f64; 2],
    /// Factor of the last load's mass.
    pub last_load: [f64; 2],
    /// Factor of the force constant.
    pub force_constant: [f64; 2],
    /// Coulomb friction on the actuator, N.
    pub friction: [f64; 2],
}

impl Ranges {
    /// The table above.
    ///
    /// * `friction`: N, instead of what the table says
    ///
    /// # Errors
    /// [`Error::Usage`] where the friction is to be around what the drive file states, and it states none.
    pub fn of(drive: &Drive, known: Known, friction: Option<[f64; 2]>) -> Result<Self> {
        let (name, set) = match known {
            Known::Wide => {
                return Ok(Self {
                    stiffness: [0.7, 1.3],
                    last_load: [1.0, 1.5],
                    force_constant: [0.9, 1.1],
                    friction: friction.unwrap_or([0.0, coulomb(drive)]),
                });
            }
            Known::Rough => ("rough", Set::Rough),
            Known::Identified => ("identified", Set::Identified),
        };
        let stated = drive.friction.coulomb;
        if stated == 0.0 && friction.is_none() {
            return Err(Error::Usage(format!(
                "a drive that is known as {name} has friction around what its file states, and this file states none: \
                 add friction.coulomb to it"
            )));
        }
        let [stiffness, last_load, force_constant, around] =
            set.differences().map(|most| [1.0 - most, 1.0 + most]);
        Ok(Self {
            stiffness,
            last_load,
            force_constant,
            friction: friction.unwrap_or(around.map(|factor| factor * stated)),
        })
    }
}

/// What plants are drawn for: no plant of one is one of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stream {
    TunedOn,
    JudgedOn,
}

/// Plants around a drive.
pub(super) fn draw(
    drive: &Drive,
    ranges: &Ranges,
    stream: Stream,
    count: usize,
    seed: u64,
) -> Vec<Case> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(match stream {
        Stream::JudgedOn => 0,
        Stream::TunedOn => 1,
    });
    let mut between = move |[low, high]: [f64; 2]| random.random_range(low..=high);
    let plants = (0..count).map(|i| {
        let mut plant = PlantFile::from(drive);
        let stiffness = between(ranges.stiffness);
        for load in &mut plant.loads {
            load.stiffness *= stiffness;
        }
        let last = between(ranges.last_load);
        if let Some(load) = plant.loads.last_mut() {
            load.mass *= last;
        }
        plant.actuator.force_constant *= between(ranges.force_constant);
        let newton = between(ranges.friction);
        let stated = drive.friction.coulomb;
        if stated > 0.0 {
            plant.friction = drive.friction.times(newton / stated);
        } else {
            plant.friction.coulomb = newton;
        }
        Case {
            name: format!("drawn {}", i + 1),
            plant,
            late: 0,
            tuned: stream == Stream::TunedOn,
        }
    });
    plants.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factors(drive: &Drive, case: &Case) -> [f64; 4] {
        let plant = &case.plant;
        [
            plant.loads[0].stiffness / drive.loads[0].stiffness,
            plant.loads[2].mass / drive.loads[2].mass,
            plant.actuator.force_constant / drive.actuator.force_constant,
            plant.friction.coulomb,
        ]
    }

    /// Drawn evenly from their ranges: within them, with the mean and the variance of an even distribution.
    #[test]
    fn plants_are_spread_evenly_over_their_ranges() {
        let mut drive = Drive::default_drive();
        drive.friction.coulomb = 0.2;
        for known in [Known::Wide, Known::Rough, Known::Identified] {
            let ranges = Ranges::of(&drive, known, None).unwrap();
            let cases = draw(&drive, &ranges, Stream::JudgedOn, 2000, 1);
            let all = [
                ranges.stiffness,
                ranges.last_load,
                ranges.force_constant,
                ranges.friction,
            ];
            for (i, [low, high]) in all.into_iter().enumerate() {
                let drawn: Vec<f64> = cases.iter().map(|case| factors(&drive, case)[i]).collect();
                assert!(
                    drawn.iter().all(|x| (low..=high).contains(x)),
                    "{known:?} {i}"
                );
                let count = drawn.len() as f64;
                let mean = drawn.iter().sum::<f64>() / count;
                let square = drawn.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
                let width = high - low;
                assert!(
                    (mean - 0.5 * (low + high)).abs() < 0.03 * width,
                    "{known:?} {i}: {mean}"
                );
                assert!(
                    (square - width * width / 12.0).abs() < 0.01 * width * width,
                    "{known:?} {i}"
                );
            }
        }
    }

    #[test]
    fn no_plant_that_a_law_is_judged_on_is_one_it_was_tuned_on() {
        let drive = Drive::default_drive();
        let ranges = Ranges::of(&drive, Known::Wide, None).unwrap();
        let [tuned_on, judged_on] =
            [Stream::TunedOn, Stream::JudgedOn].map(|stream| draw(&drive, &ranges, stream, 50, 7));
        for case in &judged_on {
            assert!(tuned_on.iter().all(|other| other.plant != case.plant));
        }
        let few = draw(&drive, &ranges, Stream::JudgedOn, 5, 7);
        assert!(few.iter().zip(&judged_on).all(|(a, b)| a.plant == b.plant));
    }

    #[test]
    fn friction_around_none_is_refused() {
        let drive = Drive::default_drive();
        let error = Ranges::of(&drive, Known::Rough, None).unwrap_err();
        assert!(error.to_string().contains("friction.coulomb"), "{error}");
        let ranges = Ranges::of(&drive, Known::Rough, Some([0.1, 0.2])).unwrap();
        assert_eq!(ranges.friction, [0.1, 0.2]);
    }
}
