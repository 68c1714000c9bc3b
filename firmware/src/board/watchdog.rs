//! Independent watchdog: resets the processor when control or idle loop has died.
//!
//! It is fed by the idle loop for each record that comes from the control interrupt, so both must
//! be alive. After a reset the amplifier is off. It runs on while a debugger halts the processor: nobody
//! would regulate the current that was commanded last.

use crate::gains::GAINS;
use stm32f4xx_hal::pac::{DBGMCU, IWDG};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// A tenth of a second, or twenty control periods where that is longer.
const TIMEOUT_MS: u32 = {
    let periods = (20_000.0 * GAINS.sample_time) as u32;
    if periods > 100 { periods } else { 100 }
};

/// The running watchdog.
pub(crate) struct Watchdog(IndependentWatchdog);

impl Watchdog {
    pub(super) fn new(watchdog: IWDG, debug: &DBGMCU) -> Self {
        let mut watchdog = IndependentWatchdog::new(watchdog);
        watchdog.stop_on_debug(debug, false);
        watchdog.start(TIMEOUT_MS.millis());
        Self(watchdog)
    }

    /// All is well.
    pub(crate) fn feed(&mut self) {
        self.0.feed();
    }
}
