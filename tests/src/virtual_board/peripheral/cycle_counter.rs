//! Cycle counter of the debug unit (Armv7-M ARM, C1.8), and the trace enable it needs.

use super::{Peripheral, Unknown};

/// DWT, by offset from 0xE0001000.
#[derive(Clone, Debug, Default)]
pub struct CycleCounter {
    /// DEMCR.TRCENA.
    pub trace: bool,
    control: u32,
    offset: u64,
}

impl Peripheral for CycleCounter {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, Unknown> {
        let running = self.trace && self.control & 1 == 1;
        match offset {
            0x000 => Ok(0x4000_0000 | self.control),
            0x004 if running => Ok(now.wrapping_sub(self.offset) as u32),
            0x004 => Ok(0),
            _ => Err(Unknown),
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), Unknown> {
        match offset {
            0x000 => self.control = value & 0x0FFF_FFFF,
            0x004 => self.offset = now.wrapping_sub(value.into()),
            _ => return Err(Unknown),
        }
        Ok(())
    }
}
