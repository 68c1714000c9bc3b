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
