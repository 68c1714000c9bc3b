//! Forces from outside.

/// A force on one mass for some time.
#[derive(Clone, Debug, PartialEq)]
pub struct ExternalForce {
    /// 0 for the actuator, 1 for the first load, ….
    pub mass: usize,
    /// s.
    pub start: f64,
    /// s.
    pub duration: f64,
    /// N.
    pub newton: f64,
}

impl ExternalForce {
    /// How long a force from the start on must act to have been there before, s: longer than any start-up.
    const STEADY: f64 = 5.0;

    /// Whether it has been there before, as gravity has.
    #[must_use]
    pub fn steady(&self) -> bool {
        self.start == 0.0 && self.duration >= Self::STEADY
    }
}
