//! A raw defmt stream: frames between zeros, decoded with the firmware that logged them.

use super::{Capture, unreadable};
use crate::error::{Error, Result};
use defmt_decoder::{Encoding, Table};
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Longer frames are no frames of ours.
const LONGEST_FRAME: usize = 4096;

/// Reads a raw defmt stream to its end.
///
/// * `elf`: the very firmware that logged
/// * `message`: called with everything that is no record, as it comes
///
/// # Errors
/// [`Error::Input`] when the ELF has no log table, or is not the one that logged: nothing in the stream
/// fits it, or more is damaged than whole and no record is among it;
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
    if table.encoding() != Encoding::Rzcobs {
        let message = "its log is not divided into frames (defmt's encoding-raw)";
        return Err(input(message.into()));
    }

    let mut capture = Capture::default();
    let mut frame = Vec::new();
    let mut whole = 0_u64;
    let mut overlong = false;
    let mut buffer = [0; 16 * 1024];
    loop {
        let length = match stream.read(&mut buffer) {
            Ok(0) => break,
            Ok(length) => length,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(source) => return Err(unreadable(source)),
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
                    Some(text) => whole += u64::from(capture.take(&text, &mut message)),
                    None => capture.malformed += 1,
                }
            }
            frame.clear();
            overlong = false;
        }
    }
    // What is left has no end: cut off.
    capture.malformed += u64::from(overlong || !frame.is_empty());
    capture.forget_doubtful();
    if whole == 0 && capture.bytes > 0 {
        return Err(input(format!(
            "none of the {} bytes of the log fits this ELF: it must be the one that logged",
            capture.bytes
        )));
    }
    if capture.records.is_empty() && capture.malformed > whole {
        return Err(input(format!(
            "{} of the log's {} frames do not fit this ELF, and no control period is among the others: it \
             must be the one that logged",
            capture.malformed,
            capture.malformed + whole
        )));
    }
    Ok(capture)
}

/// One frame as text with its level, nothing when it is damaged.
fn decode(table: &Table, frame: &[u8]) -> Option<String> {
    // A damaged frame can name any format with any arguments, and the decoder was not made for
    // that: what it cannot take may end in a panic inside of it, which is a damaged frame too.
    let decode = || {
        let bytes = rzcobs::decode(frame).ok()?;
        let (frame, length) = table.decode(&bytes).ok()?;
        // The encoding may leave zeros behind the last argument; anything else was meant for
        // another format.
        if bytes.get(length..)?.iter().any(|byte| *byte != 0) {
            return None;
        }
        let level = frame.level().map_or("", |level| level.as_str());
        Some(format!(
            "{} {}",
            level.to_uppercase(),
            frame.display_message()
        ))
    };
    catch_unwind(AssertUnwindSafe(decode)).ok().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_elf_is_an_error() {
        for elf in [&b""[..], b"hello", &[0x7F; 1000]] {
            let error = read_defmt(elf, "fw.elf", &b"abc"[..], |_| ()).unwrap_err();
            assert!(error.to_string().starts_with("fw.elf: "), "{error}");
            assert_eq!(error.exit_code(), 2);
        }
    }
}
