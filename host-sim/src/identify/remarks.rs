//! What should be said of a machine beside its figures, in words.

use super::parameters::RippleKind;
use super::{Identified, Machine, Quantity};
use crate::machine::Units;
use crate::output::significant;

/// Factors that are a mistake of units, and which.
const MISTAKES: [(f64, &str); 6] = [
    (std::f64::consts::TAU, "turns for radians"),
    (57.296, "degrees for radians"),
    (4.0, "lines for counts after x4 decoding"),
    (10.0, "a factor of ten"),
    (1000.0, "millimetres for metres"),
    (9.81, "kilograms for newtons"),
];

/// One factor by which all masses and springs are off, in words.
pub(super) fn common_factor(quantities: &[Identified]) -> Option<String> {
    let ratios: Vec<f64> = quantities
        .iter()
        .filter(|q| q.known && !q.held)
        .filter(|q| {
            matches!(
                q.quantity,
                Quantity::ActuatorMass | Quantity::Mass(_) | Quantity::Stiffness(_)
            )
        })
        .map(|q| (q.value / q.before).ln())
        .collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    let alike = ratios.len() >= 3 && ratios.iter().all(|ratio| (ratio - mean).abs() < ALIKE);
    if !alike || mean.abs() < FACTOR.ln() {
        return None;
    }
    let factor = mean.exp();
    let likely = MISTAKES
        .iter()
        .find(|(mistake, _)| (mean.abs() - mistake.ln()).abs() < 0.5 * ALIKE)
        .map_or_else(String::new, |(_, what)| format!(" ({what}?)"));
    Some(format!(
        "all masses and springs are about {} times those of the drive file: look at encoder.resolution and \
         actuator.force_constant{likely}",
        significant(factor, 3)
    ))
}

/// How far logarithms of ratios may be apart to be one factor, and the least factor that is none of wear.
const ALIKE: f64 = 0.35;
const FACTOR: f64 = 2.0;

/// What goes with the position, in words.
pub(super) fn ripple(machine: &Machine, units: &Units) -> String {
    let Some(ripple) = machine.ripple else {
        return String::new();
    };
    let every = format!(
        "every {} {}",
        significant(1e3 * ripple.pitch, 3),
        units.milli_position
    );
    match ripple.kind {
        RippleKind::Cogging => format!(
            "a force of {} {} repeats itself {every} (cogging): it is taken out of what is identified",
            significant(ripple.amplitude(), 3),
            units.force,
        ),
        RippleKind::Eccentricity => format!(
            "the encoder errs by {} {} and repeats that {every} (off its axis, or a scale of its own): it is \
             taken out of what is identified",
            significant(1e6 * ripple.amplitude(), 3),
            units.micro_position,
        ),
    }
}
