//! Current command: an analogue reference to a servo amplifier, and its enable line.
//!
//! The amplifier takes 0 to 3.3 V, half of it for zero current. Twelve bits and 1 mA per step
//! reach ±2.047 A.

use arso_core::{Command, Current};
use arso_firmware::board::CurrentOutput;
use embedded_hal::digital::OutputPin;
use stm32f4xx_hal::dac::{C1, DacExt, DacOut, DacPin};
use stm32f4xx_hal::gpio::{Output, gpioa, gpiob};
use stm32f4xx_hal::pac::DAC;
use stm32f4xx_hal::rcc::Rcc;

/// What one step of the converter means to the amplifier, A.
pub(super) const AMPERES_PER_CODE: f32 = 1e-3;
/// What twelve bits reach, A.
pub(super) const LARGEST_CURRENT: f32 = 2047.0 * AMPERES_PER_CODE;

/// Twelve-bit code of the converter.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct DacCode(u16);

impl DacCode {
    /// No current.
    pub(crate) const ZERO: Self = Self(2048);

    /// The code for a current, saturating; what is no number is no current.
    fn from_current(current: Current) -> Self {
        // The cast saturates and makes zero of NaN.
        let steps = current.0 / AMPERES_PER_CODE;
        let rounded = (steps + if steps < 0.0 { -0.5 } else { 0.5 }) as i32;
        Self((rounded.clamp(-2047, 2047) + 2048) as u16)
    }

    /// The current that a code makes.
    fn current(self) -> Current {
        Current((f32::from(self.0) - 2048.0) * AMPERES_PER_CODE)
    }

    /// The register's value.
    pub(crate) fn bits(self) -> u16 {
        self.0
    }
}

/// DAC channel 1 on PA4, enable on a pin.
pub(crate) struct DacOutput<Enable = gpiob::PB12<Output>> {
    dac: C1,
    enable: Enable,
}

impl<Enable: OutputPin> DacOutput<Enable> {
    /// Starts at zero current, disabled.
    pub(super) fn new(dac: DAC, pin: gpioa::PA4, mut enable: Enable, rcc: &mut Rcc) -> Self {
        // The pins of the microcontroller cannot fail.
        let _ = enable.set_low();
        let mut dac = dac.constrain(pin.into_analog(), rcc);
        dac.set_value(DacCode::ZERO.bits());
        dac.enable();
        Self { dac, enable }
    }
}

impl<Enable: OutputPin> CurrentOutput for DacOutput<Enable> {
    fn apply(&mut self, command: &Command) -> Current {
        if command.enable {
            let code = DacCode::from_current(command.current);
            self.dac.set_value(code.bits());
            let _ = self.enable.set_high();
            code.current()
        } else {
            let _ = self.enable.set_low();
            self.dac.set_value(DacCode::ZERO.bits());
            Current(0.0)
        }
    }
}
