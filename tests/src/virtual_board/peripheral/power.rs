//! Power control [5.4]: the regulator, ready at once, and the voltage detector.

use super::{Peripheral, Unknown};

/// Enable of the voltage detector, and its output: the supply is too low.
const PVDE: u32 = 1 << 4;
const PVDO: u32 = 1 << 2;
/// Thresholds by PLS, V.
const LEVELS: [f64; 8] = [2.0, 2.1, 2.3, 2.5, 2.6, 2.7, 2.8, 2.9];

/// The registers.
#[derive(Clone, Debug)]
pub struct Power {
    cr: u32,
    /// V.
    supply: f64,
}

impl Default for Power {
    fn default() -> Self {
        Self { cr: 0, supply: 3.3 }
    }
}

impl Power {
    /// The supply from now on, V.
    pub fn set_supply(&mut self, volts: f64) {
        self.supply = volts;
    }

    /// Registers as after reset; the supply is what it is.
    pub fn reset(&mut self) {
        self.cr = 0;
    }

    /// Output of the voltage detector.
    #[must_use]
    pub fn too_low(&self) -> bool {
        self.cr & PVDE != 0 && self.supply < LEVELS[(self.cr >> 5 & 0b111) as usize]
    }
}

impl Peripheral for Power {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        match offset {
            0x00 => Ok(self.cr),
            // VOSRDY; ODRDY and ODSWRDY follow their enables.
            0x04 => {
                let low = if self.too_low() { PVDO } else { 0 };
                Ok(1 << 14 | self.cr & 0b11 << 16 | low)
            }
            _ => Err(Unknown),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        match offset {
            0x00 => self.cr = value,
            0x04 => {}
            _ => return Err(Unknown),
        }
        Ok(())
    }
}
