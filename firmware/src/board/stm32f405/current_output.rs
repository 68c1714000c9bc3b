//! Current command: an analogue reference to a servo amplifier, and its enable line.
//!
//! Twelve bits, 0 to 3.3 V; what a code means to the amplifier is the drive's ([`Amplifier`]).

use arso_core::amplifier::Amplifier;
use arso_core::{Command, Current};
use arso_firmware::board::CurrentOutput;
use core::sync::atomic::{AtomicU16, Ordering};
use embedded_hal::digital::OutputPin;
use stm32f4xx_hal::dac::{C1, DacExt, DacOut, DacPin};
use stm32f4xx_hal::gpio::{Output, gpioa, gpiob};
use stm32f4xx_hal::pac::DAC;
use stm32f4xx_hal::rcc::Rcc;

/// Codes of the converter.
pub(super) const CODES: u16 = 4096;

/// Code of no current, for who switches off without knowing the drive.
static ZERO_CODE: AtomicU16 = AtomicU16::new(CODES / 2);

/// Code of no current.
pub(super) fn zero_code() -> u16 {
    ZERO_CODE.load(Ordering::Relaxed)
}

/// DAC channel 1 on PA4, enable on a pin.
pub(crate) struct DacOutput<Enable = gpiob::PB12<Output>> {
    dac: C1,
    enable: Enable,
    amplifier: Amplifier,
}

impl<Enable: OutputPin> DacOutput<Enable> {
    /// Starts at zero current, disabled.
    pub(super) fn new(
        dac: DAC,
        pin: gpioa::PA4,
        mut enable: Enable,
        amplifier: Amplifier,
        rcc: &mut Rcc,
    ) -> Self {
        ZERO_CODE.store(amplifier.zero_code, Ordering::Relaxed);
        // The pins of the microcontroller cannot fail.
        let _ = enable.set_low();
        let mut dac = dac.constrain(pin.into_analog(), rcc);
        dac.set_value(amplifier.zero_code);
        dac.enable();
        Self {
            dac,
            enable,
            amplifier,
        }
    }
}

impl<Enable: OutputPin> CurrentOutput for DacOutput<Enable> {
    fn apply(&mut self, command: &Command) -> Current {
        if command.enable {
            let code = self.amplifier.code(command.current, CODES);
            self.dac.set_value(code);
            let _ = self.enable.set_high();
            self.amplifier.current(code)
        } else {
            let _ = self.enable.set_low();
            self.dac.set_value(self.amplifier.zero_code);
            Current(0.0)
        }
    }
}
