//! The drive's log: from a defmt stream, or from text that another program decoded, to records.
//!
//! ```text
//! bytes --frames between zeros--> defmt-decoder (with the ELF) --text--> record | identity | message
//! ```
//!
//! A record is `record [b, b, …]`, the telemetry as the drive serialised it with a checksum, and is read with
//! the very type that wrote it. The drive says in the same way which drive it is. A frame that does not decode
//! is counted and skipped; the next zero byte is a new beginning. Gaps in the numbers of the control periods
//! are counted as lost records. Memory is bounded by what is kept: the records.
//!
//! Of a drive whose log nobody took there are its last moves, in its memory (`record`).

mod follow;
mod frames;
mod live;
mod origin;
mod parse;
mod record;

pub use follow::{Follower, Stretch};
pub use frames::read_defmt;
pub use live::Live;
pub use origin::Origin;
pub(crate) use origin::short;
pub use record::{LastMoves, RecordedMove, read_memory};

use crate::error::{Error, Result};
use crate::simulate::corridor::Record;
use parse::Line;
use std::io::{BufRead, BufReader, Read};

/// More missing control periods than this are no gap: a quarter of an hour at 1 kHz.
const LONGEST_GAP: u32 = 1_000_000;
/// A record that does not follow is believed when another one follows it as closely as this.
const CLOSE: u32 = 1000;

/// A log as far as it could be read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Capture {
    /// Control periods, in the order of the log.
    pub records: Vec<Record>,
    /// Where in `records` the drive began anew, having been reset.
    pub restarts: Vec<usize>,
    /// Every drive that the log says it is of: one, if it says so at all.
    pub origins: Vec<Origin>,
    /// Everything else, with its level.
    pub messages: Vec<String>,
    /// Bytes read.
    pub bytes: u64,
    /// Frames or lines that could not be decoded.
    pub malformed: u64,
    /// Control periods that are missing between the first and the last, resets apart.
    pub lost: u64,
    /// The drive said that it starts, and no record has come since.
    started: bool,
    /// A record that does not follow the one before: the first after a reset, or nonsense.
    doubtful: Option<Record>,
}

impl Capture {
    /// Takes a line; whether it is undamaged.
    fn take(&mut self, text: &str, message: &mut impl FnMut(&str)) -> bool {
        match parse::line(text) {
            Line::Record(record) => self.take_record(record),
            Line::Drive {
                origin,
                starts,
                words,
            } => {
                self.started |= starts && !self.records.is_empty();
                let new = !self.origins.contains(&origin);
                if new {
                    self.origins.push(origin);
                }
                if new || starts {
                    self.say(&format!("{words}: {origin}"), message);
                }
            }
            Line::Message(text) => self.say(text, message),
            Line::Empty => {}
            Line::Damaged => {
                self.malformed += 1;
                return false;
            }
        }
        true
    }

    fn say(&mut self, text: &str, message: &mut impl FnMut(&str)) {
        message(text);
        self.messages.push(text.to_owned());
    }

    fn take_record(&mut self, record: Record) {
        if self.records.is_empty() {
            self.records.push(record);
            return;
        }
        if std::mem::take(&mut self.started) {
            self.forget_doubtful();
            self.restart(record);
            return;
        }
        // A jump is believed once it has a successor: the drive's own words may have been lost.
        let last = self.records.last().and_then(|last| gap(last, &record));
        if let Some(gap) = last {
            self.forget_doubtful();
            self.lost += u64::from(gap);
            self.records.push(record);
            return;
        }
        let doubtful = self.doubtful.take();
        let close = doubtful.as_ref().and_then(|before| gap(before, &record));
        match (doubtful, close) {
            (Some(before), Some(gap)) if gap <= CLOSE => {
                self.restart(before);
                self.lost += u64::from(gap);
                self.records.push(record);
            }
            (before, _) => {
                self.malformed += u64::from(before.is_some());
                self.doubtful = Some(record);
            }
        }
    }

    fn restart(&mut self, record: Record) {
        self.restarts.push(self.records.len());
        self.records.push(record);
    }

    fn forget_doubtful(&mut self) {
        self.malformed += u64::from(self.doubtful.take().is_some());
    }

    /// Time of each record from the first one on, s. How long a reset took is not known: the drive goes on
    /// one control period later.
    #[must_use]
    pub fn times(&self, period: f64) -> Vec<f64> {
        let mut at = 0_u64;
        let mut restarts = self.restarts.iter().peekable();
        let mut before: Option<&Record> = None;
        let each = self.records.iter().enumerate().map(|(index, record)| {
            let reset = restarts.next_if(|restart| **restart == index).is_some();
            at += match before {
                None => 0,
                Some(_) if reset => 1,
                Some(before) => u64::from(record.period.wrapping_sub(before.period)),
            };
            before = Some(record);
            at as f64 * period
        });
        each.collect()
    }
}

/// Control periods that are missing between two records; nothing where the second does not follow.
fn gap(before: &Record, record: &Record) -> Option<u32> {
    let gap = record.period.wrapping_sub(before.period).checked_sub(1)?;
    (gap <= LONGEST_GAP).then_some(gap)
}

/// Reads text as `probe-rs run` and `probe-rs attach` print it: one message per line, decoded.
///
/// * `message`: called with everything that is no record, as it comes
///
/// # Errors
/// [`Error::Read`] when the stream cannot be read.
pub fn read_text(stream: impl Read, mut message: impl FnMut(&str)) -> Result<Capture> {
    let mut capture = Capture::default();
    let mut reader = BufReader::new(stream);
    loop {
        let mut line = Vec::new();
        // Bounded: an endless line is taken in pieces.
        let read = reader.by_ref().take(64 * 1024).read_until(b'\n', &mut line);
        let length = read.map_err(unreadable)?;
        if length == 0 {
            capture.forget_doubtful();
            return Ok(capture);
        }
        capture.bytes += length as u64;
        // Text has no control characters but those of white space and of colours.
        let binary = |character: &char| {
            character.is_control() && !character.is_whitespace() && *character != '\x1b'
        };
        match std::str::from_utf8(&line) {
            Ok(text) if !text.chars().any(|c| binary(&c)) => {
                capture.take(text, &mut message);
            }
            _ => capture.malformed += 1,
        }
    }
}

/// A stream that cannot be read.
fn unreadable(source: std::io::Error) -> Error {
    Error::read("the log")(source)
}

#[cfg(test)]
mod tests {
    use super::parse::tests::{example, logged, said};
    use super::*;
    use proptest::prelude::*;

    fn read(lines: &[String]) -> (Capture, Vec<String>) {
        let mut seen = Vec::new();
        let text = lines.join("\n");
        let capture = read_text(text.as_bytes(), |message| seen.push(message.to_owned())).unwrap();
        assert_eq!(capture.bytes, text.len() as u64);
        (capture, seen)
    }

    fn periods(capture: &Capture) -> Vec<u32> {
        capture.records.iter().map(|record| record.period).collect()
    }

    fn record(period: u32) -> String {
        logged(&example(period))
    }

    #[test]
    fn text_is_read_line_by_line_and_gaps_are_counted() {
        let lines = [
            record(7),
            "INFO running".into(),
            record(10),
            String::new(),
            "x record [8".into(),
        ];
        let (capture, seen) = read(&lines);
        assert_eq!(periods(&capture), [7, 10]);
        assert_eq!((capture.lost, capture.malformed), (2, 1));
        assert_eq!(seen, ["INFO running"]);
    }

    #[test]
    fn a_number_that_jumps_is_damage() {
        for jump in [3, 8, 8_000_000, u32::MAX] {
            let (capture, _) = read(&[7, 8, jump, 9, 12].map(record));
            assert_eq!(periods(&capture), [7, 8, 9, 12], "{jump}");
            assert_eq!((capture.lost, capture.malformed), (2, 1));
            assert!(capture.restarts.is_empty());
        }
        // At the end nothing speaks for it.
        let (capture, _) = read(&[7, 8, 1].map(record));
        assert_eq!((periods(&capture), capture.malformed), (vec![7, 8], 1));
        // The number wraps.
        let (capture, _) = read(&[u32::MAX - 1, 1].map(record));
        assert_eq!((capture.records.len(), capture.lost), (2, 2));
    }

    /// With the drive's words, or without them where two records agree.
    #[test]
    fn a_reset_is_a_new_beginning() {
        let start = said("drive ready: ", 1);
        let lines = [record(700), record(702), start, record(705), record(706)];
        let (capture, _) = read(&lines);
        assert_eq!((capture.lost, capture.malformed), (1, 0));
        assert_eq!(capture.restarts, [2]);
        assert_eq!(capture.times(0.5), [0.0, 1.0, 1.5, 2.0]);

        let (capture, _) = read(&[700, 701, 2, 5].map(record));
        assert_eq!(periods(&capture), [700, 701, 2, 5]);
        assert_eq!(
            (capture.restarts[0], capture.lost, capture.malformed),
            (2, 2, 0)
        );
        assert_eq!(capture.times(1.0), [0.0, 1.0, 2.0, 5.0]);
    }

    /// Once said is enough for the reader; another drive is another one.
    #[test]
    fn the_drive_says_which_it_is() {
        let again = said("drive: ", 1);
        let lines = [again.clone(), record(1), again, said("drive: ", 2)];
        let (capture, seen) = read(&lines);
        let fingerprints: Vec<u32> = capture.origins.iter().map(|o| o.fingerprint).collect();
        assert_eq!(fingerprints, [1, 2]);
        let named = |fingerprint| {
            format!(
                "INFO drive: rotary, 2 loads, control period 0.0005 s, fingerprint 0000000{fingerprint}"
            )
        };
        assert_eq!(seen, [1, 2].map(named));
        assert_eq!(
            capture.origins[0].differences(&capture.origins[1]),
            ["gains or other settings with fingerprint 00000001, not 00000002"]
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// Bytes flipped at random: no record that was not sent, and no more lost than were hit.
        #[test]
        fn damage_makes_no_record(hits in prop::collection::vec((any::<usize>(), 0..8), 0..200)) {
            let lines: Vec<String> = (100..600).map(record).collect();
            let mut text = lines.join("\n").into_bytes();
            for (at, bit) in &hits {
                let at = at % text.len();
                text[at] ^= 1_u8 << bit;
            }
            let capture = read_text(&text[..], |_| ()).unwrap();
            for record in &capture.records {
                prop_assert_eq!(record, &example(record.period));
            }
            prop_assert!(periods(&capture).is_sorted() && capture.restarts.is_empty());
            prop_assert!(capture.lost <= 2 * hits.len() as u64);
            prop_assert!(capture.records.len() + 2 * hits.len() >= 500);
        }
    }
}
