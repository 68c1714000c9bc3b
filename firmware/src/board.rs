//! What the drive asks of a board, and what a board can do.

use crate::settings::Kept;
use arso_core::{Command, Counts, Current};

/// What a board can do; the settings of a drive are held against it.
#[derive(Clone, Copy, Debug)]
pub struct Capabilities {
    /// Width of the encoder's counter.
    pub counter_bits: u32,
    /// How many codes the converter of the current output has.
    pub converter_codes: u16,
    /// Shortest and longest control period, µs.
    pub periods: (u32, u32),
}

/// A board: its parts by type, and what it can do.
pub trait Board {
    /// What it can do.
    const CAPABILITIES: Capabilities;
    /// What gives the control interrupt.
    type Timer: ControlTimer;
    /// What counts the encoder.
    type Encoder: Encoder;
    /// What makes the current flow.
    type Output: CurrentOutput;
    /// What times the control interrupt.
    type Cycles: CycleCounter;
    /// Its run switch.
    type RunSwitch: RunSwitch;
    /// What its amplifier reports.
    type AmplifierFault: AmplifierFault;
    /// Its home switch.
    type HomeSwitch: HomeSwitch;
    /// Its other switches.
    type Inputs: Inputs;
    /// The line of its link.
    type Serial: Serial;
    /// What resets it when the program has died.
    type Watchdog: Watchdog;
    /// What keeps settings without power.
    type Storage: Storage;

    /// Sleeps until the next interrupt.
    fn wait_for_interrupt();

    /// Resets the processor.
    fn restart() -> !;
}

/// The spare slot of a board.
pub type SpareOf<B> = <<B as Board>::Storage as Storage>::Spare;

/// The parts of a board, set up, amplifier disabled.
pub struct Hardware<B: Board> {
    /// See [`Board::Timer`].
    pub timer: B::Timer,
    /// See [`Board::Encoder`].
    pub encoder: B::Encoder,
    /// See [`Board::Output`].
    pub output: B::Output,
    /// See [`Board::Cycles`].
    pub cycles: B::Cycles,
    /// See [`Board::RunSwitch`].
    pub run_switch: B::RunSwitch,
    /// See [`Board::AmplifierFault`].
    pub amplifier_fault: B::AmplifierFault,
    /// See [`Board::HomeSwitch`].
    pub home_switch: B::HomeSwitch,
    /// See [`Board::Inputs`].
    pub inputs: B::Inputs,
    /// See [`Board::Serial`].
    pub serial: B::Serial,
    /// See [`Board::Watchdog`].
    pub watchdog: B::Watchdog,
    /// What is kept in [`Board::Storage`], and what of it the drive may write.
    pub kept: Kept<SpareOf<B>>,
}

/// The timer of the control interrupt.
pub trait ControlTimer {
    /// Clears the interrupt that is being served.
    fn acknowledge(&mut self);
}

/// The encoder's counter.
pub trait Encoder {
    /// The counter now.
    fn count(&mut self) -> Counts;
}

/// Something that makes the commanded current flow.
pub trait CurrentOutput {
    /// Applies a command for the next period; returns the current that will flow.
    fn apply(&mut self, command: &Command) -> Current;
}

/// A counter of processor cycles; wraps.
pub trait CycleCounter {
    /// Cycles per second.
    const HZ: u32;
    /// Cycles now.
    fn now(&self) -> u32;
}

/// The run switch, read in every control period: an open one wins over everything.
pub trait RunSwitch {
    /// Whether it is closed; one that cannot be read is open.
    fn closed(&mut self) -> bool;
}

/// What the amplifier reports, read in every control period.
pub trait AmplifierFault {
    /// Whether it reports a fault; a line that cannot be read does.
    fn active(&mut self) -> bool;
}

/// The home switch, read in every control period: where it becomes active is where homing by input finds its place.
pub trait HomeSwitch {
    /// Whether it is active; one that cannot be read is not.
    fn active(&mut self) -> bool;
}

/// The switches that are no hurry.
pub trait Inputs {
    /// Levels now; an input that cannot be read counts as off.
    fn read(&mut self) -> Levels;
}

/// Levels of the switches.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Levels {
    /// A run plays the excitation instead of closing the loop.
    pub excite: bool,
    /// Where the machine stands is zero, when this goes on.
    pub zero: bool,
    /// Which target, 0 to 3.
    pub target: u8,
}

/// The line of the link, which moves its bytes without the processor's help.
pub trait Serial {
    /// A byte that has come, the oldest first.
    fn read(&mut self) -> Option<u8>;

    /// Begins to send as many as [`WAITING`](arso_core::link::server::WAITING) bytes, unless earlier ones are still
    /// leaving; whether it does.
    fn send(&mut self, bytes: &[u8]) -> bool;
}

/// What resets the processor unless it is fed.
pub trait Watchdog {
    /// All is well.
    fn feed(&mut self);

    /// From now on it waits for as long as the flash takes.
    fn wait_for_flash(&mut self);
}

/// One of the two places in which a set of settings is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Slot {
    /// One.
    First,
    /// The other.
    Second,
}

/// Two slots in flash.
pub trait Storage {
    /// The one that is not used.
    type Spare: Spare;

    /// What a slot holds, from an even address on.
    fn read(&self, slot: Slot) -> &[u8];

    /// The slot that is used, whose content stays from now on, and the other one. With none in use nothing is, and
    /// the first is spare.
    fn divide(self, used: Option<Slot>) -> (&'static [u8], Self::Spare);
}

/// Flash that was not erased or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashError;

/// A slot that may be written; the processor stands still while it is.
pub trait Spare {
    /// What it holds.
    fn read(&self) -> &[u8];

    /// Erases it.
    ///
    /// # Errors
    /// [`FlashError`].
    fn erase(&mut self) -> Result<(), FlashError>;

    /// Writes bytes from a place on, which must be erased or hold the same.
    ///
    /// # Errors
    /// [`FlashError`].
    fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), FlashError>;
}
