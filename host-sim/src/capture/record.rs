//! The last moves of a drive, out of a dump of its memory.
//!
//! The dump is whatever a debugger has written: all of the memory, or the record alone. The record is found by
//! how it begins, and read by the code that wrote it.

use super::Origin;
use crate::error::{Error, Result};
use arso_core::record::{MAGIC, Record, Sample};

/// What a drive recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct LastMoves {
    /// Whose moves they are.
    pub origin: Origin,
    /// The oldest first.
    pub moves: Vec<RecordedMove>,
}

/// A move, or an excitation, from rest until the machine stands.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedMove {
    /// Its number since the drive's reset.
    pub number: u32,
    /// Number of the control period in which it begins, as in the log.
    pub period: u32,
    /// Whether it had ended when the memory was read.
    pub ended: bool,
    /// Whether the move went on: this is its first part.
    pub cut: bool,
    /// Its periods.
    pub samples: Vec<Sample>,
}

/// Reads the record in a dump.
///
/// * `name`: of the dump, for messages
///
/// # Errors
/// [`Error::Input`] where there is none, more than one, or one that cannot be read.
pub fn read_memory(dump: &[u8], name: &str) -> Result<LastMoves> {
    let input = |message: String| Error::Input {
        place: name.into(),
        message,
    };
    let starts = dump.windows(MAGIC.len()).zip(0..);
    let starts: Vec<usize> = starts
        .filter(|(bytes, _)| *bytes == MAGIC)
        .map(|(_, at)| at)
        .collect();
    let start = match starts[..] {
        [] => {
            return Err(input(format!(
                "none of its {} bytes begin a record of moves: it must be a binary dump of the memory of a drive \
                 that has started",
                dump.len()
            )));
        }
        [start] => start,
        _ => {
            return Err(input(
                "holds more than one record of moves: dump one by itself".into(),
            ));
        }
    };
    let (words, _) = dump[start..].as_chunks::<4>();
    let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
    let record = Record::parse(&words).map_err(|error| input(format!("holds {error}")))?;
    let origin = Origin::said(&record.drive())
        .ok_or_else(|| input("holds a record of moves of an unknown kind of drive".into()))?;
    let moves = record.stretches().map(|stretch| RecordedMove {
        number: stretch.number,
        period: stretch.period,
        ended: stretch.ended,
        cut: stretch.cut,
        samples: stretch.samples().collect(),
    });
    let moves = moves.collect();
    Ok(LastMoves { origin, moves })
}

#[cfg(test)]
mod tests {
    use super::*;
    use arso_core::record::{self, Course, Recorder, Scale};
    use arso_core::{Counts, Current, Identity};

    /// Memory of a drive that has made three moves, in the midst of other things.
    fn dump() -> Vec<u8> {
        let memory = record::LastMoves::<2000>::new();
        let drive = Identity {
            kind: "rotary",
            loads: 2,
            sample_time: 5e-4,
            fingerprint: 0xABCD,
        };
        let scale = Scale {
            counter_bits: 16,
            step: Current(2e-3),
            tolerance: 5,
        };
        let mut recorder = Recorder::new(&memory, &drive, scale);
        let mut period = 0;
        for number in 1..=3_u32 {
            for tick in 0..700 {
                period += 1;
                let course = if tick < 100 {
                    Course::Moved
                } else {
                    Course::Free
                };
                let count = Counts((65_000 + number * tick.min(100) * 7) % 65_536);
                recorder.step(period, count, Current(-2e-3 * tick as f32), course);
            }
        }
        let words = memory.words().flat_map(u32::to_le_bytes);
        [7; 1027].into_iter().chain(words).chain([7; 99]).collect()
    }

    #[test]
    fn moves_are_found_in_a_dump() {
        let LastMoves { origin, moves } = read_memory(&dump(), "ram.bin").unwrap();
        assert_eq!(origin.mark(), "rotary-2-0000abcd");
        assert_eq!(origin.period, 5e-4);
        // 100 periods, and 250 ms of standing.
        let extents = moves
            .iter()
            .map(|one| (one.number, one.period, one.samples.len(), one.ended));
        let extents: Vec<_> = extents.collect();
        assert_eq!(
            extents,
            [(1, 1, 601, true), (2, 701, 601, true), (3, 1401, 601, true)]
        );
        let last = moves[2].samples[50];
        assert_eq!(
            (last.tick, last.count),
            (50, Counts((65_000 + 3 * 350) % 65_536))
        );
        assert_eq!(last.applied, Current(-50.0 * 2e-3));
    }

    #[test]
    fn other_files_are_refused() {
        let dump = dump();
        let refused = |dump: &[u8]| {
            let error = read_memory(dump, "ram.bin").unwrap_err();
            assert_eq!(error.exit_code(), 2);
            error.to_string()
        };
        assert!(refused(b"").contains("begin a record of moves"));
        assert!(refused(&dump[..dump.len() - 100]).contains("cut off: it has 8060 bytes"));
        assert!(refused(&[&dump[..], &dump].concat()).contains("more than one"));
        let mut other = dump.clone();
        other[1027 + 16] = 9;
        assert!(refused(&other).contains("version 9"));
        let mut unknown = dump;
        unknown[1027 + 40] = b'x';
        assert!(refused(&unknown).contains("unknown kind"));
    }
}
