//! Digital-to-analogue converter, channel 1 [14]: no trigger, right-aligned 12 bits.

use super::{Peripheral, Unknown};

/// The registers of channel 1.
#[derive(Clone, Debug, Default)]
pub struct Converter {
    cr: u32,
    data: u32,
}

impl Converter {
    /// The code on the output, while the channel is enabled.
    #[must_use]
    pub fn output(&self) -> Option<u16> {
        (self.cr & 1 == 1).then_some(self.data as u16)
    }
}

impl Peripheral for Converter {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        Ok(match offset {
            0x00 => self.cr,
            0x08 | 0x2C => self.data,
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        match offset {
            // Triggers, waves and DMA are not modelled.
            0x00 if value & !0b11 == 0 => self.cr = value,
            0x08 => self.data = value & 0xFFF,
            _ => return Err(Unknown),
        }
        Ok(())
    }
}
