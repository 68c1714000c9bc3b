//! Telemetry as an MCAP file (<https://mcap.dev>), which `Foxglove` and `PlotJuggler` open.
//!
//! One channel, `/telemetry`, with a JSON object for each record, and a JSON schema that has the units. The time of
//! a record is its control period by the drive's clock, from the drive's reset on. The metadata `drive` says which
//! drive it was.

use super::columns;
use crate::capture::{Origin, short};
use crate::link::{mode_name, passed};
use crate::simulate::corridor::Record;
use arso_core::Fault;
use arso_core::telemetry::Column;
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

/// Topic of the telemetry.
pub const TOPIC: &str = "/telemetry";
/// Name of the metadata that say which drive it was.
pub const DRIVE: &str = "drive";

/// A file that is being written; without [`finish`](Self::finish) it has no index.
pub struct Recording<W: Write + Seek> {
    writer: Writer<W>,
    channel: u16,
    /// Control period, ns.
    period: f64,
    /// Control periods from the drive's reset on, as far as known, and the number of the last one.
    periods: u64,
    last: u32,
    records: u32,
}

impl<W: Write + Seek> Recording<W> {
    /// Begins with schema and metadata for records of which this is the first.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn new(into: W, origin: &Origin, first: &Record) -> io::Result<Self> {
        let options = WriteOptions::new().library(concat!("host-sim ", env!("CARGO_PKG_VERSION")));
        let begin = || -> mcap::McapResult<_> {
            let mut writer = options.create(into)?;
            let schema = schema(origin, first).to_string();
            let schema = writer.add_schema("Telemetry", "jsonschema", schema.as_bytes())?;
            let channel = writer.add_channel(schema, TOPIC, "json", &BTreeMap::new())?;
            writer.write_metadata(&Metadata {
                name: DRIVE.into(),
                metadata: identity(origin),
            })?;
            Ok((writer, channel))
        };
        let (writer, channel) = begin().map_err(plain)?;
        Ok(Self {
            writer,
            channel,
            period: origin.period * 1e9,
            periods: first.period.into(),
            last: first.period,
            records: 0,
        })
    }

    /// Adds a record.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, record: &Record) -> io::Result<()> {
        // The time of a drive that was reset goes on.
        self.periods += u64::from(passed(self.last, record.period).unwrap_or(1));
        self.last = record.period;
        let time = (self.periods as f64 * self.period).round() as u64;
        let header = MessageHeader {
            channel_id: self.channel,
            sequence: self.records,
            log_time: time,
            publish_time: time,
        };
        self.records = self.records.wrapping_add(1);
        let text = message(record).to_string();
        let written = self.writer.write_to_known_channel(&header, text.as_bytes());
        written.map_err(plain)
    }

    /// Writes the index, and gives back what it was written into.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(mut self) -> io::Result<W> {
        self.writer.finish().map_err(plain)?;
        Ok(self.writer.into_inner())
    }
}

/// What the system said.
fn plain(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Which drive it was, in words.
fn identity(origin: &Origin) -> BTreeMap<String, String> {
    let pairs = [
        ("kind", origin.kind.name().to_owned()),
        ("loads", origin.loads.to_string()),
        ("fingerprint", format!("{:08x}", origin.fingerprint)),
        ("sample_time", origin.period.to_string()),
    ];
    let pairs = pairs.map(|(key, value)| (key.to_owned(), value));
    pairs.into()
}

/// Name of a column in a message, that of the record's field, and whether it has a value for each load.
fn field(column: &Column) -> (String, bool) {
    match column.mass {
        None | Some(0) => (column.name.to_owned(), false),
        Some(_) => (format!("load_{}", column.name), true),
    }
}

/// In as few figures as read back to the same number; nothing for what is no number.
fn number(value: f64) -> Value {
    let few = short(value as f32);
    let same = f64::from(few as f32) == value;
    json!(if same { few } else { value })
}

/// A record as JSON, SI units.
fn message(record: &Record) -> Value {
    let fault = record.mode.fault().map_or(0, Fault::number);
    let mut fields = Map::new();
    fields.insert("period".into(), json!(record.period));
    fields.insert("mode".into(), json!(mode_name(record.mode)));
    fields.insert("fault".into(), json!(fault));
    for column in record.columns() {
        let (name, of_load) = field(&column);
        let value = number(column.value);
        if of_load {
            let loads = fields.entry(name).or_insert_with(|| json!([]));
            if let Value::Array(loads) = loads {
                loads.push(value);
            }
        } else {
            fields.insert(name, value);
        }
    }
    Value::Object(fields)
}

/// Of the messages.
fn schema(origin: &Origin, record: &Record) -> Value {
    let number = |title: &str| json!({ "type": "number", "description": title });
    let mut fields = Map::new();
    fields.insert("period".into(), number("number of the control period"));
    let mode = json!({ "type": "string", "description": "what the drive does" });
    fields.insert("mode".into(), mode);
    fields.insert(
        "fault".into(),
        number("number of the fault, 0 without a fault"),
    );
    for column in record.columns() {
        let (name, of_load) = field(&column);
        let title = columns::title(origin.kind.units(), &column);
        let one = if of_load {
            let title = title.replacen("load1_", "", 1);
            let each = format!("{title} of each load, the first next to the actuator");
            json!({ "type": "array", "items": { "type": "number" }, "description": each })
        } else {
            number(&title)
        };
        fields.entry(name).or_insert(one);
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Telemetry",
        "description": "one control period of the drive",
        "type": "object",
        "properties": fields,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Kind;
    use arso_core::{Mode, Telemetry};
    use mcap::{MessageStream, Summary};
    use std::io::Cursor;

    const ORIGIN: Origin = Origin {
        kind: Kind::Linear,
        loads: 2,
        period: 5e-4,
        fingerprint: 0xAB,
    };

    fn record(period: u32) -> Record {
        let x = period as f32;
        Telemetry {
            period,
            mode: Mode::Running,
            count: u32::MAX - period,
            applied_current: x.sin() / 3.0,
            command: -x.cos() * 7.0,
            limited: period.is_multiple_of(2),
            position_set: true,
            reference: f32::MIN_POSITIVE * (1.0 + x),
            position: 1e-7 / (x + 1.0),
            velocity: 1e30,
            load_position: vec![x.sqrt(), -0.1],
            load_velocity: vec![0.3, x.exp()],
            reaction_force: 16_777_217.0,
            disturbance: f32::EPSILON,
            disturbance_state: -0.0,
            fault_value: 0.7,
            cycles: 12_345,
        }
    }

    fn recorded(records: &[Record]) -> Vec<u8> {
        let mut recording = Recording::new(Cursor::new(Vec::new()), &ORIGIN, &records[0]).unwrap();
        for record in records {
            recording.add(record).unwrap();
        }
        recording.finish().unwrap().into_inner()
    }

    /// The messages, with their times, ns.
    fn read(file: &[u8]) -> Vec<(u64, Value)> {
        let messages = MessageStream::new(file).unwrap();
        let messages = messages.map(|message| {
            let message = message.unwrap();
            assert_eq!(message.channel.topic, TOPIC);
            assert_eq!(message.channel.message_encoding, "json");
            assert_eq!(message.log_time, message.publish_time);
            let value = serde_json::from_slice(&message.data).unwrap();
            (message.log_time, value)
        });
        messages.collect()
    }

    #[test]
    fn every_value_is_read_back_to_its_last_bit() {
        let records: Vec<Record> = (0..60).map(record).collect();
        let read = read(&recorded(&records));
        assert_eq!(read.len(), records.len());
        for ((time, value), record) in read.iter().zip(&records) {
            assert_eq!(*time, u64::from(record.period) * 500_000);
            assert_eq!(value["period"], record.period);
            assert_eq!(value["mode"], "running");
            let mut fields = 3;
            for column in record.columns() {
                let found = match column.mass {
                    None | Some(0) => value[column.name].as_f64(),
                    Some(load) => value[format!("load_{}", column.name)][load - 1].as_f64(),
                };
                let found = found.unwrap();
                fields += usize::from(column.mass.is_none_or(|mass| mass < 2));
                if column.name == "count" {
                    assert_eq!(found, column.value);
                } else {
                    let expected = (column.value as f32).to_bits();
                    assert_eq!((found as f32).to_bits(), expected, "{column:?}");
                }
            }
            assert_eq!(value.as_object().unwrap().len(), fields);
        }
        // As people would write them.
        assert_eq!(read[0].1["fault_value"].to_string(), "0.7");
    }

    #[test]
    fn the_file_says_what_it_is() {
        let first = record(3);
        let file = recorded(&[first.clone(), record(4)]);
        let summary = Summary::read(&file).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().message_count, 2);
        let schema = summary.schemas.values().next().unwrap();
        assert_eq!(schema.encoding, "jsonschema");
        let schema: Value = serde_json::from_slice(&schema.data).unwrap();
        let message = message(&first);
        let (described, found) = (&schema["properties"], message.as_object().unwrap());
        assert_eq!(described.as_object().unwrap().len(), found.len());
        for (name, value) in found {
            let expected = match value {
                Value::Array(_) => "array",
                Value::String(_) => "string",
                _ => "number",
            };
            assert_eq!(described[name]["type"], expected, "{name}");
        }
        assert_eq!(described["position"]["description"], "actuator_position[m]");
        let metadata = mcap::read::metadata(&file, &summary.metadata_indexes[0]).unwrap();
        assert_eq!(metadata.name, DRIVE);
        let expected = [
            ("fingerprint", "000000ab"),
            ("kind", "linear"),
            ("loads", "2"),
            ("sample_time", "0.0005"),
        ];
        let found = metadata.metadata.iter();
        assert!(
            found.eq(expected
                .map(|(a, b)| (a.to_owned(), b.to_owned()))
                .iter()
                .map(|(a, b)| (a, b)))
        );
    }

    #[test]
    fn time_goes_on_where_the_number_of_the_period_wraps() {
        let mut records = [u32::MAX - 1, u32::MAX, 0, 5].map(record);
        records[3].mode = Mode::Fault(Fault::Travel);
        let read = read(&recorded(&records));
        let begin = (u64::from(u32::MAX) - 1) * 500_000;
        let times: Vec<u64> = read.iter().map(|(time, _)| time - begin).collect();
        assert_eq!(times, [0, 500_000, 1_000_000, 3_500_000]);
        assert_eq!(read[3].1["mode"], "stopped by a fault");
        assert_eq!(read[3].1["fault"], 8);
    }

    #[test]
    fn what_is_no_number_is_nothing() {
        let mut odd = record(1);
        odd.command = f32::NAN;
        odd.load_position[1] = f32::INFINITY;
        let read = read(&recorded(&[odd]));
        assert_eq!(read[0].1["command"], Value::Null);
        assert_eq!(read[0].1["load_position"][1], Value::Null);
    }
}
