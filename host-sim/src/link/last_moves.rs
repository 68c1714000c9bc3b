//! The last moves of a drive, read over the link while it may be writing them.

use super::Connection;
use crate::capture::{LastMoves, read_memory};
use crate::error::{Error, Result};
use arso_core::record::{BEFORE, HEADER, HELD, OLDEST, SAMPLES};
use std::time::Duration;

/// How often the record is read before it is given up, and how long a drive that moves is left alone: it records
/// until it has stood for 250 ms.
const TRIES: usize = 10;
const PAUSE: Duration = Duration::from_millis(200);

/// Word of the header: how many the ring has.
const RING: usize = 5;
/// Word of a stretch: how many samples it has, in its lower half.
const LENGTH: usize = BEFORE - 1;

impl Connection {
    /// The last moves, the oldest first.
    ///
    /// # Errors
    /// [`Error::Link`] when there is no record, or one that changes all the time; [`Error::Input`] for one that
    /// cannot be read.
    pub fn last_moves(&mut self) -> Result<LastMoves> {
        for _ in 0..TRIES {
            if let Some(memory) = self.memory()? {
                let bytes = memory.into_iter().flat_map(u32::to_le_bytes);
                let bytes: Vec<u8> = bytes.collect();
                return read_memory(&bytes, "the drive's memory");
            }
            std::thread::sleep(PAUSE);
        }
        Err(Error::Link(
            "the drive moves: its record of the last moves changes while it is read".into(),
        ))
    }

    /// Header and ring, of which only what is in use is read; nothing where that changed meanwhile.
    fn memory(&mut self) -> Result<Option<Vec<u32>>> {
        let mut memory = Memory::default();
        memory.read(self, 0, HEADER)?;
        let (oldest, held) = (memory.word(OLDEST), memory.word(HELD));
        let ring = memory.word(RING) as usize;
        if HEADER + ring > usize::from(u16::MAX) {
            return Err(none());
        }
        memory.words.resize(HEADER + ring, 0);
        memory.known.resize(HEADER + ring, false);

        // The stretches, one after the other, round the end of the ring.
        let (mut at, mut used) = (oldest as usize, 0);
        let mut newest = None;
        for _ in 0..held {
            memory.read_ring(self, at, BEFORE)?;
            let samples = memory.ring(at + LENGTH) & SAMPLES;
            newest = Some((at, memory.ring(at), memory.ring(at + LENGTH)));
            let size = BEFORE + samples as usize;
            used += size;
            if used > ring {
                return Ok(None);
            }
            memory.read_ring(self, at, size)?;
            at += size;
        }

        // Whatever has been written since shows in the header or in the newest stretch.
        let mut again = Memory {
            known: vec![false; memory.known.len()],
            words: memory.words.clone(),
        };
        again.read(self, 0, HEADER)?;
        let mut same = again.words.get(..HEADER) == memory.words.get(..HEADER);
        if let Some((at, number, samples)) = newest {
            again.read_ring(self, at, BEFORE)?;
            same &= (again.ring(at), again.ring(at + LENGTH)) == (number, samples);
        }
        Ok(same.then_some(memory.words))
    }
}

/// A drive without a record.
fn none() -> Error {
    Error::Link("the drive keeps no record of its last moves".into())
}

/// Words of the record, and which of them have been read.
#[derive(Default)]
struct Memory {
    words: Vec<u32>,
    known: Vec<bool>,
}

impl Memory {
    fn word(&self, place: usize) -> u32 {
        self.words.get(place).copied().unwrap_or(0)
    }

    /// A place of the ring, which may be beyond its end.
    fn place(&self, at: usize) -> usize {
        HEADER + at % self.words.len().saturating_sub(HEADER).max(1)
    }

    fn ring(&self, at: usize) -> u32 {
        self.word(self.place(at))
    }

    /// Reads what is not yet known of so many words of the ring.
    fn read_ring(&mut self, drive: &mut Connection, at: usize, count: usize) -> Result<()> {
        for at in at..at + count {
            let place = self.place(at);
            if self.known.get(place) == Some(&false) {
                self.read(drive, place, 1)?;
            }
        }
        Ok(())
    }

    /// Reads so many words at least.
    fn read(&mut self, drive: &mut Connection, first: usize, count: usize) -> Result<()> {
        let mut place = first;
        while place < first + count {
            let words = drive.words(u16::try_from(place).map_err(|_| none())?)?;
            if words.is_empty() {
                return Err(none());
            }
            if self.words.len() < HEADER {
                self.words.resize(HEADER, 0);
                self.known.resize(HEADER, false);
            }
            for word in words {
                if let (Some(known), Some(kept)) =
                    (self.known.get_mut(place), self.words.get_mut(place))
                {
                    (*known, *kept) = (true, word);
                }
                place += 1;
            }
        }
        Ok(())
    }
}
