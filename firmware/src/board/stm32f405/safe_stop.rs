//! The end of the road: panic, fault of the processor, interrupt that nobody serves.
//!
//! The amplifier is switched off first, by registers alone, whatever state the program is in;
//! then nothing more is done until the watchdog resets the processor, which comes up idle.

use super::current_output::zero_code;
use core::sync::atomic::{Ordering, compiler_fence};
use cortex_m_rt::{ExceptionFrame, exception};
use stm32f4xx_hal::pac;

/// Switches the amplifier off and halts.
pub(crate) fn stop() -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: single writes that only switch off; no other code runs after this, and the reset
    // state of both peripherals is off as well.
    unsafe {
        (*pac::GPIOB::ptr()).bsrr().write(|w| w.br12().set_bit());
        (*pac::DAC::ptr())
            .dhr12r1()
            .write(|w| w.bits(zero_code().into()));
    }
    loop {
        compiler_fence(Ordering::SeqCst);
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    stop()
}

#[exception]
// SAFETY: never returns to what faulted.
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    stop()
}

#[exception]
// SAFETY: as above, for every exception and interrupt without a handler.
unsafe fn DefaultHandler(_: i16) -> ! {
    stop()
}
