//! The digest by which a file of a sweep shows that it is as it was written, to the last bit.
//!
//! SHA-256 over all bytes of the file, as hexadecimal digits in its own metadata; there those digits count as zeros.
//! It is looked at before the file is read in any other way: what is damaged never gets as far as a decoder.

use super::file::wrong;
use crate::error::{Error, Result};
use sha2::{Digest, Sha256};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// What stands in its place until it is known.
pub(super) const BLANK: &str = "0000000000000000000000000000000000000000000000000000000000000000";
/// Of the entry of the metadata.
pub(super) const KEY: &str = "host-sim.digest";
/// What stands between key and digits: the head of a text of 64 bytes, in Thrift's compact protocol.
const HEAD: [u8; 2] = [0x18, BLANK.len() as u8];
/// A Parquet file ends with the length of its metadata and this.
const MAGIC: &[u8; 4] = b"PAR1";

/// Where a file has its digits, or why it has none.
fn find(file: &mut (impl Read + Seek)) -> io::Result<std::result::Result<u64, &'static str>> {
    let length = file.seek(SeekFrom::End(0))?;
    let no_parquet = Ok(Err("is no whole Parquet file"));
    let Some(end) = length.checked_sub(8) else {
        return no_parquet;
    };
    let (mut size, mut magic) = ([0; 4], [0; 4]);
    file.seek(SeekFrom::Start(end))?;
    file.read_exact(&mut size)?;
    file.read_exact(&mut magic)?;
    let begin = end.checked_sub(u32::from_le_bytes(size).into());
    let Some(begin) = begin.filter(|_| magic == *MAGIC) else {
        return no_parquet;
    };
    file.seek(SeekFrom::Start(begin))?;
    let mut metadata = vec![0; (end - begin) as usize];
    file.read_exact(&mut metadata)?;
    // The last one: the texts of the sweep stand before it, and may say anything.
    let wanted = [KEY.as_bytes(), &HEAD].concat();
    let mut places = metadata.windows(wanted.len());
    let found = places.rposition(|bytes| bytes == wanted);
    let digits = found.map(|at| at + wanted.len());
    let digits = digits.filter(|at| at + BLANK.len() <= metadata.len());
    Ok(digits
        .map(|at| begin + at as u64)
        .ok_or("has no digest: it is no file of a sweep, or of an older version"))
}

/// The digits that belong there.
///
/// * `at`: where they stand
fn digits(file: &mut (impl Read + Seek), at: u64) -> io::Result<String> {
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    let mut take = |hash: &mut Sha256, mut bytes: io::Take<&mut _>| -> io::Result<()> {
        loop {
            match bytes.read(&mut buffer)? {
                0 => return Ok(()),
                count => hash.update(&buffer[..count]),
            }
        }
    };
    file.seek(SeekFrom::Start(0))?;
    take(&mut hash, file.by_ref().take(at))?;
    hash.update(BLANK);
    file.seek(SeekFrom::Start(at + BLANK.len() as u64))?;
    take(&mut hash, file.by_ref().take(u64::MAX))?;
    Ok(hexadecimal(hash))
}

/// Its digits.
pub(super) fn hexadecimal(hash: Sha256) -> String {
    hash.finalize()
        .iter()
        .fold(String::new(), |text, byte| text + &format!("{byte:02x}"))
}

/// Puts the digest into a file that has been written, for [`BLANK`].
pub(super) fn put(file: &mut (impl Read + Write + Seek)) -> io::Result<()> {
    let at = find(file)?.map_err(io::Error::other)?;
    let digits = digits(file, at)?;
    file.seek(SeekFrom::Start(at))?;
    file.write_all(digits.as_bytes())
}

/// Refuses a file that is not as it was written.
///
/// # Errors
/// [`Error::Read`], [`Error::Input`].
pub(super) fn require(file: &mut (impl Read + Seek), path: &Path) -> Result<()> {
    let at = find(file)
        .map_err(Error::read(path))?
        .map_err(|why| wrong(path, why.into()))?;
    let mut found = [0; BLANK.len()];
    let there = file
        .seek(SeekFrom::Start(at))
        .and_then(|_| file.read_exact(&mut found));
    there.map_err(Error::read(path))?;
    let expected = digits(file, at).map_err(Error::read(path))?;
    if found == expected.as_bytes() {
        Ok(())
    } else {
        let why = "is damaged: its bytes are not those that were written";
        Err(wrong(path, why.into()))
    }
}
