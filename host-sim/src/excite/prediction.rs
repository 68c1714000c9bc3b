//! What an excitation will do to the machine, as far as the drive file knows it.

use super::ExcitationPlan;
use crate::drive::{Drive, PlantFile};
use crate::error::Result;
use crate::machine::Friction;
use crate::simulate::plant::Plant;

/// Largest values over the whole excitation, beginning at rest.
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
    /// Moves the nominal machine through the excitation: without friction, and with the friction that the
    /// drive file has, if it has any; the larger counts.
    ///
    /// Friction need not shorten the way: it decides where on its path the machine settles.
    ///
    /// # Errors
    /// When its motion is no longer finite.
    pub(super) fn new(drive: &Drive, plan: &ExcitationPlan) -> Result<Self> {
        let mut prediction = Self::default();
        prediction.with_friction = prediction.take(&Friction::default(), drive, plan)?;
        if drive.friction != Friction::default() {
            prediction.with_friction = prediction.take(&drive.friction, drive, plan)?;
        }
        Ok(prediction)
    }

    /// Takes in what happens under some friction; the travel.
    fn take(&mut self, friction: &Friction, drive: &Drive, plan: &ExcitationPlan) -> Result<f64> {
        let machine = PlantFile {
            friction: friction.clone(),
            ..PlantFile::from(drive)
        };
        let mut plant = Plant::new(&machine, plan.sample_time);
        let mut travel = 0.0_f64;
        for current in plan.currents() {
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

/// Position of the actuator after each control period, with the friction of the drive file, m.
///
/// # Errors
/// When its motion is no longer finite.
pub(super) fn motion(drive: &Drive, plan: &ExcitationPlan) -> Result<Vec<f64>> {
    let mut plant = Plant::new(&PlantFile::from(drive), plan.sample_time);
    let positions = plan.currents().map(|current| {
        plant.advance(current.into())?;
        Ok(plant.state()[0])
    });
    positions.collect()
}
