//! The loads, and the chain that they make with the actuator.

use super::Actuator;
use crate::chain::Chain;

/// One load mass with the spring and damper towards the actuator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Load {
    /// kg.
    pub mass: f64,
    /// N/m.
    pub stiffness: f64,
    /// N s/m.
    pub damping: f64,
    /// Viscous friction against the ground, N s/m.
    pub viscous: f64,
    /// Coulomb friction against the ground, N.
    pub coulomb: f64,
}

/// The chain as actually known: nominal values plus identified deviations.
///
/// * `viscous`: friction of the actuator, N s/m
#[must_use]
pub fn chain_of(actuator: &Actuator, loads: &[Load], viscous: f64) -> Chain {
    let masses = std::iter::once(actuator.actual_mass());
    Chain {
        mass: masses.chain(loads.iter().map(|load| load.mass)).collect(),
        stiffness: loads.iter().map(|load| load.stiffness).collect(),
        damping: loads.iter().map(|load| load.damping).collect(),
        viscous,
        ground: loads.iter().map(|load| load.viscous).collect(),
        force_constant: actuator.actual_force_constant(),
    }
}
