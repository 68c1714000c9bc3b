//! A board that does nothing: what a second board has to say, and all of it.
//!
//! `tests/run` compiles it (it is never flashed), so that nothing of the drive can come to depend on the
//! board that there is.
#![no_std]
#![no_main]

use arso_core::link::image::PlanTable;
use arso_core::{Command, Counts, Current};
use arso_firmware::board::{
    AmplifierFault, Board, Capabilities, ControlTimer, CurrentOutput, CycleCounter, Encoder,
    FlashError, Hardware, HomeSwitch, Inputs, Levels, RunSwitch, Serial, Slot, Spare, Storage,
    Watchdog,
};
use arso_firmware::drive::{self, LastMoves, Queues};
use arso_firmware::settings::choose;
use cortex_m_rt::entry;

struct Blank;

impl Board for Blank {
    const CAPABILITIES: Capabilities = Capabilities {
        counter_bits: 16,
        converter_codes: 4096,
        periods: (1, 1_000_000),
    };
    type Timer = Self;
    type Encoder = Self;
    type Output = Self;
    type Cycles = Self;
    type RunSwitch = Self;
    type AmplifierFault = Self;
    type HomeSwitch = Self;
    type Inputs = Self;
    type Serial = Self;
    type Watchdog = Self;
    type Storage = Self;

    fn wait_for_interrupt() {}

    fn restart() -> ! {
        loop {
            cortex_m::asm::nop();
        }
    }
}

impl ControlTimer for Blank {
    fn acknowledge(&mut self) {}
}

impl Encoder for Blank {
    fn count(&mut self) -> Counts {
        Counts(0)
    }
}

impl CurrentOutput for Blank {
    fn apply(&mut self, _: &Command) -> Current {
        Current(0.0)
    }
}

impl CycleCounter for Blank {
    const HZ: u32 = 1_000_000;

    fn now(&self) -> u32 {
        0
    }
}

impl RunSwitch for Blank {
    fn closed(&mut self) -> bool {
        false
    }
}

impl AmplifierFault for Blank {
    fn active(&mut self) -> bool {
        false
    }
}

impl HomeSwitch for Blank {
    fn active(&mut self) -> bool {
        false
    }
}

impl Inputs for Blank {
    fn read(&mut self) -> Levels {
        Levels::default()
    }
}

impl Serial for Blank {
    fn read(&mut self) -> Option<u8> {
        None
    }

    fn send(&mut self, _: &[u8]) -> bool {
        false
    }
}

impl Watchdog for Blank {
    fn feed(&mut self) {}

    fn wait_for_flash(&mut self) {}
}

impl Storage for Blank {
    type Spare = Self;

    fn read(&self, _: Slot) -> &[u8] {
        &[]
    }

    fn divide(self, _: Option<Slot>) -> (&'static [u8], Self) {
        (&[], self)
    }
}

impl Spare for Blank {
    fn read(&self) -> &[u8] {
        &[]
    }

    fn erase(&mut self) -> Result<(), FlashError> {
        Err(FlashError)
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), FlashError> {
        Err(FlashError)
    }
}

#[entry]
fn main() -> ! {
    static mut QUEUES: Queues = Queues::new();
    static LAST_MOVES: LastMoves = LastMoves::new();
    static mut PLANS: PlanTable = PlanTable::new();
    let (set, kept) = choose(Blank, PLANS, &Blank::CAPABILITIES);
    let hardware = Hardware::<Blank> {
        timer: Blank,
        encoder: Blank,
        output: Blank,
        cycles: Blank,
        run_switch: Blank,
        amplifier_fault: Blank,
        home_switch: Blank,
        inputs: Blank,
        serial: Blank,
        watchdog: Blank,
        kept,
    };
    if let Ok((mut control, mut idle)) = drive::new(hardware, set, QUEUES, &LAST_MOVES) {
        control.period();
        idle.run();
    }
    loop {
        cortex_m::asm::nop();
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        cortex_m::asm::nop();
    }
}
