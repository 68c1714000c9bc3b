//! What the force observers must know of the actuator.

use crate::check::{SettingsError, finite, positive};
use serde::{Deserialize, Serialize};

/// Mass and force constant, nominal and as identified.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Actuator<T = f32> {
    /// Nominal mass `m_an`, kg.
    pub mass: T,
    /// Nominal force constant `k_fn`, N/A.
    pub force_constant: T,
    /// Identified deviation `Δm` of the mass, actual minus nominal, kg.
    pub mass_deviation: T,
    /// Identified deviation `Δk_f` of the force constant, actual minus nominal, N/A.
    pub force_constant_deviation: T,
}

impl Actuator {
    /// Mass as known after identification, `m_an + Δm`, kg.
    #[must_use]
    pub fn actual_mass(&self) -> f32 {
        self.mass + self.mass_deviation
    }

    /// Force constant as known after identification, `k_fn + Δk_f`, N/A.
    #[must_use]
    pub fn actual_force_constant(&self) -> f32 {
        self.force_constant + self.force_constant_deviation
    }

    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        positive("actuator.mass", self.mass)?;
        positive("actuator.force_constant", self.force_constant)?;
        let deviation = |_| SettingsError::Deviation;
        finite("", &[self.mass_deviation, self.force_constant_deviation]).map_err(deviation)?;
        positive("", self.actual_mass()).map_err(deviation)?;
        positive("", self.actual_force_constant()).map_err(deviation)
    }
}
