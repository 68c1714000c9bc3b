//! Crystal and supply: when one of them fails, the amplifier is switched off while the processor still can.
//!
//! * The clock security system watches the crystal; when it stops, the processor goes on with its internal
//!   oscillator and takes the non-maskable interrupt (reference manual RM0090, 7.2.7).
//! * The voltage detector watches the supply; below 2.7 V it raises interrupt 1 through line 16 of the external
//!   interrupts (5.2.2, 12.2.5). 3.3 V less ten per cent is no failure.
//!
//! Neither has a handler of its own: what nobody serves ends in [`safe_stop`](super::safe_stop). After the reset
//! that follows, a dead crystal keeps start-up waiting for it, the amplifier off. Where the supply goes lower
//! still, the brown-out level in the option bytes decides when the reset comes (2.7.1): set it to 3 when the
//! board is first flashed.

use stm32f4xx_hal::pac::{EXTI, Interrupt, NVIC, PWR};
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// Level of the voltage detector: 2.7 V (5.4.1, PLS).
const LEVEL: u8 = 0b101;

/// Starts both.
pub(super) fn watch(power: &PWR, lines: &EXTI, rcc: &mut Rcc) {
    PWR::enable(rcc);
    // SAFETY: three bits, every value of which is a level.
    power
        .cr()
        .modify(|_, w| unsafe { w.pls().bits(LEVEL) }.pvde().set_bit());
    // The detector's output rises when the supply falls.
    lines.rtsr().modify(|_, w| w.tr16().enabled());
    lines.imr().modify(|_, w| w.mr16().unmasked());
    // SAFETY: its handler ends the program, no critical section counts on it to be masked.
    unsafe { NVIC::unmask(Interrupt::PVD) };
    rcc.cr().modify(|_, w| w.csson().on());
}
