//! The peripherals of the microcontroller that the firmware uses, one small model each.

pub mod converter;
pub mod cycle_counter;
pub mod dma;
pub mod encoder_timer;
pub mod external_lines;
pub mod flash;
pub mod gpio;
pub mod power;
pub mod rcc;
pub mod system_control;
pub mod systick;
pub mod tick_timer;
pub mod usart;
pub mod watchdog;

/// No model knows this register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unknown;

/// Registers at offsets from a base address; words only, the bus assembles the rest.
pub trait Peripheral {
    /// Reads a register at a time in processor cycles.
    ///
    /// # Errors
    /// No such register.
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, Unknown>;

    /// Writes a register.
    ///
    /// # Errors
    /// No such register.
    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), Unknown>;
}
