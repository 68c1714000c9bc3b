//! Friction on the actuator, as numbers; [`motion`](super::motion) is what it does.

/// Friction on the actuator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Friction {
    /// N.
    pub coulomb: f64,
    /// N s/m.
    pub viscous: f64,
}
