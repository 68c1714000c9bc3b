//! The drive file with identified values in it: everything else, comments included, stays as it was.

use super::{Identified, Quantity};
use crate::drive::edit::{remove, set};
use crate::error::{Error, Result};
use toml_edit::{DocumentMut, Item, Table};

/// The text of a drive file with the identified quantities replaced.
///
/// * `text`: the file they were identified with
///
/// # Errors
/// [`Error::Identification`] when the text is no drive file.
pub fn drive_file(text: &str, quantities: &[Identified]) -> Result<String> {
    let mut document: DocumentMut = text.parse().map_err(|error| {
        Error::Identification(format!("the drive file cannot be rewritten: {error}"))
    })?;
    for identified in quantities.iter().filter(|identified| !identified.held) {
        // Seven figures say all there is, and are short to read.
        let number: f64 = format!("{:.6e}", identified.value)
            .parse()
            .unwrap_or(identified.value);
        match identified.quantity {
            Quantity::ActuatorMass => {
                set(&mut document["actuator"], "mass", number);
                remove(&mut document["actuator"], "mass_deviation");
            }
            Quantity::ForceConstant => {
                set(&mut document["actuator"], "force_constant", number);
                remove(&mut document["actuator"], "force_constant_deviation");
            }
            Quantity::Mass(load) => set(&mut document["load"][load], "mass", number),
            Quantity::Stiffness(load) => set(&mut document["load"][load], "stiffness", number),
            Quantity::Damping(load) => set(&mut document["load"][load], "damping", number),
            Quantity::Viscous => set(friction(&mut document), "viscous", number),
            Quantity::Coulomb => set(friction(&mut document), "coulomb", number),
            Quantity::CoulombBackward => set(friction(&mut document), "coulomb_backward", number),
            Quantity::Static => set(friction(&mut document), "static", number),
            Quantity::LoadViscous(load) => set(&mut document["load"][load], "viscous", number),
            Quantity::LoadCoulomb(load) => set(&mut document["load"][load], "coulomb", number),
            Quantity::Delay => set(&mut document["actuator"], "delay", number),
            Quantity::Lag => set(&mut document["actuator"], "lag", number),
            Quantity::HoldingForce => set(&mut document["actuator"], "holding_force", number),
            // No drive file has them.
            Quantity::Backlash(_) | Quantity::Ripple(_) => (),
        }
    }
    Ok(document.to_string())
}

fn friction(document: &mut DocumentMut) -> &mut Item {
    document
        .entry("friction")
        .or_insert(Item::Table(Table::new()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{DEFAULT_DRIVE, Drive};

    #[test]
    fn values_are_replaced_and_comments_stay() {
        let identified = |quantity, value, held| Identified {
            quantity,
            value,
            std: 0.0,
            held,
            known: true,
            before: 0.0,
        };
        let text = drive_file(
            DEFAULT_DRIVE,
            &[
                identified(Quantity::ActuatorMass, 0.060_123_456_789, false),
                identified(Quantity::ForceConstant, 9.0, true),
                identified(Quantity::Stiffness(2), 280.5, false),
                identified(Quantity::Coulomb, 0.2, false),
                identified(Quantity::Viscous, 0.0, false),
            ],
        )
        .unwrap();
        assert!(
            text.contains("mass = 0.06012346               # kg"),
            "{text}"
        );
        let drive = Drive::parse(&text, "identified").unwrap();
        assert_eq!(drive.actuator.force_constant, 6.43);
        let stiffness: Vec<f64> = drive.loads.iter().map(|load| load.stiffness).collect();
        assert_eq!(stiffness, [300.0, 300.0, 280.5]);
        assert_eq!((drive.friction.coulomb, drive.friction.viscous), (0.2, 0.0));
    }
}
