//! All that moves, as numbers: what [`Motion`](super::Motion) simulates.

use super::friction::DryFriction;
use super::late;
use super::{Actuator, Friction, Load, chain_of};
use crate::chain::Chain;
use nalgebra::{DMatrix, DVector};

/// A chain, its dry friction, and how late its force comes.
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanics {
    /// Masses, springs, dampers and viscous friction.
    pub chain: Chain,
    /// Of each mass, actuator first; none of those without an entry.
    pub friction: Vec<DryFriction>,
    /// By which the force on the actuator comes late behind the command, s.
    pub delay: f64,
    /// Time constant of its first-order lag, s; none: 0.
    pub lag: f64,
}

impl Mechanics {
    /// Of a machine.
    #[must_use]
    pub fn new(actuator: &Actuator, loads: &[Load], friction: &Friction) -> Self {
        let of_loads = loads.iter().map(|load| DryFriction::coulomb(load.coulomb));
        Self {
            chain: chain_of(actuator, loads, friction.viscous),
            friction: std::iter::once(friction.dry()).chain(of_loads).collect(),
            delay: actuator.delay,
            lag: actuator.lag,
        }
    }

    /// Transition over one control period and input per A, the current held, without dry friction: states of the
    /// chain, then, where the force comes late, the force and the commands of the periods before, the last one
    /// first, all in A.
    ///
    /// * `period`: s
    #[must_use]
    pub fn sampled(&self, period: f64) -> (DMatrix<f64>, DVector<f64>) {
        late::sampled(self, period)
    }

    /// A chain with Coulomb friction on the actuator, whose force comes at once.
    #[must_use]
    pub fn of_chain(chain: &Chain, coulomb: f64) -> Self {
        Self {
            chain: chain.clone(),
            friction: vec![DryFriction::coulomb(coulomb)],
            delay: 0.0,
            lag: 0.0,
        }
    }
}
