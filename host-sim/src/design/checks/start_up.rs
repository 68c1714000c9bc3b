//! Whether the machine stays where it is while the drive starts.

use super::{Check, Design, Verdict};

/// Share of the motor's force up to which it can carry the machine: start-up adds half of the current limit to
/// what holds (`arso_core::direction_check`).
const CARRIED: f64 = 0.5;

/// What the motor carries, over its force.
pub(super) fn holding_share(design: &Design) -> Check {
    let actuator = &design.drive.actuator;
    let force = actuator.largest_force();
    let value = actuator.holding_force.abs() / force;
    let verdict = if value <= CARRIED {
        Verdict::Pass
    } else {
        Verdict::Refuse
    };
    let unit = design.drive.kind.units().force;
    Check::new(
        "holding_share",
        verdict,
        (value, CARRIED),
        format!(
            "share of the motor's force of {force:.4} {unit} that actuator.holding_force takes; above one half \
             start-up, which adds half of the current limit, cannot prove the signs: a counterweight or a larger \
             actuator.current_limit"
        ),
    )
}

/// What pulls at the machine while the amplifier is off, less what friction and brake hold.
pub(super) fn unheld_force(design: &Design) -> Check {
    let drive = &design.drive;
    let actuator = &drive.actuator;
    let value = if actuator.brake {
        0.0
    } else {
        (actuator.holding_force.abs() - drive.friction.coulomb).max(0.0)
    };
    let verdict = if value > 0.0 {
        Verdict::Refuse
    } else {
        Verdict::Pass
    };
    let unit = drive.kind.units().force;
    Check::new(
        "unheld_force",
        verdict,
        (value, 0.0),
        format!(
            "{unit} that friction does not hold while the amplifier is off: the machine falls, and start-up ends \
             with fault 7, NotAtRest. It needs a brake that opens with the amplifier's enable line \
             (actuator.brake = true) or a counterweight"
        ),
    )
}
