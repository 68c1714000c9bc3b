//! The drive board: STM32F405RG, crystal of 8 MHz.
//!
//! | pin | what |
//! |---|---|
//! | PC6, PC7 | encoder phases A, B (TIM3) |
//! | PA4 | current reference to the servo amplifier (DAC channel 1); needs a pull to half of 3.3 V, as PB12 below |
//! | PB12 | amplifier enable, high: enabled; needs a pull-down, the pin floats during reset |
//! | PB13 | amplifier fault, low: fault |
//! | PC2 | run switch |
//! | PC3 | excite switch |
//! | PC4 | zero switch |
//! | PC5 | home switch |
//! | PC0, PC1 | target switches, low and high bit |
//! | PA9, PA10 | link: what it sends and what it receives (USART1, 1 Mbaud, 8N1) |
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
mod serial;
mod storage;
mod supply;
mod watchdog;

pub(crate) use safe_stop::stop;

use arso_core::link::image::PlanTable;
use arso_firmware::board::{Board, Capabilities, Hardware};
use arso_firmware::settings::{Set, choose, period_us};
use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Config;

/// Processor clock; the timers on APB1 run at half of it.
const CLOCK_HZ: u32 = 168_000_000;

/// This board.
pub(crate) struct Stm32f405;

impl Board for Stm32f405 {
    const CAPABILITIES: Capabilities = Capabilities {
        counter_bits: encoder::COUNTER_BITS,
        converter_codes: current_output::CODES,
        periods: control_timer::PERIODS_US,
    };
    type Timer = control_timer::ControlTimer;
    type Encoder = encoder::QuadratureEncoder;
    type Output = current_output::DacOutput;
    type Cycles = cycles::Cycles;
    type RunSwitch = inputs::RunSwitch;
    type AmplifierFault = inputs::AmplifierFault;
    type HomeSwitch = inputs::HomeSwitch;
    type Inputs = inputs::Switches;
    type Serial = serial::SerialLine;
    type Watchdog = watchdog::ResetWatchdog;
    type Storage = storage::Slots;

    fn wait_for_interrupt() {
        cortex_m::asm::wfi();
    }

    fn restart() -> ! {
        cortex_m::peripheral::SCB::sys_reset();
    }
}

/// Sets the board up for the settings that the drive runs with; the amplifier is disabled throughout. The control
/// interrupt starts when interrupts are enabled.
///
/// * `plans`: room for those that are kept in flash
pub(crate) fn start(
    device: pac::Peripherals,
    core: cortex_m::Peripherals,
    plans: &'static mut PlanTable,
) -> (Hardware<Stm32f405>, Set) {
    rtt::start();
    let mut rcc = device
        .RCC
        .freeze(Config::hse(8.MHz()).sysclk(CLOCK_HZ.Hz()));
    supply::watch(&device.PWR, &device.EXTI, &mut rcc);
    let slots = storage::Slots::new(device.FLASH);
    let (set, kept) = choose(slots, plans, &Stm32f405::CAPABILITIES);
    let period_us = period_us(&set.settings);
    let port_a = device.GPIOA.split(&mut rcc);
    let port_b = device.GPIOB.split(&mut rcc);
    let port_c = device.GPIOC.split(&mut rcc);
    let hardware = Hardware {
        output: current_output::DacOutput::new(
            device.DAC,
            port_a.pa4,
            port_b.pb12.into_push_pull_output(),
            set.settings.amplifier,
            &mut rcc,
        ),
        encoder: encoder::QuadratureEncoder::new(device.TIM3, port_c.pc6, port_c.pc7, &mut rcc),
        cycles: cycles::Cycles::new(core.DCB, core.DWT),
        run_switch: inputs::RunSwitch(port_c.pc2.into_pull_down_input()),
        amplifier_fault: inputs::AmplifierFault(port_b.pb13.into_pull_up_input()),
        home_switch: inputs::HomeSwitch(port_c.pc5.into_pull_down_input()),
        inputs: inputs::Switches::new(
            port_c.pc3.into_pull_down_input(),
            port_c.pc4.into_pull_down_input(),
            port_c.pc0.into_pull_down_input(),
            port_c.pc1.into_pull_down_input(),
        ),
        serial: serial::SerialLine::new(
            device.USART1,
            device.DMA2,
            port_a.pa9,
            port_a.pa10,
            &mut rcc,
        ),
        watchdog: watchdog::ResetWatchdog::new(device.IWDG, &device.DBGMCU, period_us),
        timer: control_timer::ControlTimer::new(device.TIM2, period_us, &mut rcc),
        kept,
    };
    (hardware, set)
}
