//! TIM2: one update interrupt per control period.

use arso_firmware::board;
use stm32f4xx_hal::pac::TIM2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::timer::{CounterUs, Event, Flag};

/// Shortest and longest period, µs: 20 kHz, and what leaves the link an answer in time.
pub(super) const PERIODS_US: (u32, u32) = (50, 100_000);

/// The running timer.
pub(crate) struct ControlTimer(CounterUs<TIM2>);

impl ControlTimer {
    pub(super) fn new(timer: TIM2, period_us: u32, rcc: &mut Rcc) -> Self {
        let mut counter = timer.counter_us(rcc);
        // The period is at most 1 s and fits the 32 bits of this timer.
        if counter.start(period_us.micros()).is_err() {
            super::stop();
        }
        counter.listen(Event::Update);
        Self(counter)
    }
}

impl board::ControlTimer for ControlTimer {
    fn acknowledge(&mut self) {
        self.0.clear_flags(Flag::Update);
    }
}
