//! The encoder on the actuator.

/// Counts that the actuator must travel in a run to be identified, so that rounding does not hide its
/// motion.
pub const LEAST_COUNTS: f64 = 100.0;

/// Encoder of the actuator.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoder {
    /// m per count.
    pub resolution: f64,
    /// Width of the counter, 2 to 32; the firmware's boards have 16 or 32.
    pub counter_bits: u32,
}
