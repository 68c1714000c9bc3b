//! The columns of the telemetry, as every table and file names them: `name[unit]`.

use crate::machine::Units;
use arso_core::telemetry::{Column, Quantity};

/// Which mass a quantity belongs to, and the quantity.
#[must_use]
pub fn name(column: &Column) -> String {
    let name = column.name;
    match column.mass {
        None => name.into(),
        Some(0) => format!("actuator_{name}"),
        Some(load) => format!("load{load}_{name}"),
    }
}

/// Name and unit.
#[must_use]
pub fn title(units: &Units, column: &Column) -> String {
    let unit = match column.quantity {
        Quantity::Number => "1",
        Quantity::Current => "A",
        Quantity::Position => units.position,
        Quantity::Velocity => units.velocity,
        Quantity::Force => units.force,
    };
    format!("{}[{unit}]", name(column))
}
