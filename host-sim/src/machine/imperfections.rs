//! What only a plant has and no drive reckons with: cogging, backlash, an encoder that errs.

/// What makes a plant differ from its description in kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imperfections {
    /// Force on the actuator, N, towards the nearest multiple of its pitch.
    pub cogging: Wave,
    /// Total gap at the spring before each load, m; none of those without an entry.
    pub backlash: Vec<f64>,
    /// What the encoder reads too much, m.
    pub eccentricity: Wave,
    /// Of what the encoder reads before it rounds, m rms.
    pub noise: f64,
}

/// `amplitude sin(2 pi x / pitch)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wave {
    /// In the unit of what it is of.
    pub amplitude: f64,
    /// m.
    pub pitch: f64,
}

impl Wave {
    /// At a position, m.
    #[must_use]
    pub fn at(&self, position: f64) -> f64 {
        if self.amplitude == 0.0 {
            return 0.0;
        }
        self.amplitude * (std::f64::consts::TAU * position / self.pitch).sin()
    }
}
