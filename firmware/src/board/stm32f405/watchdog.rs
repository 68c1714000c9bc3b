//! Independent watchdog: resets the processor when control or idle loop has died.
//!
//! It is fed by the idle loop for each record that comes from the control interrupt, so both must
//! be alive. After a reset the amplifier is off. It runs on while a debugger halts the processor: nobody
//! would regulate the current that was commanded last.

use arso_firmware::board::Watchdog;
use stm32f4xx_hal::pac::{DBGMCU, IWDG};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// How long it waits, nominally: 4 ms, or four control periods where that is longer. Its oscillator runs at 17
/// to 47 kHz (data sheet, table of the LSI) where 32 are nominal, so that it waits for 2.7 to 7.6 ms.
const LEAST_MS: u32 = 4;
const PERIODS: u32 = 4;

/// How long it waits while flash is written, nominally: with the fastest oscillator 10.9 s, where a sector of 128 KiB
/// takes 4 s at most to be erased byte by byte (data sheet, table of the flash memory's programming).
const FLASH_MS: u32 = 16_000;

/// The running watchdog.
pub(crate) struct ResetWatchdog(IndependentWatchdog);

impl ResetWatchdog {
    pub(super) fn new(watchdog: IWDG, debug: &DBGMCU, period_us: u32) -> Self {
        let mut watchdog = IndependentWatchdog::new(watchdog);
        watchdog.stop_on_debug(debug, false);
        watchdog.start((PERIODS * period_us / 1000).max(LEAST_MS).millis());
        Self(watchdog)
    }
}

impl Watchdog for ResetWatchdog {
    fn feed(&mut self) {
        self.0.feed();
    }

    fn wait_for_flash(&mut self) {
        self.0.start(FLASH_MS.millis());
    }
}
