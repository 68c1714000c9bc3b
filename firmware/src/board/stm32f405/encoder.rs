//! TIM3 in encoder mode: quadrature decoding of PC6 (A) and PC7 (B) in hardware, x4, 16 bits.
//!
//! Written on the registers because the encoder interface of the HAL has no input filter: each
//! level must stand for 8 cycles of the 84 MHz timer clock (95 ns) to count, which removes glitches
//! and passes 10 million counts per second.

use arso_core::Counts;
use arso_firmware::board;
use stm32f4xx_hal::gpio::{PushPull, gpioc};
use stm32f4xx_hal::pac::TIM3;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};
use stm32f4xx_hal::timer::CPin;

/// What TIM3 counts.
pub(super) const COUNTER_BITS: u32 = 16;

/// IC1F, IC2F: eight samples at the timer clock must agree (reference manual RM0090, 18.4.7).
const FILTER: u8 = 0b0011;

type PhaseA = <TIM3 as CPin<0>>::Ch<PushPull>;
type PhaseB = <TIM3 as CPin<1>>::Ch<PushPull>;

/// The counting timer.
pub(crate) struct QuadratureEncoder {
    timer: TIM3,
    _phases: (PhaseA, PhaseB),
}

impl QuadratureEncoder {
    pub(super) fn new(timer: TIM3, a: gpioc::PC6, b: gpioc::PC7, rcc: &mut Rcc) -> Self {
        TIM3::enable(rcc);
        TIM3::reset(rcc);
        timer.ccmr1_input().write(|w| {
            // SAFETY: four-bit fields, every value of which is a filter setting.
            unsafe { w.ic1f().bits(FILTER).ic2f().bits(FILTER) };
            w.cc1s().ti1().cc2s().ti2()
        });
        timer.smcr().write(|w| w.sms().encoder_mode_3());
        // SAFETY: the whole 16-bit range is a valid reload value.
        timer.arr().write(|w| unsafe { w.arr().bits(u16::MAX) });
        timer.cr1().write(|w| w.cen().enabled());
        Self {
            timer,
            _phases: (a.into(), b.into()),
        }
    }
}

impl board::Encoder for QuadratureEncoder {
    fn count(&mut self) -> Counts {
        Counts(self.timer.cnt().read().cnt().bits().into())
    }
}
