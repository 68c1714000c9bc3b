//! One record per control period: what was measured, estimated and commanded.
//!
//! One type from the interrupt to the CSV file: the drive keeps the loads in arrays ([`Telemetry`] of
//! `[f32; N]`), the PC in vectors, and both have the same serialised form, which is what the log holds.
//! [`Telemetry::columns`] is the one list of what there is, by name, quantity and order.

use crate::mode::Mode;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize, Serializer};

/// Record of one control period; `L` holds a value for each load mass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[serde(bound(serialize = "L: AsRef<[f32]>", deserialize = "L: Deserialize<'de>"))]
pub struct Telemetry<L> {
    /// Number of the control period; wraps.
    pub period: u32,
    /// What the drive does after it.
    pub mode: Mode,
    /// Encoder counter as read.
    pub count: u32,
    /// Current applied over the period before, A.
    pub applied_current: f32,
    /// Commanded current, A.
    pub command: f32,
    /// Whether the current limit acted.
    pub limited: bool,
    /// Whether zero is known: the position has been set since the reset. If not, positions count from where
    /// the encoder's counter began.
    pub position_set: bool,
    /// Reference position, m.
    pub reference: f32,
    /// Position of the actuator, `x_a`, m; `f32`, and so to 1 part in 2²⁴ of the distance from zero, which the
    /// control knows exactly.
    pub position: f32,
    /// Velocity of the actuator, `v_a`, m/s.
    pub velocity: f32,
    /// Estimated position of each load, `x_i`, m.
    #[serde(serialize_with = "as_slice")]
    pub load_position: L,
    /// Estimated velocity of each load, `v_i`, m/s.
    #[serde(serialize_with = "as_slice")]
    pub load_velocity: L,
    /// Reaction force of (18), N.
    pub reaction_force: f32,
    /// Disturbance `d_hat` of (19), N.
    pub disturbance: f32,
    /// Disturbance on the actuator as the state observer sees it, `d`, N.
    pub disturbance_state: f32,
    /// Value that tripped the fault, in the unit of its limit; zero without a fault.
    pub fault_value: f32,
    /// Processor cycles of the control interrupt, filled in by the firmware; zero elsewhere.
    pub cycles: u32,
}

/// Which drive a log is of: said at the start and with every summary, so that no reader of a log has to
/// be told.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity<'a> {
    /// `"linear"` or `"rotary"`: the units of all that is logged.
    pub kind: &'a str,
    /// Number of load masses.
    pub loads: u8,
    /// Control period, s.
    pub sample_time: f32,
    /// CRC-32 (ISO-HDLC) of the settings as postcard serialises them.
    pub fingerprint: u32,
}

/// What a column of the telemetry counts in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A plain number.
    Number,
    /// A.
    Current,
    /// m, or rad.
    Position,
    /// m/s, or rad/s.
    Velocity,
    /// N, or N m.
    Force,
}

/// One column of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Which mass it belongs to: 0 for the actuator, 1 for the first load, …; none for the drive.
    pub mass: Option<usize>,
    /// What it is.
    pub name: &'static str,
    /// What it counts in.
    pub quantity: Quantity,
    /// Whether it means something only while the loop is closed.
    pub closed_loop: bool,
    /// The value, SI; truth is 1.
    pub value: f64,
}

impl<const N: usize> Default for Telemetry<[f32; N]> {
    fn default() -> Self {
        Self {
            period: 0,
            mode: Mode::Idle,
            count: 0,
            applied_current: 0.0,
            command: 0.0,
            limited: false,
            position_set: false,
            reference: 0.0,
            position: 0.0,
            velocity: 0.0,
            load_position: [0.0; N],
            load_velocity: [0.0; N],
            reaction_force: 0.0,
            disturbance: 0.0,
            disturbance_state: 0.0,
            fault_value: 0.0,
            cycles: 0,
        }
    }
}

impl<const N: usize> Telemetry<[f32; N]> {
    /// Nothing is estimated and nothing followed while the loop is open: zero, not what was last.
    pub(crate) fn forget_estimates(&mut self) {
        *self = Self {
            period: self.period,
            mode: self.mode,
            count: self.count,
            applied_current: self.applied_current,
            position_set: self.position_set,
            position: self.position,
            fault_value: self.fault_value,
            command: self.command,
            limited: self.limited,
            ..Self::default()
        };
    }
}

impl<L> Telemetry<L> {
    /// The same record with its loads in another container.
    #[must_use]
    pub fn map<M>(&self, loads: impl Fn(&L) -> M) -> Telemetry<M> {
        Telemetry {
            period: self.period,
            mode: self.mode,
            count: self.count,
            applied_current: self.applied_current,
            command: self.command,
            limited: self.limited,
            position_set: self.position_set,
            reference: self.reference,
            position: self.position,
            velocity: self.velocity,
            load_position: loads(&self.load_position),
            load_velocity: loads(&self.load_velocity),
            reaction_force: self.reaction_force,
            disturbance: self.disturbance,
            disturbance_state: self.disturbance_state,
            fault_value: self.fault_value,
            cycles: self.cycles,
        }
    }
}

impl<L: AsRef<[f32]>> Telemetry<L> {
    /// Everything but number and mode of the period, in the order of the files.
    pub fn columns(&self) -> impl Iterator<Item = Column> {
        use Quantity::{Current, Force, Number, Position, Velocity};
        let column = |mass, name, quantity, closed_loop, value| Column {
            mass,
            name,
            quantity,
            closed_loop,
            value,
        };
        let drive = move |name, quantity, value| column(None, name, quantity, false, value);
        let found = move |mass, name, quantity, value: f32| {
            column(mass, name, quantity, true, f64::from(value))
        };
        let before = [
            drive("count", Number, f64::from(self.count)),
            drive("applied_current", Current, f64::from(self.applied_current)),
            drive("command", Current, f64::from(self.command)),
            drive("limited", Number, f64::from(u8::from(self.limited))),
            drive(
                "position_set",
                Number,
                f64::from(u8::from(self.position_set)),
            ),
            found(None, "reference", Position, self.reference),
            column(
                Some(0),
                "position",
                Position,
                false,
                f64::from(self.position),
            ),
            found(Some(0), "velocity", Velocity, self.velocity),
        ];
        let loads = self.load_position.as_ref().iter();
        let loads = loads.zip(self.load_velocity.as_ref()).zip(1..);
        let loads = loads.flat_map(move |((position, velocity), mass)| {
            [
                found(Some(mass), "position", Position, *position),
                found(Some(mass), "velocity", Velocity, *velocity),
            ]
        });
        let after = [
            found(None, "reaction_force", Force, self.reaction_force),
            found(None, "disturbance", Force, self.disturbance),
            found(None, "disturbance_state", Force, self.disturbance_state),
            drive("fault_value", Number, f64::from(self.fault_value)),
            drive("cycles", Number, f64::from(self.cycles)),
        ];
        before.into_iter().chain(loads).chain(after)
    }
}

fn as_slice<L: AsRef<[f32]>, S: Serializer>(values: &L, serializer: S) -> Result<S::Ok, S::Error> {
    values.as_ref().serialize(serializer)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::fault::Fault;
    use std::vec::Vec;

    /// What the drive serialises is what the PC reads, to the last bit.
    #[test]
    fn arrays_on_the_drive_are_vectors_on_the_pc() {
        let record = Telemetry {
            period: 123_456,
            mode: Mode::Fault(Fault::Travel),
            count: 0xFFFF,
            applied_current: -0.1,
            load_position: [0.1, f32::MIN_POSITIVE, -3.0],
            load_velocity: [1e30, 0.5, 1.0 / 3.0],
            limited: true,
            ..Telemetry::default()
        };
        let mut buffer = [0; 128];
        let bytes = postcard::to_slice(&record, &mut buffer).unwrap();
        let read: Telemetry<Vec<f32>> = postcard::from_bytes(bytes).unwrap();
        assert!(read.columns().eq(record.columns()));
        assert_eq!((read.period, read.mode), (record.period, record.mode));
        assert!(postcard::from_bytes::<Telemetry<Vec<f32>>>(&bytes[..bytes.len() - 1]).is_err());
    }

    /// Every field is a column: a record whose fields all differ has as many values.
    #[test]
    fn no_column_is_missing() {
        let record = Telemetry {
            period: 0,
            mode: Mode::Running,
            count: 1,
            applied_current: 2.0,
            command: 3.0,
            limited: false,
            position_set: true,
            reference: 4.0,
            position: 5.0,
            velocity: 6.0,
            load_position: [7.0, 9.0],
            load_velocity: [8.0, 10.0],
            reaction_force: 11.0,
            disturbance: 12.0,
            disturbance_state: 13.0,
            fault_value: 14.0,
            cycles: 15,
        };
        let values: Vec<f64> = record.columns().map(|column| column.value).collect();
        let expected: Vec<f64> = (1..=3).chain([0, 1]).chain(4..=15).map(f64::from).collect();
        assert_eq!(values, expected);
    }
}
