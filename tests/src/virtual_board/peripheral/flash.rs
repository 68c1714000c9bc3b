//! Flash interface [3.9]: unlocking, programming and erasing, which take their time; wait states and
//! caches, which this board stores and does not time.
//!
//! ```text
//! write to flash --program--> operation --its time--> array
//! STRT ------------erase--^       |
//!                     reset, end of power --> array, part of the operation done
//! ```
//!
//! The processor stalls while an operation runs, as it does when it fetches from the flash that is busy;
//! everything else goes on. Left out: mass erase, option bytes, read protection, and the bus error that a
//! wrong key or an unlocked register's key gives.

pub mod array;

use super::{Peripheral, Unknown};
use array::{Array, Operation};
use std::collections::VecDeque;
use std::ops::Range;

/// What KEYR takes, in this order.
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Bits of SR.
const EOP: u32 = 1;
const OPERR: u32 = 1 << 1;
const WRPERR: u32 = 1 << 4;
const PGAERR: u32 = 1 << 5;
const PGPERR: u32 = 1 << 6;
const PGSERR: u32 = 1 << 7;
const BSY: u32 = 1 << 16;

/// Bits of CR.
const PG: u32 = 1;
const SER: u32 = 1 << 1;
const SNB: u32 = 0xF << 3;
const PSIZE: u32 = 0b11 << 8;
const STRT: u32 = 1 << 16;
const EOPIE: u32 = 1 << 24;
const ERRIE: u32 = 1 << 25;
const LOCK: u32 = 1 << 31;

/// OPTCR of a part as delivered.
const OPTIONS: u32 = 0x0FFF_AAED;

/// Times of the data sheet. Programming, typical and longest, µs.
const PROGRAM: [u64; 2] = [16, 100];
/// Erasing a sector of 16, 64, 128 KiB with 8, 16, 32 bits at once, typical, µs; the longest is twice that.
const ERASE: [[u64; 3]; 3] = [
    [400_000, 300_000, 250_000],
    [1_200_000, 700_000, 550_000],
    [2_000_000, 1_300_000, 1_000_000],
];

/// What the key register waits for while CR is locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    First,
    Second,
    /// A wrong one came: nothing any more, until reset.
    None,
}

/// An operation under way.
#[derive(Clone, Debug)]
struct Work {
    operation: Operation,
    ends: u64,
    /// It ends with the power.
    cut: bool,
}

/// The registers, and the memory.
#[derive(Clone, Debug)]
pub struct FlashInterface {
    /// The data sheet's longest times instead of its typical ones.
    pub slow: bool,
    array: Array,
    acr: u32,
    cr: u32,
    sr: u32,
    key: Key,
    processor_hz: u64,
    /// What runs, and what the same instruction has asked for behind it.
    work: VecDeque<Work>,
    /// Operations begun.
    operations: u64,
    /// Which of them the power ends in.
    cut: Option<u64>,
    /// The power has ended.
    dark: bool,
    seed: u64,
}

impl Default for FlashInterface {
    fn default() -> Self {
        Self::new(&[])
    }
}

impl FlashInterface {
    /// * `content`: of the memory, erased behind that
    #[must_use]
    pub fn new(content: &[u8]) -> Self {
        Self {
            slow: false,
            array: Array::new(content),
            acr: 0,
            cr: LOCK,
            sr: 0,
            key: Key::First,
            processor_hz: 16_000_000,
            work: VecDeque::new(),
            operations: 0,
            cut: None,
            dark: false,
            seed: 0,
        }
    }

    /// The memory.
    #[must_use]
    pub fn array(&self) -> &Array {
        &self.array
    }

    /// Puts something into the memory without programming it.
    pub fn store(&mut self, offset: usize, bytes: &[u8]) {
        self.array.store(offset, bytes);
    }

    /// The bus tells the frequency of the processor, in whose cycles time is kept.
    pub fn set_processor_hz(&mut self, hz: u64) {
        self.processor_hz = hz;
    }

    /// Operations begun since the board was new: units programmed, sectors erased.
    #[must_use]
    pub fn operations(&self) -> u64 {
        self.operations
    }

    /// Ends the power in the middle of an operation.
    ///
    /// * `operation`: how many are completed before that; never, if none
    /// * `seed`: of what is left of this one, and of others that a reset breaks off
    pub fn cut_at(&mut self, operation: Option<u64>, seed: u64) {
        self.cut = operation.map(|operation| self.operations + operation);
        self.seed = seed;
    }

    /// Whether the power has ended.
    #[must_use]
    pub fn dark(&self) -> bool {
        self.dark
    }

    /// Whether an operation runs.
    #[must_use]
    pub fn busy(&self) -> bool {
        !self.work.is_empty()
    }

    /// When the operation ends that runs.
    #[must_use]
    pub fn next_event(&self) -> Option<u64> {
        self.work.front().map(|work| work.ends)
    }

    /// Level of the interrupt line.
    #[must_use]
    pub fn interrupt(&self) -> bool {
        self.cr & EOPIE != 0 && self.sr & EOP != 0 || self.cr & ERRIE != 0 && self.sr & OPERR != 0
    }

    /// The processor writes to the memory.
    ///
    /// * `size`: of the access, bytes
    pub fn program(&mut self, offset: usize, value: u32, size: usize, now: u64) {
        let parallel = 1 << ((self.cr & PSIZE) >> 8);
        if self.cr & (PG | SER) != PG {
            self.sr |= PGSERR;
        } else if self.cr & LOCK != 0 {
            self.refuse(WRPERR);
        } else if size != parallel || !offset.is_multiple_of(size) {
            self.refuse(PGPERR);
        } else {
            let place = offset..offset + size;
            let operation = Operation::Program { place, value };
            self.begin(operation, PROGRAM[usize::from(self.slow)], now);
        }
    }

    fn erase(&mut self, now: u64) -> Result<(), Unknown> {
        if self.cr & (PG | SER) != SER {
            self.sr |= PGSERR;
            return Ok(());
        }
        let number = (self.cr & SNB) >> 3;
        let place = array::sector(number as usize).ok_or(Unknown)?;
        let size = match number {
            0..=3 => 0,
            4 => 1,
            _ => 2,
        };
        let parallel = (self.cr & PSIZE) as usize >> 8;
        let time = ERASE[size][parallel] << u32::from(self.slow);
        self.begin(Operation::Erase { place }, time, now);
        Ok(())
    }

    fn refuse(&mut self, error: u32) {
        self.sr |= error;
        if self.cr & ERRIE != 0 {
            self.sr |= OPERR;
        }
    }

    /// * `time`: that it takes, µs
    fn begin(&mut self, operation: Operation, time: u64, now: u64) {
        let begins = self.work.back().map_or(now, |work| work.ends);
        let cut = self.cut == Some(self.operations);
        let cycles = time * self.processor_hz / 1_000_000;
        self.operations += 1;
        self.work.push_back(Work {
            operation,
            ends: begins + if cut { cycles / 2 } else { cycles },
            cut,
        });
    }

    /// Ends the operation whose time is over, or in which the power ends; the bytes that it changed.
    pub fn end(&mut self, now: u64) -> Option<Range<usize>> {
        self.next_event().filter(|ends| *ends <= now)?;
        let work = self.work.pop_front()?;
        if work.cut {
            self.array.break_off(&work.operation, self.seed);
            self.work.clear();
            self.cut = None;
            self.dark = true;
        } else {
            self.array.carry_out(&work.operation);
            if self.cr & EOPIE != 0 {
                self.sr |= EOP;
            }
        }
        Some(work.operation.place())
    }

    /// Registers as after reset; an operation that runs is broken off.
    pub fn reset(&mut self) {
        if let Some(work) = self.work.pop_front() {
            let seed = self.seed.wrapping_add(self.operations);
            self.array.break_off(&work.operation, seed);
        }
        *self = Self {
            slow: self.slow,
            array: self.array.clone(),
            operations: self.operations,
            cut: self.cut,
            seed: self.seed,
            ..Self::default()
        };
    }

    fn unlock(&mut self, key: u32) {
        self.key = match self.key {
            _ if self.cr & LOCK == 0 => self.key,
            Key::First if key == KEYS[0] => Key::Second,
            Key::Second if key == KEYS[1] => {
                self.cr &= !LOCK;
                Key::First
            }
            _ => Key::None,
        };
    }
}

impl Peripheral for FlashInterface {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        Ok(match offset {
            0x00 => self.acr,
            // The key register is write-only.
            0x04 => 0,
            0x0C => self.sr | if self.busy() { BSY } else { 0 },
            0x10 => self.cr,
            0x14 => OPTIONS,
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), Unknown> {
        match offset {
            0x00 => self.acr = value,
            0x04 => self.unlock(value),
            // Writing one clears.
            0x0C => self.sr &= !(value & (EOP | OPERR | WRPERR | PGAERR | PGPERR | PGSERR)),
            0x10 if self.cr & LOCK != 0 => {}
            // Mass erase is not modelled; 64 bits at once need a supply that this board does not have.
            0x10 if value & !(PG | SER | SNB | PSIZE | STRT | EOPIE | ERRIE | LOCK) == 0
                && value & PSIZE != PSIZE =>
            {
                self.cr = value & !STRT;
                if value & STRT != 0 {
                    self.erase(now)?;
                }
            }
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEYR: u32 = 0x04;
    const SR: u32 = 0x0C;
    const CR: u32 = 0x10;
    const LAST: usize = 0xE_0000;

    /// At 16 MHz.
    fn unlocked() -> FlashInterface {
        let mut flash = FlashInterface::default();
        for key in KEYS {
            flash.write(KEYR, key, 0).unwrap();
        }
        flash
    }

    fn word(flash: &FlashInterface) -> u32 {
        let bytes = flash.array().bytes(LAST..LAST + 4).try_into().unwrap();
        u32::from_le_bytes(bytes)
    }

    #[test]
    fn only_the_keys_in_their_order_unlock() {
        for (keys, cr) in [
            (&[][..], LOCK),
            (&KEYS[..1], LOCK),
            (&KEYS[1..], LOCK),
            (&[KEYS[1], KEYS[0], KEYS[1]], LOCK),
            (&[KEYS[0], 0, KEYS[0], KEYS[1]], LOCK),
            (&KEYS, PG),
        ] {
            let mut flash = FlashInterface::default();
            for key in keys {
                flash.write(KEYR, *key, 0).unwrap();
            }
            flash.write(CR, PG, 0).unwrap();
            assert_eq!(flash.read(CR, 0), Ok(cr), "{keys:x?}");
        }
        // Locked again, and unlocked again; after a wrong key by a reset only.
        let mut flash = unlocked();
        flash.write(CR, LOCK, 0).unwrap();
        flash.write(CR, PG, 0).unwrap();
        assert_eq!(flash.read(CR, 0), Ok(LOCK));
        flash.write(KEYR, 1, 0).unwrap();
        flash.reset();
        for key in KEYS {
            flash.write(KEYR, key, 0).unwrap();
        }
        assert_eq!(flash.read(CR, 0), Ok(0));
    }

    #[test]
    fn programming_clears_bits_in_its_time() {
        let mut flash = unlocked();
        flash.write(CR, 0b10 << 8 | PG, 0).unwrap();
        flash.program(LAST, 0xFFFF_0FF0, 4, 100);
        assert_eq!(flash.read(SR, 0), Ok(BSY));
        assert_eq!((flash.next_event(), flash.end(355)), (Some(356), None));
        assert_eq!(word(&flash), u32::MAX);
        assert_eq!(flash.end(356), Some(LAST..LAST + 4));
        // Of one instruction the second word waits for the first.
        flash.program(LAST, 0x1234_FFFF, 4, 1000);
        flash.program(LAST + 4, 0, 4, 1000);
        assert_eq!(flash.end(1256), Some(LAST..LAST + 4));
        assert_eq!((flash.next_event(), flash.busy()), (Some(1512), true));
        assert_eq!(flash.end(1512), Some(LAST + 4..LAST + 8));
        assert_eq!((word(&flash), flash.read(SR, 0)), (0x1234_0FF0, Ok(0)));
        assert_eq!(flash.operations(), 3);
    }

    #[test]
    fn what_is_out_of_order_changes_nothing() {
        for (cr, size, error) in [
            (0, 1, PGSERR),
            (PG | SER, 1, PGSERR),
            (PG | LOCK, 1, WRPERR),
            (PG, 2, PGPERR),
            (PG | 0b01 << 8, 1, PGPERR),
            (PG | ERRIE, 4, PGPERR | OPERR),
        ] {
            let mut flash = unlocked();
            flash.write(CR, cr, 0).unwrap();
            flash.program(LAST, 0, size, 0);
            assert_eq!((flash.read(SR, 0), flash.busy()), (Ok(error), false));
            assert_eq!(
                (word(&flash), flash.interrupt()),
                (u32::MAX, cr & ERRIE != 0)
            );
            flash.write(SR, error, 0).unwrap();
            assert_eq!((flash.read(SR, 0), flash.interrupt()), (Ok(0), false));
        }
        let mut flash = unlocked();
        flash.write(CR, PG | STRT, 0).unwrap();
        assert_eq!((flash.read(SR, 0), flash.busy()), (Ok(PGSERR), false));
        for cr in [1 << 2, PSIZE, SER | STRT | 12 << 3] {
            assert_eq!(flash.write(CR, cr, 0), Err(Unknown), "{cr:#x}");
        }
    }

    #[test]
    fn a_sector_takes_its_time() {
        for (number, size, slow, ms) in [
            (0, 0, false, 400),
            (4, 0, false, 1200),
            (11, 0, false, 2000),
            (11, 0, true, 4000),
            (5, 2, false, 1000),
        ] {
            let mut flash = unlocked();
            flash.slow = slow;
            flash
                .write(CR, size << 8 | EOPIE | SER | number << 3 | STRT, 7)
                .unwrap();
            assert_eq!(flash.read(CR, 7).unwrap() & STRT, 0);
            let ends = 7 + ms * 16_000;
            assert_eq!(flash.next_event(), Some(ends));
            assert_eq!(flash.end(ends), array::sector(number as usize));
            assert_eq!((flash.read(SR, 0), flash.interrupt()), (Ok(EOP), true));
        }
    }

    #[test]
    fn the_power_ends_in_the_middle() {
        let mut flash = unlocked();
        flash.write(CR, PG, 0).unwrap();
        flash.cut_at(Some(1), 3);
        flash.program(LAST, 0, 1, 0);
        flash.program(LAST + 1, 0, 1, 0);
        assert!(flash.end(256).is_some() && !flash.dark());
        assert_eq!(
            (flash.next_event(), flash.end(384)),
            (Some(384), Some(LAST + 1..LAST + 2))
        );
        assert!(flash.dark() && !flash.busy());
        flash.reset();
        assert_eq!(
            (flash.dark(), flash.operations(), word(&flash) & 0xFF),
            (false, 2, 0)
        );
    }
}
