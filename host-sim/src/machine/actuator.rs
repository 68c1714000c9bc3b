//! The actuator: its mass, its force constant and what its amplifier can do.

use arso_core::amplifier::Amplifier;

/// Actuator and its amplifier.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// `m_an`, kg.
    pub mass: f64,
    /// `k_fn`, N/A.
    pub force_constant: f64,
    /// Identified deviation `Δm`, kg.
    pub mass_deviation: f64,
    /// Identified deviation `Δk_f`, N/A.
    pub force_constant_deviation: f64,
    /// A.
    pub current_limit: f64,
    /// Step of the current output, A; zero for a continuous one.
    pub current_resolution: f64,
    /// Code of the converter at no current.
    pub zero_code: u16,
    /// Whether a higher code is less current.
    pub inverted: bool,
    /// Force by which the motor holds the machine where it stands, against gravity, N.
    pub holding_force: f64,
    /// Whether a brake holds the actuator while the amplifier is off.
    pub brake: bool,
    /// By which the force comes late behind the command, s.
    pub delay: f64,
    /// Time constant of the force's first-order lag behind the current, s; none: 0.
    pub lag: f64,
}

impl Actuator {
    /// The amplifier as the core and the board take it.
    #[must_use]
    pub fn amplifier(&self) -> Amplifier {
        Amplifier {
            step: self.current_resolution as f32,
            zero_code: self.zero_code,
            inverted: self.inverted,
        }
    }

    /// Force at the current limit, N.
    #[must_use]
    pub fn largest_force(&self) -> f64 {
        self.actual_force_constant() * self.current_limit
    }

    /// `m_an + Δm`, kg.
    #[must_use]
    pub fn actual_mass(&self) -> f64 {
        self.mass + self.mass_deviation
    }

    /// `k_fn + Δk_f`, N/A.
    #[must_use]
    pub fn actual_force_constant(&self) -> f64 {
        self.force_constant + self.force_constant_deviation
    }
}
