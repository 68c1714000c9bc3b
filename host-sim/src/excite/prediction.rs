//! What an excitation will do to the machine, as far as the drive file knows it.

use super::Play;
use crate::drive::{Drive, Friction, PlantFile};
use crate::error::Result;
use crate::plant::Plant;

/// Largest values over the whole play, beginning at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prediction {
    /// Farthest of the actuator from where it began, m.
    pub travel: f64,
    /// The same with the friction of the drive file, m.
    pub with_friction: f64,
    /// Fastest of the actuator, m/s.
    pub speed: f64,
    /// Largest stretch or compression of a spring, m.
    pub stretch: f64,
    /// Which spring, 1 being that at the actuator.
    pub spring: usize,
}

impl Prediction {
    /// Moves the nominal machine through the play: without friction, and with the friction that the
    /// drive file has, if it has any; the larger counts.
    ///
    /// Friction need not shorten the way: it decides where on its path the machine settles.
    ///
    /// # Errors
    /// When its motion is no longer finite.
    pub(super) fn new(drive: &Drive, play: &Play) -> Result<Self> {
        let mut prediction = Self::default();
        prediction.with_friction = prediction.take(&Friction::default(), drive, play)?;
        if drive.friction != Friction::default() {
            prediction.with_friction = prediction.take(&drive.friction, drive, play)?;
        }
        Ok(prediction)
    }

    /// Takes in what happens under some friction; the travel.
    fn take(&mut self, friction: &Friction, drive: &Drive, play: &Play) -> Result<f64> {
        let machine = PlantFile {
            friction: friction.clone(),
            ..PlantFile::from(drive)
        };
        let mut plant = Plant::new(&machine, play.sample_time);
        let mut travel = 0.0_f64;
        for current in play.currents() {
            plant.advance(current.into())?;
            let state = plant.state();
            travel = travel.max(state[0].abs());
            self.speed = self.speed.max(state[1].abs());
            for spring in 1..=drive.loads.len() {
                let stretch = (state[2 * spring] - state[2 * spring - 2]).abs();
                if stretch > self.stretch {
                    (self.stretch, self.spring) = (stretch, spring);
                }
            }
        }
        self.travel = self.travel.max(travel);
        Ok(travel)
    }
}
