//! What has to stay within a limit, period by period.

use super::{Period, ProtectionLimits, Trip, beyond};
use crate::fault::Fault;

/// * `holding_force`: what the motor carries, which is no fault, N
/// * `planned`: force of the plans of late, by which a model that is off shows, N
/// * `stop`: what a stop may add to disturbance and innovation, N, and the fastest that the approach to it may be
pub(super) fn step<const N: usize>(
    limits: &ProtectionLimits<N>,
    holding_force: f32,
    (planned, stop): (f32, Option<(f32, f32)>),
    period: &Period<'_, N>,
) -> Result<(), Trip> {
    let Period {
        estimate,
        reaction_force,
        ..
    } = period;
    let (stopping, fastest) = stop.unwrap_or((0.0, limits.velocity));
    beyond(Fault::Velocity, estimate.velocity.0, fastest)?;
    beyond(
        Fault::ReactionForce,
        reaction_force.0 - holding_force,
        limits.reaction_force,
    )?;
    beyond(
        Fault::Disturbance,
        estimate.disturbance.0 - holding_force,
        limits.disturbance + limits.model_error.disturbance * planned + stopping,
    )?;
    beyond(
        Fault::Unexpected,
        estimate.innovation.0,
        limits.innovation + limits.model_error.innovation * planned + stopping,
    )?;
    let mut inner = 0.0;
    for (deflection, limit) in estimate.deflection.iter().zip(&limits.deflection) {
        beyond(Fault::Deflection, deflection - inner, *limit)?;
        inner = *deflection;
    }
    // Last: what is worse comes first.
    beyond(
        Fault::FollowingError,
        period.error().0,
        limits.following_error,
    )
}
