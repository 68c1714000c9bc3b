//! What a line of the log holds: a record, the drive's identity, or words.
//!
//! Records and identities end with a checksum (CRC-32, ISO-HDLC), so that a line with a flipped bit is a
//! damaged one and never another record.

use super::Origin;
use crate::design::plans::CHECKSUM;
use crate::simulate::corridor::Record;
use arso_core::Identity;
use serde::de::DeserializeOwned;

/// How a record begins, and an identity.
const RECORD: &str = "record [";
const IDENTITY: &str = ", identity [";
/// What the drive says when it starts.
const START: &str = "drive ready: ";

/// A line, understood.
#[derive(Debug, PartialEq)]
pub(super) enum Line<'a> {
    /// A control period.
    Record(Record),
    /// The drive says which it is.
    Drive {
        /// Which.
        origin: Origin,
        /// Whether it says so because it has just started.
        starts: bool,
        /// What the line begins with, level included.
        words: &'a str,
    },
    /// Words.
    Message(&'a str),
    /// Nothing.
    Empty,
    /// Bytes that are damaged.
    Damaged,
}

/// Understands a line.
pub(super) fn line(text: &str) -> Line<'_> {
    let text = text.trim();
    if let Some((_, list)) = text.split_once(RECORD) {
        return record(list).map_or(Line::Damaged, Line::Record);
    }
    if let Some((words, list)) = text.split_once(IDENTITY) {
        let origin = bytes(list).and_then(|bytes| {
            let digest = CHECKSUM.digest();
            let (identity, rest) =
                postcard::take_from_bytes_crc32::<Identity<'_>>(&bytes, digest).ok()?;
            let whole = rest.is_empty() && identity.sample_time > 0.0;
            Origin::said(&identity).filter(|_| whole)
        });
        let starts = words.contains(START);
        // What follows says in words what is in the bytes, and is not protected by the checksum.
        let words = words.split_once(": ").map_or(words, |(begin, _)| begin);
        return origin.map_or(Line::Damaged, |origin| Line::Drive {
            origin,
            starts,
            words,
        });
    }
    if text.is_empty() {
        Line::Empty
    } else {
        Line::Message(text)
    }
}

/// A record: all its bytes, and numbers that are finite.
fn record(list: &str) -> Option<Record> {
    let record: Record = checked(&bytes(list)?)?;
    let whole = record.load_position.len() == record.load_velocity.len();
    (whole && record.columns().all(|column| column.value.is_finite())).then_some(record)
}

/// The bytes up to the closing bracket.
fn bytes(list: &str) -> Option<Vec<u8>> {
    let (list, _) = list.split_once(']')?;
    list.split(',')
        .map(|byte| byte.trim().parse().ok())
        .collect()
}

/// What was serialised with its checksum, and nothing behind it.
fn checked<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    let (value, rest) = postcard::take_from_bytes_crc32(bytes, CHECKSUM.digest()).ok()?;
    rest.is_empty().then_some(value)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::machine::Kind;
    use arso_core::{Fault, Mode};
    use proptest::prelude::*;

    pub(in crate::capture) fn example(period: u32) -> Record {
        Record {
            period,
            mode: Mode::Fault(Fault::EncoderJump),
            count: 65535,
            applied_current: -0.001,
            command: 0.0,
            limited: true,
            position_set: false,
            reference: 0.0,
            position: 0.0,
            velocity: 0.0,
            load_position: vec![0.1, -2e-5],
            load_velocity: vec![0.0, 3.0],
            reaction_force: 0.0,
            disturbance: 0.0,
            disturbance_state: 0.0,
            fault_value: 0.5,
            cycles: 1180,
        }
    }

    /// As the drive logs it and the decoder prints it.
    pub(in crate::capture) fn logged(record: &Record) -> String {
        let mut buffer = [0; 128];
        let bytes = postcard::to_slice_crc32(record, &mut buffer, CHECKSUM.digest()).unwrap();
        format!("DEBUG record {bytes:?}")
    }

    /// The same for what a rotary drive of two loads says of itself.
    pub(in crate::capture) fn said(start: &str, fingerprint: u32) -> String {
        let identity = Identity {
            kind: "rotary",
            loads: 2,
            sample_time: 5e-4,
            fingerprint,
        };
        let mut buffer = [0; 32];
        let bytes = postcard::to_slice_crc32(&identity, &mut buffer, CHECKSUM.digest()).unwrap();
        format!("INFO {start}2 loads, identity {bytes:?}")
    }

    #[test]
    fn a_record_is_what_the_drive_serialised() {
        let record = example(7);
        assert_eq!(line(&logged(&record)), Line::Record(record.clone()));
        // What is cut, too long, or holds what is no number is none.
        let whole = logged(&record);
        let longer = whole.replace(']', ", 0]");
        let cut = whole[..whole.rfind(',').unwrap()].to_owned() + "]";
        let not_finite = logged(&Record {
            velocity: f32::NAN,
            ..record.clone()
        });
        let uneven = logged(&Record {
            load_velocity: vec![0.0],
            ..record
        });
        for text in [longer, cut, not_finite, uneven] {
            assert_eq!(line(&text), Line::Damaged, "{text}");
        }
    }

    #[test]
    fn an_identity_is_what_the_drive_said() {
        let origin = Origin {
            kind: Kind::Rotary,
            loads: 2,
            period: 5e-4,
            fingerprint: 0xABCD,
        };
        let start = said(START, 0xABCD);
        let Line::Drive {
            origin: found,
            starts,
            words,
        } = line(&start)
        else {
            panic!("{start}");
        };
        assert_eq!((found, starts), (origin, true));
        assert_eq!(words, "INFO drive ready");
        let again = said("drive: ", 0xABCD);
        assert!(matches!(line(&again), Line::Drive { starts: false, .. }));
        assert_eq!(line(&start.replace('[', "[1, ")), Line::Damaged);
    }

    proptest! {
        #[test]
        fn any_text_is_taken(text in ".{0,200}", cut in 0..150_usize) {
            line(&text);
            let whole = logged(&example(7));
            let begin = format!("{}{text}", &whole[..cut.min(whole.len())]);
            line(&begin);
        }

        /// One bit of one byte, and no wrong record comes of it.
        #[test]
        fn a_flipped_bit_is_no_other_record(at in 0..1000_usize, bit in 0..8) {
            let whole = logged(&example(7));
            let mut damaged = whole.clone().into_bytes();
            let at = at % damaged.len();
            damaged[at] ^= 1_u8 << bit;
            if let Line::Record(found) = line(&String::from_utf8_lossy(&damaged)) {
                prop_assert_eq!(found, example(7));
            }
        }
    }
}
