//! The drive's log: from a defmt stream, or from text that another program decoded, to records.
//!
//! ```text
//! bytes --frames between zeros--> defmt-decoder (with the ELF) --text--> record | message
//! ```
//!
//! A record is `record [b, b, …]`, the telemetry as the drive serialised it, and is read with the very
//! type that wrote it. A frame that does not decode is counted and skipped; the next zero byte is a new
//! beginning. Gaps in the numbers of the control periods are counted as lost records. Memory is bounded
//! by what is kept: the records.

use crate::error::{Error, Result};
use crate::simulate::corridor::Record;
use defmt_decoder::{DecodeError, Table};
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Longer frames are no frames of ours.
const LONGEST_FRAME: usize = 4096;

/// A log as far as it could be read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Capture {
    /// Control periods.
    pub records: Vec<Record>,
    /// Everything else, with its level.
    pub messages: Vec<String>,
    /// Bytes read.
    pub bytes: u64,
    /// Frames or lines that could not be decoded.
    pub malformed: u64,
    /// Control periods that are missing between the first and the last.
    pub lost: u64,
}

impl Capture {
    fn take(&mut self, text: &str) {
        if let Some(record) = parse_record(text) {
            if let Some(last) = self.records.last() {
                // A drive that was reset starts again at small numbers.
                let gap = record.period.wrapping_sub(last.period).wrapping_sub(1);
                if gap < u32::MAX / 2 {
                    self.lost += u64::from(gap);
                }
            }
            self.records.push(record);
        } else if !text.trim().is_empty() {
            self.messages.push(text.trim().to_owned());
        }
    }
}

/// Reads a raw defmt stream to its end.
///
/// * `elf`: the very firmware that logged
/// * `message`: called with everything that is no record, as it comes
///
/// # Errors
/// [`Error::Input`] when the ELF has no log table or nothing in the stream fits it;
/// [`Error::Read`] when the stream cannot be read.
pub fn read_defmt(
    elf: &[u8],
    name: &str,
    mut stream: impl Read,
    mut message: impl FnMut(&str),
) -> Result<Capture> {
    let input = |message: String| Error::Input {
        place: name.into(),
        message,
    };
    let table = catch_unwind(|| Table::parse(elf))
        .map_err(|_| input("not an ELF with a defmt log".into()))?
        .map_err(|error| input(format!("not an ELF with a defmt log: {error}")))?
        .ok_or_else(|| input("this ELF has no defmt log".into()))?;

    let mut capture = Capture::default();
    let mut frame = Vec::new();
    let mut decoded = 0_u64;
    let mut overlong = false;
    let mut buffer = [0; 16 * 1024];
    loop {
        let length = match stream.read(&mut buffer) {
            Ok(0) => break,
            Ok(length) => length,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(source) => {
                return Err(Error::Read {
                    path: "the log".into(),
                    source,
                });
            }
        };
        capture.bytes += length as u64;
        for byte in &buffer[..length] {
            if *byte != 0 {
                overlong |= frame.len() >= LONGEST_FRAME;
                if !overlong {
                    frame.push(*byte);
                }
                continue;
            }
            if overlong {
                capture.malformed += 1;
            } else if !frame.is_empty() {
                match decode(&table, &frame) {
                    Some(text) => {
                        decoded += 1;
                        let messages = capture.messages.len();
                        capture.take(&text);
                        if let Some(new) = capture.messages.get(messages) {
                            message(new);
                        }
                    }
                    None => capture.malformed += 1,
                }
            }
            frame.clear();
            overlong = false;
        }
    }
    // What is left has no end: cut off.
    capture.malformed += u64::from(overlong || !frame.is_empty());
    if decoded == 0 && capture.bytes > 0 {
        return Err(input(format!(
            "none of the {} bytes of the log fits this ELF: it must be the one that logged",
            capture.bytes
        )));
    }
    Ok(capture)
}

/// One frame as text with its level, nothing when it is damaged.
fn decode(table: &Table, frame: &[u8]) -> Option<String> {
    // A damaged frame can name any format with any arguments, and the decoder was not made for
    // that: what it cannot take may end in a panic inside of it, which is a damaged frame too.
    let decode = || {
        let mut decoder = table.new_stream_decoder();
        decoder.received(frame);
        decoder.received(&[0]);
        match decoder.decode() {
            Ok(frame) => {
                let level = frame.level().map_or("", |level| level.as_str());
                Some(format!(
                    "{} {}",
                    level.to_uppercase(),
                    frame.display_message()
                ))
            }
            Err(DecodeError::UnexpectedEof | DecodeError::Malformed) => None,
        }
    };
    catch_unwind(AssertUnwindSafe(decode)).ok().flatten()
}

/// Reads text as `probe-rs run` and `probe-rs attach` print it: one message per line, decoded.
///
/// # Errors
/// [`Error::Read`] when the stream cannot be read.
pub fn read_text(stream: impl Read, mut message: impl FnMut(&str)) -> Result<Capture> {
    use std::io::{BufRead, BufReader};
    let mut capture = Capture::default();
    let mut reader = BufReader::new(stream);
    loop {
        let mut line = Vec::new();
        // Bounded: an endless line is taken in pieces.
        let read = reader.by_ref().take(64 * 1024).read_until(b'\n', &mut line);
        let length = read.map_err(|source| Error::Read {
            path: "the log".into(),
            source,
        })?;
        if length == 0 {
            return Ok(capture);
        }
        capture.bytes += length as u64;
        let line = String::from_utf8_lossy(&line);
        let messages = capture.messages.len();
        let broken = line.contains(RECORD) && parse_record(&line).is_none();
        if broken {
            capture.malformed += 1;
        } else {
            capture.take(&line);
        }
        if let Some(new) = capture.messages.get(messages) {
            message(new);
        }
    }
}

/// How a record begins.
const RECORD: &str = "record [";

/// Takes a record out of a line: all its bytes, and numbers that are finite.
fn parse_record(text: &str) -> Option<Record> {
    let (_, bytes) = text.split_once(RECORD)?;
    let (bytes, _) = bytes.split_once(']')?;
    let bytes = bytes.split(',').map(|byte| byte.trim().parse().ok());
    let bytes: Vec<u8> = bytes.collect::<Option<_>>()?;
    let (record, rest): (Record, _) = postcard::take_from_bytes(&bytes).ok()?;
    let whole = rest.is_empty() && record.load_position.len() == record.load_velocity.len();
    (whole && record.columns().all(|column| column.value.is_finite())).then_some(record)
}

#[cfg(test)]
mod tests {
    use super::*;
    use arso_core::{Fault, Mode};
    use proptest::prelude::*;

    fn record() -> Record {
        Record {
            period: 7,
            mode: Mode::Fault(Fault::EncoderJump),
            count: 65535,
            applied_current: -0.001,
            command: 0.0,
            limited: true,
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
    fn line(record: &Record) -> String {
        let mut buffer = [0; 128];
        let bytes = postcard::to_slice(record, &mut buffer).unwrap();
        format!("DEBUG record {bytes:?}")
    }

    #[test]
    fn a_record_is_what_the_drive_serialised() {
        assert_eq!(parse_record(&line(&record())), Some(record()));
        // What is cut, too long, or holds what is no number is none.
        let whole = line(&record());
        let longer = whole.replace(']', ", 0]");
        let cut = whole.replace(", 9]", "]");
        let not_finite = line(&Record {
            velocity: f32::NAN,
            ..record()
        });
        let uneven = line(&Record {
            load_velocity: vec![0.0],
            ..record()
        });
        assert!(cut != whole);
        for text in [longer, cut, not_finite, uneven] {
            assert_eq!(parse_record(&text), None, "{text}");
        }
    }

    #[test]
    fn text_is_read_line_by_line_and_gaps_are_counted() {
        let later = Record {
            period: 10,
            ..record()
        };
        let lines = [
            &line(&record()),
            "INFO running",
            &line(&later),
            "",
            "x record [8",
        ];
        let text = lines.join("\n");
        let mut seen = Vec::new();
        let capture = read_text(text.as_bytes(), |message| seen.push(message.to_owned())).unwrap();
        assert_eq!(
            (capture.records.len(), capture.lost, capture.malformed),
            (2, 2, 1)
        );
        assert_eq!(seen, ["INFO running"]);
        assert_eq!(capture.bytes, text.len() as u64);
    }

    #[test]
    fn no_elf_is_an_error() {
        for elf in [&b""[..], b"hello", &[0x7F; 1000]] {
            let error = read_defmt(elf, "fw.elf", &b"abc"[..], |_| ()).unwrap_err();
            assert!(error.to_string().starts_with("fw.elf: "), "{error}");
            assert_eq!(error.exit_code(), 2);
        }
    }

    proptest! {
        #[test]
        fn any_text_is_taken(text in ".{0,200}", cut in 0..150_usize) {
            parse_record(&text);
            let line = line(&record());
            parse_record(&format!("{}{text}", &line[..cut.min(line.len())]));
            read_text(text.as_bytes(), |_| ()).unwrap();
        }
    }
}
