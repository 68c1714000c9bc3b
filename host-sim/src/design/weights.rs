//! The weights of the performance index (2), from however the description states them.
//!
//! Given ones are taken as they are, the paper's follow from the energies of the chain, those of a
//! settling time are searched for (`settling`), and so are those of a drive that states none (`derived`).

pub(super) mod derived;
mod settling;

use crate::chain::Chain;
use crate::drive::{Cost, Weights};
use crate::error::{Error, Result};

/// Diagonals of the performance index (2), one entry per mass, actuator first.
#[derive(Clone, Debug, PartialEq)]
pub struct PerformanceIndex {
    /// `R`, 1/A².
    pub current: f64,
    /// 1/m².
    pub position: Vec<f64>,
    /// s²/m².
    pub velocity: Vec<f64>,
}

impl PerformanceIndex {
    /// The index that a description asks for.
    ///
    /// * `sample_time`: s
    ///
    /// # Errors
    /// [`Error::Input`] when no member of the family of weights settles as fast as it asks for,
    /// [`Error::Design`] where it asks for weights that follow from the whole drive, or states the gain itself.
    pub fn new(cost: &Cost, chain: &Chain, sample_time: f64) -> Result<Self> {
        let current = cost.current;
        let (position, velocity) = match &cost.weights {
            Weights::Given { position, velocity } => (position.clone(), velocity.clone()),
            Weights::Gain { .. } => {
                let message = "a drive file that states its gain has no performance index";
                return Err(Error::Design(message.into()));
            }
            Weights::Derived => {
                let message = "weights that follow from the drive are found with its whole design";
                return Err(Error::Design(message.into()));
            }
            Weights::Energy(scale) => energy(chain, *scale),
            Weights::SettlingTime { seconds, place } => {
                let found = settling::weights(chain, current, sample_time, *seconds);
                found.map_err(|error| Error::Input {
                    place: place.clone(),
                    message: format!("cost.settling_time = {seconds}: {error}"),
                })?
            }
        };
        Ok(Self {
            current,
            position,
            velocity,
        })
    }

    /// Diagonal of `Q` in the order of the states, `x_a v_a x_1 v_1 …`.
    #[must_use]
    pub fn state_weights(&self) -> Vec<f64> {
        let masses = self.position.iter().zip(&self.velocity);
        masses
            .flat_map(|(position, velocity)| [*position, *velocity])
            .collect()
    }
}

/// The paper's weights: each mass weighs in with the stiffness attached to it and with its mass,
/// so that the index counts potential and kinetic energy, times `scale`.
fn energy(chain: &Chain, scale: f64) -> (Vec<f64>, Vec<f64>) {
    let stiffness = |element: usize| {
        let inner = element
            .checked_sub(1)
            .map_or(0.0, |spring| chain.stiffness[spring]);
        inner + chain.stiffness.get(element).copied().unwrap_or(0.0)
    };
    (
        (0..chain.mass.len())
            .map(|element| scale * stiffness(element))
            .collect(),
        chain.mass.iter().map(|mass| scale * mass).collect(),
    )
}
