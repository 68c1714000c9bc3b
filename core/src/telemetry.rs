//! One record per control step: what was measured, estimated and commanded.
//!
//! Plain numbers in SI units, so that the same record is logged by the drive (feature `defmt`)
//! and written by the simulation (feature `serde`).

use crate::supervisor::State;

/// Record of one control step of a drive with `N` load masses.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Telemetry<const N: usize> {
    /// Number of the control step; wraps.
    pub step: u32,
    /// State of the drive after the step.
    pub state: State,
    /// Encoder counter as read.
    pub count: u32,
    /// Current applied over the period before, A.
    pub applied_current: f32,
    /// Reference position, m.
    pub reference: f32,
    /// Position of the actuator, `x_a`, m.
    pub position: f32,
    /// Velocity of the actuator, `v_a`, m/s.
    pub velocity: f32,
    /// Disturbance `d_hat` of (19), N.
    pub disturbance: f32,
    /// Reaction force of (18), N.
    pub reaction_force: f32,
    /// Estimated position of each load, `x_i`, m.
    #[cfg_attr(feature = "serde", serde(serialize_with = "as_slice"))]
    pub load_position: [f32; N],
    /// Estimated velocity of each load, `v_i`, m/s.
    #[cfg_attr(feature = "serde", serde(serialize_with = "as_slice"))]
    pub load_velocity: [f32; N],
    /// Disturbance on the actuator as the state observer sees it, `d`, N.
    pub disturbance_state: f32,
    /// Commanded current, A.
    pub command: f32,
    /// Whether the current limit acted.
    pub limited: bool,
    /// Processor cycles of the step, filled in by the firmware; zero elsewhere.
    pub cycles: u32,
}

impl<const N: usize> Default for Telemetry<N> {
    fn default() -> Self {
        Self {
            step: 0,
            state: State::Idle,
            count: 0,
            applied_current: 0.0,
            reference: 0.0,
            position: 0.0,
            velocity: 0.0,
            disturbance: 0.0,
            reaction_force: 0.0,
            load_position: [0.0; N],
            load_velocity: [0.0; N],
            disturbance_state: 0.0,
            command: 0.0,
            limited: false,
            cycles: 0,
        }
    }
}

impl<const N: usize> Telemetry<N> {
    /// Nothing is estimated and nothing followed while the loop is open: zero, not what was last.
    pub(crate) fn forget_estimates(&mut self) {
        *self = Self {
            step: self.step,
            state: self.state,
            count: self.count,
            applied_current: self.applied_current,
            position: self.position,
            command: self.command,
            limited: self.limited,
            ..Self::default()
        };
    }
}

#[cfg(feature = "serde")]
fn as_slice<S: serde::Serializer, const N: usize>(
    values: &[f32; N],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serde::Serialize::serialize(values.as_slice(), serializer)
}
