//! The flash memory itself [3.4]: programming clears bits, erasing sets those of a whole sector.

use crate::virtual_board::image::FLASH_SIZE;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::ops::Range;
use std::sync::Arc;

const KIB: usize = 1024;
const SECTORS: usize = 12;

/// The bytes of a sector, by offset from the beginning of flash; none of that number otherwise.
#[must_use]
pub fn sector(number: usize) -> Option<Range<usize>> {
    match number {
        0..=3 => Some(16 * KIB * number..16 * KIB * (number + 1)),
        4 => Some(64 * KIB..128 * KIB),
        5..SECTORS => Some(128 * KIB * (number - 4)..128 * KIB * (number - 3)),
        _ => None,
    }
}

/// What the flash interface does to the memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Clears the bits of these bytes that are clear in the value, lowest byte first.
    Program {
        /// The bytes, by offset.
        place: Range<usize>,
        /// What is written.
        value: u32,
    },
    /// Sets all bits of a sector.
    Erase {
        /// The sector, by offset.
        place: Range<usize>,
    },
}

impl Operation {
    /// The bytes it changes.
    #[must_use]
    pub fn place(&self) -> Range<usize> {
        match self {
            Operation::Program { place, .. } | Operation::Erase { place } => place.clone(),
        }
    }

    /// What becomes of one of its bytes.
    fn aim(&self, index: usize, byte: u8) -> u8 {
        match self {
            Operation::Program { value, .. } => byte & (value >> (8 * index)) as u8,
            Operation::Erase { .. } => 0xFF,
        }
    }
}

/// The content by sector; clones share the sectors that have not changed since.
#[derive(Clone, Debug)]
pub struct Array {
    sectors: Vec<Arc<Vec<u8>>>,
}

impl Array {
    /// With this at its beginning, erased behind that.
    #[must_use]
    pub fn new(content: &[u8]) -> Self {
        let sectors = (0..SECTORS).filter_map(sector).map(|place| {
            let begin = place.start.min(content.len());
            let end = place.end.min(content.len());
            let mut bytes = content[begin..end].to_vec();
            bytes.resize(place.len(), 0xFF);
            Arc::new(bytes)
        });
        Self {
            sectors: sectors.collect(),
        }
    }

    /// All of it.
    #[must_use]
    pub fn content(&self) -> Vec<u8> {
        let mut content = Vec::with_capacity(FLASH_SIZE as usize);
        for sector in &self.sectors {
            content.extend_from_slice(sector);
        }
        content
    }

    /// Some bytes of one sector; nothing where these are not in one.
    #[must_use]
    pub fn bytes(&self, place: Range<usize>) -> &[u8] {
        let own = |number: usize| sector(number).is_some_and(|own| own.contains(&place.start));
        let number = (0..SECTORS).find(|number| own(*number)).unwrap_or(0);
        let begin = sector(number).map_or(0, |own| own.start);
        self.sectors
            .get(number)
            .and_then(|bytes| bytes.get(place.start - begin..place.end - begin))
            .unwrap_or_default()
    }

    /// Changes some bytes of one sector, each by its index and what it is.
    fn change(&mut self, place: Range<usize>, mut new: impl FnMut(usize, u8) -> u8) {
        for (number, bytes) in self.sectors.iter_mut().enumerate() {
            let Some(own) = sector(number).filter(|own| own.contains(&place.start)) else {
                continue;
            };
            let bytes =
                Arc::make_mut(bytes).get_mut(place.start - own.start..place.end - own.start);
            for (index, byte) in bytes.into_iter().flatten().enumerate() {
                *byte = new(index, *byte);
            }
        }
    }

    /// Puts something there, whatever it is.
    pub fn store(&mut self, offset: usize, bytes: &[u8]) {
        let mut content = self.content();
        for (place, byte) in content.iter_mut().skip(offset).zip(bytes) {
            *place = *byte;
        }
        *self = Self::new(&content);
    }

    /// Does an operation.
    pub fn carry_out(&mut self, operation: &Operation) {
        self.change(operation.place(), |index, byte| operation.aim(index, byte));
    }

    /// Does a part of an operation that is broken off: from nothing, if it had only just begun, to all of it.
    /// Some bits of what is programmed are clear, the others as they were; of a sector some bytes are erased,
    /// some as they were, and some anything.
    pub fn break_off(&mut self, operation: &Operation, seed: u64) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let done = random.random_range(-0.2..1.2_f64).clamp(0.0, 1.0);
        let anything = if done > 0.0 { random.random() } else { 0.0 };
        self.change(operation.place(), |index, byte| {
            let aim = operation.aim(index, byte);
            match operation {
                Operation::Program { .. } => {
                    let reached = (0..8).map(|bit| u8::from(random.random_bool(done)) << bit);
                    let reached: u8 = reached.sum();
                    byte & !reached | aim & reached
                }
                Operation::Erase { .. } if random.random_bool(done) => aim,
                Operation::Erase { .. } if random.random_bool(anything) => random.random(),
                Operation::Erase { .. } => byte,
            }
        });
    }

    /// The sectors that have another content here.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<Range<usize>> {
        let pairs = self.sectors.iter().zip(&other.sectors).enumerate();
        let differ = pairs.filter(|(_, (a, b))| !Arc::ptr_eq(a, b) && a != b);
        differ.filter_map(|(number, _)| sector(number)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sectors_cover_the_flash() {
        let mut end = 0;
        for place in (0..).map_while(sector) {
            assert_eq!(place.start, end);
            end = place.end;
        }
        assert_eq!(end, FLASH_SIZE as usize);
        assert_eq!(sector(11), Some(0xE_0000..0x10_0000));
    }

    #[test]
    fn what_is_broken_off_lies_between_before_and_after() {
        let place = 0x1_0000..0x2_0000;
        let mut old = vec![0x5A; 0x1_0000];
        old.extend(vec![0; 0x1_0000]);
        let old = Array::new(&old);
        let mut after = old.clone();
        let erase = Operation::Erase {
            place: place.clone(),
        };
        after.carry_out(&erase);
        assert_eq!(after.differences(&old), std::slice::from_ref(&place));
        let (mut nothing, mut all, mut part) = (0, 0, 0);
        for seed in 0..100 {
            let mut array = old.clone();
            array.break_off(&erase, seed);
            let mut again = old.clone();
            again.break_off(&erase, seed);
            assert!(array.differences(&again).is_empty());
            assert_eq!(array.bytes(0..16), [0x5A; 16]);
            if array.differences(&old).is_empty() {
                nothing += 1;
            } else if array.differences(&after).is_empty() {
                all += 1;
            } else {
                let bytes = array.bytes(place.clone());
                part += u32::from(bytes.contains(&0) && bytes.iter().any(|byte| *byte != 0));
            }
        }
        assert!(
            nothing > 5 && all > 5 && part > 50,
            "{nothing} {all} {part}"
        );

        let program = Operation::Program {
            place: 0x100..0x104,
            value: 0x0F0F_0F0F,
        };
        for seed in 0..100 {
            let mut array = old.clone();
            array.break_off(&program, seed);
            for byte in array.bytes(0x100..0x104) {
                assert_eq!((byte & 0x0A, byte & !0x5A), (0x0A, 0), "{byte:#x}");
            }
        }
    }
}
