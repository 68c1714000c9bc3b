//! Power control [5.4]: the regulator, ready at once.

use super::{Peripheral, Unknown};

/// The registers.
#[derive(Clone, Debug, Default)]
pub struct Power {
    cr: u32,
}

impl Peripheral for Power {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        match offset {
            0x00 => Ok(self.cr),
            // VOSRDY; ODRDY and ODSWRDY follow their enables.
            0x04 => Ok(1 << 14 | self.cr & 0b11 << 16),
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
