//! The drive board: STM32F405RG, crystal of 8 MHz.
//!
//! | pin | what |
//! |---|---|
//! | PC6, PC7 | encoder phases A, B (TIM3) |
//! | PA4 | current reference to the servo amplifier (DAC channel 1) |
//! | PB12 | amplifier enable, high: enabled |
//! | PC2 | run switch |
//! | PC3 | excite switch |
//! | PC0, PC1 | target switches, low and high bit |
//!
//! One file per peripheral. The only `unsafe` of the firmware is in here, each with its reason.
#![allow(unsafe_code, reason = "this is where the hardware is touched")]

mod control_timer;
mod current_output;
mod cycles;
mod encoder;
mod inputs;
mod rtt;
mod safe_stop;
mod watchdog;

pub(crate) use control_timer::ControlTimer;
pub(crate) use current_output::{CurrentOutput, DacOutput};
pub(crate) use cycles::Cycles;
pub(crate) use encoder::Encoder;
pub(crate) use inputs::{Inputs, Levels};
pub(crate) use safe_stop::stop;
pub(crate) use watchdog::Watchdog;

use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Config;

/// Processor clock; the timers on APB1 run at half of it.
const CLOCK_HZ: u32 = 168_000_000;

/// Everything the drive uses, set up; the control interrupt starts when interrupts are enabled.
pub(crate) struct Board {
    pub(crate) timer: ControlTimer,
    pub(crate) encoder: Encoder,
    pub(crate) output: DacOutput,
    pub(crate) cycles: Cycles,
    pub(crate) inputs: Inputs,
    pub(crate) watchdog: Watchdog,
}

/// Sets the board up; the amplifier is disabled throughout.
pub(crate) fn start(device: pac::Peripherals, core: cortex_m::Peripherals) -> Board {
    rtt::start();
    let mut rcc = device
        .RCC
        .freeze(Config::hse(8.MHz()).sysclk(CLOCK_HZ.Hz()));
    let port_a = device.GPIOA.split(&mut rcc);
    let port_b = device.GPIOB.split(&mut rcc);
    let port_c = device.GPIOC.split(&mut rcc);
    Board {
        output: DacOutput::new(
            device.DAC,
            port_a.pa4,
            port_b.pb12.into_push_pull_output(),
            &mut rcc,
        ),
        encoder: Encoder::new(device.TIM3, port_c.pc6, port_c.pc7, &mut rcc),
        cycles: Cycles::new(core.DCB, core.DWT),
        inputs: Inputs::new(
            port_c.pc2.into_pull_down_input(),
            port_c.pc3.into_pull_down_input(),
            port_c.pc0.into_pull_down_input(),
            port_c.pc1.into_pull_down_input(),
        ),
        watchdog: Watchdog::new(device.IWDG, &device.DBGMCU),
        timer: ControlTimer::new(device.TIM2, &mut rcc),
    }
}

/// Sleeps until the next interrupt.
pub(crate) fn wait_for_interrupt() {
    cortex_m::asm::wfi();
}
