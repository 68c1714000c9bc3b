//! Two sectors of the flash, 10 and 11: 128 KiB each, the last ones, far behind the program.
//!
//! Erased and written byte by byte, which any supply of the part allows (RM0090, 3.6.2). What was read before lies in
//! the cache of the flash interface still; it is emptied after each change (3.5.4).

use arso_core::link::image::ROOM;
use arso_firmware::board::{self, FlashError, Slot};
use stm32f4xx_hal::flash::{FlashExt, UnlockedFlash};
use stm32f4xx_hal::pac::FLASH;

/// Where the first slot begins, counted from the start of the flash, the second behind it, and the sectors.
const FIRST: usize = 768 * 1024;
const LENGTH: usize = ROOM;
const SECTORS: [u8; 2] = [10, 11];

/// Start of the flash in memory.
const START: usize = 0x0800_0000;

fn offset(slot: Slot) -> usize {
    match slot {
        Slot::First => FIRST,
        Slot::Second => FIRST + LENGTH,
    }
}

/// Both slots.
pub(crate) struct Slots(FLASH);

impl Slots {
    pub(super) fn new(flash: FLASH) -> Self {
        Self(flash)
    }
}

impl board::Storage for Slots {
    type Spare = Spare;

    fn read(&self, slot: Slot) -> &[u8] {
        let from = offset(slot);
        self.0.read().get(from..from + LENGTH).unwrap_or_default()
    }

    fn divide(self, used: Option<Slot>) -> (&'static [u8], Spare) {
        let spare = match used {
            Some(Slot::First) => Slot::Second,
            _ => Slot::First,
        };
        let bytes: &'static [u8] = match used {
            // SAFETY: the slot lies in flash, which is always there, and `Spare`, the only owner of the flash from
            // now on, writes the other one alone.
            Some(slot) => unsafe {
                core::slice::from_raw_parts((START + offset(slot)) as *const u8, LENGTH)
            },
            None => &[],
        };
        (
            bytes,
            Spare {
                flash: self.0,
                slot: spare,
            },
        )
    }
}

/// The slot that may be written.
pub(crate) struct Spare {
    flash: FLASH,
    slot: Slot,
}

impl Spare {
    fn change(
        &mut self,
        change: impl FnOnce(&mut UnlockedFlash<'_>) -> Result<(), stm32f4xx_hal::flash::Error>,
    ) -> Result<(), FlashError> {
        let changed = change(&mut self.flash.unlocked());
        let control = self.flash.acr();
        if control.read().dcen().bit_is_set() {
            control.modify(|_, w| w.dcen().disabled());
            control.modify(|_, w| w.dcrst().set_bit());
            control.modify(|_, w| w.dcrst().clear_bit());
            control.modify(|_, w| w.dcen().enabled());
        }
        changed.map_err(|_| FlashError)
    }
}

impl board::Spare for Spare {
    fn read(&self) -> &[u8] {
        let from = offset(self.slot);
        self.flash
            .read()
            .get(from..from + LENGTH)
            .unwrap_or_default()
    }

    fn erase(&mut self) -> Result<(), FlashError> {
        let [first, second] = SECTORS;
        let sector = match self.slot {
            Slot::First => first,
            Slot::Second => second,
        };
        self.change(|flash| flash.erase(sector))
    }

    fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let at = at as usize;
        if at.checked_add(bytes.len()).is_none_or(|end| end > LENGTH) {
            return Err(FlashError);
        }
        let from = offset(self.slot) + at;
        self.change(|flash| flash.program(from, bytes.iter()))
    }
}
