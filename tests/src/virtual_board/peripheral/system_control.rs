//! System control block (Armv7-M ARM, B3.2): vector table, floating-point access, reset request.
//!
//! Priorities and the active exception belong to the interrupt controller; the bus puts them in.

use super::{Peripheral, Unknown};

/// The registers that are kept here, by offset from 0xE000ED00.
#[derive(Clone, Debug)]
pub struct SystemControl {
    /// Address of the vector table.
    pub vector_table: u32,
    scr: u32,
    ccr: u32,
    shcsr: u32,
    cpacr: u32,
    fpccr: u32,
    fpdscr: u32,
    /// SYSRESETREQ was written.
    pub reset_requested: bool,
}

impl Default for SystemControl {
    fn default() -> Self {
        Self {
            vector_table: 0,
            scr: 0,
            ccr: 0x200,
            shcsr: 0,
            cpacr: 0,
            fpccr: 0xC000_0000,
            fpdscr: 0,
            reset_requested: false,
        }
    }
}

impl Peripheral for SystemControl {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        Ok(match offset {
            // Cortex-M4 r0p1.
            0x00 => 0x410F_C241,
            0x08 => self.vector_table,
            0x0C => 0xFA05_0000,
            0x10 => self.scr,
            0x14 => self.ccr,
            0x24 => self.shcsr,
            0x28 | 0x2C => 0,
            0x88 => self.cpacr,
            0x234 => self.fpccr,
            0x23C => self.fpdscr,
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        match offset {
            0x08 => self.vector_table = value & !0x1FF,
            0x0C => self.reset_requested |= value == 0x05FA_0004,
            0x10 => self.scr = value,
            0x14 => self.ccr = value,
            0x24 => self.shcsr = value,
            0x88 => self.cpacr = value,
            0x234 => self.fpccr = value,
            0x23C => self.fpdscr = value,
            _ => return Err(Unknown),
        }
        Ok(())
    }
}
