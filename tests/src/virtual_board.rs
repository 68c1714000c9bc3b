//! A virtual drive board: runs the release ELF of the firmware, unmodified, on an emulated
//! STM32F405.
//!
//! ```text
//! ELF -> memory -> cpu (Cortex-M4F, instruction by instruction) <-> bus -> peripherals
//!                    ^ exceptions: nvic                                       |
//!                    +---- time: cycles of each instruction (timing)          |
//!        plant <- amplifier <- converter and enable pin <---------------------+
//!          +----> quadrature edges -> encoder timer
//!        world <-> USART1 <-- DMA2 --> memory
//! ```
//!
//! Deterministic: there is no clock but the processor's own cycles. A register that no model
//! knows is an error with address and program counter, never silently zero; a peripheral without
//! its clock behaves as the hardware does (reads zero, ignores writes). What the firmware keeps in flash outlives
//! resets and power cycles, and the power can be cut in the midst of writing it.
//!
//! Numbers in brackets are sections of the reference manual RM0090, unless the Armv7-M
//! architecture reference manual is named.

pub mod bus;
pub mod cpu;
pub mod harm;
pub mod host;
pub mod image;
pub mod nvic;
pub mod peripheral;
pub mod profile;
pub mod rig;
pub mod rtt;
pub mod serial;
pub mod timing;

pub use cpu::{Board, Stop};
pub use rig::Rig;
