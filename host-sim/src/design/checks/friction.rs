//! Whether the motor overcomes the friction that the drive file declares.

use super::{Check, Design, Verdict};

/// Share of the motor's force that Coulomb friction may take before start-up cannot move the actuator: it
/// raises the current to half of its limit (`arso_core::direction_check`) and stops with `NoMotion`.
const START_UP: f64 = 0.5;
/// Share above which little is left to move the load with.
const MUCH: f64 = 1.0 / 3.0;

/// Coulomb friction over the motor's force.
pub(super) fn friction_share(design: &Design) -> Check {
    let actuator = &design.drive.actuator;
    let force = actuator.largest_force();
    let value = design.drive.friction.coulomb / force;
    let verdict = if value >= START_UP {
        Verdict::Refuse
    } else if value > MUCH {
        Verdict::Warn
    } else {
        Verdict::Pass
    };
    let unit = design.drive.kind.units().force;
    Check::new(
        "friction_share",
        verdict,
        (value, MUCH),
        format!(
            "share of the motor's force of {force:.4} {unit} that friction.coulomb takes; from one half on \
             start-up, which raises the current to half of its limit, does not move the actuator (fault 6, \
             NoMotion), from one on nothing does: a larger actuator.current_limit or less friction"
        ),
    )
}
