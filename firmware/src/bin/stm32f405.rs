//! The drive on the STM32F405: start-up, interrupts and their priorities.
//!
//! TIM2's update is the control interrupt, the highest priority there is; everything else happens in
//! the idle loop. What both do is in `arso_firmware::drive`, what touches the hardware in [`board`].
#![cfg_attr(target_os = "none", no_std, no_main)]
#![deny(unsafe_code)]

#[cfg(not(target_os = "none"))]
compile_error!(
    "the firmware is built for the drive board: `cargo fw`, or tests/build-firmware where the \
     target thumbv7em-none-eabihf is not installed"
);

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[path = "../board/stm32f405/mod.rs"]
mod board;

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac)]
mod app {
    use crate::board::{self, Stm32f405};
    use arso_core::link::image::PlanTable;
    use arso_firmware::drive::{self, Control, Idle, LastMoves, Queues};

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        control: Control<Stm32f405>,
        idle: Idle<Stm32f405>,
    }

    #[init(local = [
        queues: Queues = Queues::new(),
        last_moves: LastMoves = LastMoves::new(),
        plans: PlanTable = PlanTable::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let init::LocalResources {
            queues,
            last_moves,
            plans,
            ..
        } = cx.local;
        let (hardware, set) = board::start(cx.device, cx.core, plans);
        let Ok((control, idle)) = drive::new(hardware, set, queues, last_moves) else {
            defmt::error!("the gains of this firmware cannot be run");
            board::stop();
        };
        (Shared {}, Local { control, idle })
    }

    /// One control period. The highest priority there is: no critical section masks it.
    #[task(binds = TIM2, priority = 16, local = [control])]
    fn control(cx: control::Context) {
        cx.local.control.period();
    }

    /// Everything that may take its time.
    #[idle(local = [idle])]
    fn idle(cx: idle::Context) -> ! {
        cx.local.idle.run()
    }
}
