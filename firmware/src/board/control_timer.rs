//! TIM2: one update interrupt per control period.

use crate::gains::GAINS;
use stm32f4xx_hal::pac::TIM2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::timer::{CounterUs, Event, Flag};

/// The control period in microseconds, which is what the timer counts.
const PERIOD_US: u32 = (GAINS.sample_time * 1e6 + 0.5) as u32;
const _: () = {
    let error = GAINS.sample_time * 1e6 - PERIOD_US as f32;
    // f32 holds the period to seven figures.
    let tolerance = 1e-6 * PERIOD_US as f32;
    assert!(
        PERIOD_US > 0 && error < tolerance && error > -tolerance,
        "sample_time must be a whole number of microseconds"
    );
};

/// The running timer.
pub(crate) struct ControlTimer(CounterUs<TIM2>);

impl ControlTimer {
    pub(super) fn new(timer: TIM2, rcc: &mut Rcc) -> Self {
        let mut counter = timer.counter_us(rcc);
        // The period is at most 1 s and fits the 32 bits of this timer.
        if counter.start(PERIOD_US.micros()).is_err() {
            super::stop();
        }
        counter.listen(Event::Update);
        Self(counter)
    }

    /// Clears the interrupt that is being served.
    pub(crate) fn acknowledge(&mut self) {
        self.0.clear_flags(Flag::Update);
    }
}
