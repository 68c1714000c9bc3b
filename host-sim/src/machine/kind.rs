//! Linear or rotary: the same equations, other units.

use serde::Serialize;

/// What kind of motion a drive makes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Masses in kg that move by metres.
    #[default]
    Linear,
    /// Moments of inertia in kg m² that turn by radians.
    Rotary,
}

/// The units that a kind's numbers are in, as messages, tables, CSV headers and plots name them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Units {
    /// Of a mass.
    pub mass: &'static str,
    /// Of a position.
    pub position: &'static str,
    /// A thousandth of that, for tables and plots.
    pub milli_position: &'static str,
    /// A millionth of that.
    pub micro_position: &'static str,
    /// Of a velocity.
    pub velocity: &'static str,
    /// Of an acceleration.
    pub acceleration: &'static str,
    /// Of a jerk.
    pub jerk: &'static str,
    /// Of a force.
    pub force: &'static str,
    /// Of a force constant.
    pub force_constant: &'static str,
    /// Of a stiffness.
    pub stiffness: &'static str,
    /// Of a damping, and of viscous friction.
    pub damping: &'static str,
    /// Of a position gain.
    pub position_gain: &'static str,
    /// Of a velocity gain.
    pub velocity_gain: &'static str,
    /// Of a weight of squared positions.
    pub position_weight: &'static str,
    /// Of a weight of squared velocities.
    pub velocity_weight: &'static str,
}

const LINEAR: Units = Units {
    mass: "kg",
    position: "m",
    milli_position: "mm",
    micro_position: "um",
    velocity: "m/s",
    acceleration: "m/s^2",
    jerk: "m/s^3",
    force: "N",
    force_constant: "N/A",
    stiffness: "N/m",
    damping: "N s/m",
    position_gain: "A/m",
    velocity_gain: "A s/m",
    position_weight: "1/m^2",
    velocity_weight: "s^2/m^2",
};

const ROTARY: Units = Units {
    mass: "kg m^2",
    position: "rad",
    milli_position: "mrad",
    micro_position: "urad",
    velocity: "rad/s",
    acceleration: "rad/s^2",
    jerk: "rad/s^3",
    force: "N m",
    force_constant: "N m/A",
    stiffness: "N m/rad",
    damping: "N m s/rad",
    position_gain: "A/rad",
    velocity_gain: "A s/rad",
    position_weight: "1/rad^2",
    velocity_weight: "s^2/rad^2",
};

impl Kind {
    /// The kind of this name, if there is one.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let kinds = [Kind::Linear, Kind::Rotary];
        kinds.into_iter().find(|kind| kind.name() == name)
    }

    /// The units of this kind.
    #[must_use]
    pub const fn units(self) -> &'static Units {
        match self {
            Kind::Linear => &LINEAR,
            Kind::Rotary => &ROTARY,
        }
    }

    /// The kind's name in drive files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Kind::Linear => "linear",
            Kind::Rotary => "rotary",
        }
    }
}
