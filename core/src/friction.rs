//! Friction feed-forward: what friction will take, given before it does.
//!
//! ```text
//! f = F_c sat(v / v_s) + b v
//! ```
//!
//! `v` is the velocity of the actuator's *reference*: it has no noise, and at rest it is zero, so that a wrong
//! `F_c` or `b` can drive no limit cycle. Below `v_s` the Coulomb part is proportional to the velocity.
//!
//! The observers are fed with the current less this part: to them the machine is one without friction, and
//! what their disturbance state finds and compensates is the rest of it.
//!
//! Where no Coulomb friction is declared, what held the actuator when the signs were proven takes its place
//! (`direction_check`).

use crate::check::{SettingsError, not_negative, positive};
use crate::units::{Force, Velocity};
use serde::{Deserialize, Serialize};

/// What is known of the friction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrictionFeedForward {
    /// Coulomb friction `F_c`, N.
    pub coulomb: f32,
    /// Viscous friction `b`, N s/m.
    pub viscous: f32,
    /// Velocity `v_s` from which on Coulomb friction is whole, m/s.
    pub smoothing: f32,
}

impl FrictionFeedForward {
    /// Force that friction takes at a velocity of the reference.
    #[must_use]
    pub fn step(&self, velocity: Velocity) -> Force {
        let whole = (velocity.0 / self.smoothing).clamp(-1.0, 1.0);
        Force(self.coulomb * whole + self.viscous * velocity.0)
    }

    /// The same with other Coulomb friction.
    pub(crate) const fn with(self, Force(coulomb): Force) -> Self {
        Self { coulomb, ..self }
    }

    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        not_negative("friction.coulomb", self.coulomb)?;
        not_negative("friction.viscous", self.viscous)?;
        positive("friction.smoothing", self.smoothing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_the_sign_of_the_reference_and_none_at_rest() {
        let friction = FrictionFeedForward {
            coulomb: 0.2,
            viscous: 0.5,
            smoothing: 0.01,
        };
        for (velocity, force) in [
            (0.0, 0.0),
            (0.005, 0.1 + 0.0025),
            (-0.01, -0.2 - 0.005),
            (2.0, 0.2 + 1.0),
            (-2.0, -1.2),
        ] {
            let found = friction.step(Velocity(velocity)).0;
            assert!((found - force).abs() < 1e-6, "{velocity}: {found}");
        }
    }
}
