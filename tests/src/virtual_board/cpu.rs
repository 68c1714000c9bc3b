//! The processor: instructions by the Unicorn emulator, exceptions and time by this file.
//!
//! The emulator executes code and floating point; it takes no interrupt by itself. Before every
//! instruction a hook adds its cycles to the time and stops the emulator when something is due:
//! a timer, a pending exception, sleep. Exceptions are then entered and left here as the
//! architecture says (Armv7-M ARM, B1.5), always with the floating-point frame. Inside an IT block
//! an exception waits for its end, as it might on the real processor.
//!
//! Every return from an exception compares all registers with those before its entry.

mod flash;
mod hardware;
mod restart;
mod snapshot;
mod transfers;

pub use snapshot::Snapshot;

use super::bus::Bus;
use super::image::{FLASH, FLASH_SIZE, Image, RAM, RAM_SIZE};
use super::peripheral::flash::FlashInterface;
use super::profile::Counts;
use super::timing::{self, Instruction};
use std::fmt;
use unicorn_engine::{Arch, Mode, Prot, RegisterARM, Unicorn, uc_error};

/// Why the board cannot go on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The firmware touched a register that no model knows.
    UnknownRegister {
        /// The register.
        address: u32,
        /// What was written; nothing for a read.
        written: Option<u32>,
        /// The instruction.
        pc: u32,
    },
    /// The processor would have taken a fault: access outside of memory, undefined instruction.
    Fault {
        /// The instruction.
        pc: u32,
        /// What the emulator says.
        error: String,
    },
    /// The firmware has halted: an endless loop with interrupts masked.
    Halted {
        /// Where.
        pc: u32,
    },
    /// The firmware sleeps and nothing will wake it.
    AsleepForever,
    /// No control period has begun for a second.
    NoTick,
    /// The watchdog was not fed.
    WatchdogReset,
    /// The firmware asked for a reset.
    ResetRequested,
    /// The power has ended in an operation of the flash interface, as was asked for.
    PowerCut,
    /// The drive does not come to hold its load though it is asked to.
    NotCommissioned,
    /// The drive does not play its excitation though it is asked to, or does not end it.
    NotExcited,
    /// A fault of the processor while it was handling one, or without memory to stack to.
    LockedUp {
        /// Where.
        pc: u32,
    },
    /// Registers after an exception differ from those before it.
    RegistersDamaged {
        /// Where the exception was taken.
        pc: u32,
    },
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Stop::UnknownRegister {
                address,
                written: None,
                pc,
            } => {
                write!(
                    f,
                    "read of the unknown register {address:#010x} at pc {pc:#010x}"
                )
            }
            Stop::UnknownRegister {
                address,
                written: Some(value),
                pc,
            } => write!(
                f,
                "write of {value:#010x} to the unknown register {address:#010x} at pc {pc:#010x}"
            ),
            Stop::Fault { pc, error } => write!(f, "processor fault at pc {pc:#010x}: {error}"),
            Stop::Halted { pc } => write!(f, "the firmware has halted at pc {pc:#010x}"),
            Stop::AsleepForever => f.write_str("the firmware sleeps and nothing will wake it"),
            Stop::NoTick => f.write_str("no control period has begun for a second"),
            Stop::WatchdogReset => f.write_str("the watchdog was not fed in time"),
            Stop::ResetRequested => f.write_str("the firmware asked for a reset"),
            Stop::PowerCut => f.write_str("the power has ended"),
            Stop::NotCommissioned => f.write_str("the drive does not close its loop"),
            Stop::NotExcited => f.write_str("the drive does not play its excitation"),
            Stop::LockedUp { pc } => write!(f, "the processor has locked up at pc {pc:#010x}"),
            Stop::RegistersDamaged { pc } => {
                write!(
                    f,
                    "an exception taken at pc {pc:#010x} came back with other registers"
                )
            }
        }
    }
}

/// Why the emulator was stopped by a hook.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Pause {
    Due,
    Sleep(u32),
    ExceptionReturn,
    Error(Stop),
}

/// What the hooks work on.
struct Machine {
    bus: Bus,
    code: Vec<Instruction>,
    instructions: u64,
    it_left: u8,
    after_memory: bool,
    next_pc: u32,
    previous_pc: u32,
    /// When something is due.
    deadline: u64,
    /// When whoever runs the board wants it back.
    limit: u64,
    /// Something is pending, though perhaps masked: look at every instruction.
    alert: bool,
    pause: Option<Pause>,
    /// What the control interrupt executes, where that is counted.
    profile: Option<Counts>,
}

impl Machine {
    /// After anything that can change what is due.
    fn reschedule(&mut self) {
        self.deadline = if self.bus.flash.busy() {
            self.bus.now
        } else {
            self.bus.next_event().unwrap_or(u64::MAX).min(self.limit)
        };
        self.alert = self.bus.nvic.any_pending();
    }
}

/// Counts of the control interrupt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InterruptCost {
    /// How often it ran.
    pub runs: u64,
    /// Instructions of all runs.
    pub instructions: u64,
    /// Instructions of the longest run.
    pub most_instructions: u64,
    /// Estimated cycles of all runs, entry and exit included.
    pub cycles: u64,
    /// Estimated cycles of the longest run.
    pub most_cycles: u64,
    /// How often it interrupted work instead of sleep.
    pub preemptions: u64,
}

/// Everything the program can see of the processor: r0 to r12, sp, lr, pc, xpsr, s0 to s31, fpscr.
type Registers = Vec<u64>;

/// r0 to xpsr and fpscr, in the order of [`Registers`].
const GENERAL: [RegisterARM; 18] = [
    RegisterARM::R0,
    RegisterARM::R1,
    RegisterARM::R2,
    RegisterARM::R3,
    RegisterARM::R4,
    RegisterARM::R5,
    RegisterARM::R6,
    RegisterARM::R7,
    RegisterARM::R8,
    RegisterARM::R9,
    RegisterARM::R10,
    RegisterARM::R11,
    RegisterARM::R12,
    RegisterARM::SP,
    RegisterARM::LR,
    RegisterARM::PC,
    RegisterARM::XPSR,
    RegisterARM::FPSCR,
];

/// Of these, the floating-point ones.
const FLOATS: usize = 32;

/// What an exception does not save, and the program can set all the same.
const MASKS: [RegisterARM; 4] = [
    RegisterARM::PRIMASK,
    RegisterARM::BASEPRI,
    RegisterARM::FAULTMASK,
    RegisterARM::CONTROL,
];

/// An exception in progress.
#[derive(Clone, Debug)]
struct Frame {
    exception: u32,
    before: Registers,
    pc: u32,
    start: (u64, u64),
}

/// The board: processor, memory, peripherals.
pub struct Board {
    uc: Unicorn<'static, Machine>,
    frames: Vec<Frame>,
    asleep: bool,
    /// Nothing runs any more; only [`Board::run_for`] goes on then.
    dead: Option<Stop>,
    /// Damaged registers are what is looked for, see [`Board::run_for`].
    lenient: bool,
    cost: InterruptCost,
    stack_top: u32,
    stack_limit: u32,
}

const CONTROL_INTERRUPT: u32 = 16 + 28;
/// Memory that only the processor reaches.
const CORE_COUPLED: u32 = 0x1000_0000;
const CORE_COUPLED_SIZE: u32 = 64 * 1024;
const STACK_PATTERN: u8 = 0xA5;
const FRAME_BYTES: u32 = 26 * 4;

impl Board {
    /// A board with this firmware, just reset.
    ///
    /// # Panics
    /// When the emulator cannot be set up at all.
    #[must_use]
    pub fn new(image: &Image) -> Self {
        let halfword = |at: usize| {
            let byte = |at: usize| image.flash.get(at).copied().unwrap_or(0xFF);
            u16::from_le_bytes([byte(at), byte(at + 1)])
        };
        // Erased flash holds no code.
        let used = image
            .flash
            .iter()
            .rposition(|byte| *byte != 0xFF)
            .unwrap_or(0)
            + 1;
        let code = (0..used)
            .step_by(2)
            .map(|at| timing::decode(halfword(at), halfword(at + 2)));
        let mut bus = Bus::new();
        bus.flash = FlashInterface::new(&image.flash);
        let machine = Machine {
            bus,
            code: code.collect(),
            instructions: 0,
            it_left: 0,
            after_memory: false,
            next_pc: 0,
            previous_pc: 0,
            deadline: u64::MAX,
            limit: u64::MAX,
            alert: false,
            pause: None,
            profile: None,
        };
        let mode = Mode::THUMB | Mode::MCLASS;
        let mut uc = Unicorn::new_with_data(Arch::ARM, mode, machine).expect("emulator for Arm");
        set_up(&mut uc, image).expect("memory map and hooks");

        let stack_top = image.word(FLASH);
        let stack_limit = image
            .symbol("__euninit")
            .or(image.symbol("__ebss"))
            .unwrap_or(RAM);
        let mut board = Self {
            uc,
            frames: Vec::new(),
            asleep: false,
            dead: None,
            lenient: false,
            cost: InterruptCost::default(),
            stack_top,
            stack_limit,
        };
        board.mark_stack();
        board.start();
        board
    }

    /// The peripherals.
    #[must_use]
    pub fn bus(&self) -> &Bus {
        &self.uc.get_data().bus
    }

    /// The peripherals, to wire something to them.
    pub fn bus_mut(&mut self) -> &mut Bus {
        &mut self.uc.get_data_mut().bus
    }

    /// Instructions executed since the board was new.
    #[must_use]
    pub fn instructions(&self) -> u64 {
        self.uc.get_data().instructions
    }

    /// What the control interrupt has cost so far.
    #[must_use]
    pub fn interrupt_cost(&self) -> InterruptCost {
        self.cost
    }

    /// Counts from now on what the control interrupt executes.
    pub fn begin_profile(&mut self) {
        self.uc.get_data_mut().profile = Some(Counts::default());
    }

    /// What it has executed since, which is counted no more.
    pub fn end_profile(&mut self) -> Counts {
        self.uc.get_data_mut().profile.take().unwrap_or_default()
    }

    /// Bytes of stack that were ever used, and that there are.
    #[must_use]
    pub fn stack_use(&self) -> (u32, u32) {
        let size = self.stack_top - self.stack_limit;
        let bytes = self.memory(self.stack_limit, size as usize);
        let untouched = bytes
            .iter()
            .take_while(|byte| **byte == STACK_PATTERN)
            .count();
        (size - untouched as u32, size)
    }

    /// Memory as a debugger would read it; what is not mapped reads as nothing.
    #[must_use]
    pub fn memory(&self, address: u32, length: usize) -> Vec<u8> {
        self.uc
            .mem_read_as_vec(address.into(), length)
            .unwrap_or_default()
    }

    /// Memory as a debugger would write it.
    pub fn set_memory(&mut self, address: u32, bytes: &[u8]) {
        // Only called with addresses that were read before.
        let _ = self.uc.mem_write(address.into(), bytes);
    }

    fn register(&self, register: RegisterARM) -> u32 {
        // Every register named in this file exists.
        self.uc.reg_read(register).unwrap_or(0) as u32
    }

    fn set_register(&mut self, register: RegisterARM, value: u32) {
        let _ = self.uc.reg_write(register, value.into());
    }

    fn registers(&self) -> Registers {
        let general = GENERAL
            .into_iter()
            .map(|register| self.uc.reg_read(register).unwrap_or(0));
        let float =
            (0..FLOATS as i32).map(|i| self.uc.reg_read(RegisterARM::S0 as i32 + i).unwrap_or(0));
        general.chain(float).collect()
    }

    /// Runs until the next control period begins: the time base has an update event, its interrupt
    /// has not been taken yet.
    ///
    /// # Errors
    /// Whatever stops the firmware before.
    pub fn run_to_tick(&mut self) -> Result<(), Stop> {
        let ticks = self.bus().ticks;
        let mut begin = self.bus().now;
        loop {
            if self.bus().flash.busy() {
                // Nothing is amiss while the processor stalls.
                begin = self.bus().now;
            }
            self.bus_mut().advance();
            self.carry_out_transfers();
            self.end_flash_operation()?;
            let machine = self.uc.get_data_mut();
            machine.reschedule();
            if machine.bus.ticks != ticks {
                return Ok(());
            }
            if machine
                .bus
                .watchdog
                .expires()
                .is_some_and(|expires| expires <= machine.bus.now)
            {
                return Err(Stop::WatchdogReset);
            }
            if machine.bus.now > begin + machine.bus.rcc.processor_hz() {
                return Err(Stop::NoTick);
            }
            self.run_to_event()?;
        }
    }

    /// Takes a pending exception or executes until something is due.
    fn run_to_event(&mut self) -> Result<(), Stop> {
        if self.bus().flash.busy() {
            return self.pass_time();
        }
        let pending = self.bus().nvic.any_pending();
        if pending {
            let primask = self.register(RegisterARM::PRIMASK) & 1 == 1;
            let basepri = self.register(RegisterARM::BASEPRI) as u8;
            if let Some(exception) = self.bus().nvic.next(primask, basepri) {
                if self.lenient && !self.can_stack() {
                    let pc = self.register(RegisterARM::PC);
                    let error = "no memory to stack to".into();
                    return Err(Stop::Fault { pc, error });
                }
                self.enter(exception);
            }
        }
        if self.asleep {
            if !pending {
                return self.pass_time();
            }
            self.asleep = false;
        }
        let pc = self.register(RegisterARM::PC);
        self.uc.get_data_mut().pause = None;
        let result = self.uc.emu_start((pc | 1).into(), 0xFFFF_FFFE, 0, 0);
        let pause = self.uc.get_data_mut().pause.take();
        match (pause, result) {
            (Some(Pause::Error(stop)), _) => Err(stop),
            (Some(Pause::Due), _) => Ok(()),
            (Some(Pause::Sleep(pc)), _) => {
                self.set_register(RegisterARM::PC, (pc + 2) | 1);
                self.asleep = true;
                Ok(())
            }
            (Some(Pause::ExceptionReturn), _) => self.leave(),
            (None, Err(error)) => Err(self.fault(error)),
            (None, Ok(())) => Err(Stop::Fault {
                pc: self.register(RegisterARM::PC),
                error: "the emulator stopped without a reason".into(),
            }),
        }
    }

    /// Time passes without instructions.
    fn pass_time(&mut self) -> Result<(), Stop> {
        let machine = self.uc.get_data_mut();
        let event = machine.bus.next_event().ok_or(Stop::AsleepForever)?;
        machine.bus.now = machine.bus.now.max(event.min(machine.limit));
        Ok(())
    }

    fn fault(&self, error: uc_error) -> Stop {
        Stop::Fault {
            pc: self.register(RegisterARM::PC),
            error: format!("{error:?}"),
        }
    }

    /// Enters an exception: stacks the caller's registers, floating point included.
    fn enter(&mut self, exception: u32) {
        let before = self.registers();
        let pc = self.register(RegisterARM::PC) & !1;
        let handler = !self.frames.is_empty();
        let sp = self.register(RegisterARM::SP);
        let below = sp.wrapping_sub(FRAME_BYTES);
        let frame = below & !7;
        let aligned = u32::from(below != frame) << 9;
        let mut words = vec![
            self.register(RegisterARM::R0),
            self.register(RegisterARM::R1),
            self.register(RegisterARM::R2),
            self.register(RegisterARM::R3),
            self.register(RegisterARM::R12),
            self.register(RegisterARM::LR),
            pc,
            self.register(RegisterARM::XPSR) & !(1 << 9) | aligned | 1 << 24,
        ];
        let float = |i| self.uc.reg_read(RegisterARM::S0 as i32 + i).unwrap_or(0) as u32;
        words.extend((0..16).map(float));
        words.push(self.register(RegisterARM::FPSCR));
        words.push(0);
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.set_memory(frame, &bytes);

        let vector = self.bus().system.vector_table + 4 * exception;
        let target = self.memory(vector, 4);
        let target = target.try_into().map_or(0, u32::from_le_bytes);
        self.set_register(RegisterARM::SP, frame);
        self.set_register(
            RegisterARM::LR,
            if handler { 0xFFFF_FFE1 } else { 0xFFFF_FFE9 },
        );
        self.set_register(RegisterARM::XPSR, exception | 1 << 24);
        self.set_register(RegisterARM::PC, target | 1);

        if exception == CONTROL_INTERRUPT && !self.asleep {
            self.cost.preemptions += 1;
        }
        let machine = self.uc.get_data_mut();
        self.frames.push(Frame {
            exception,
            before,
            pc,
            start: (machine.instructions, machine.bus.now),
        });
        machine.bus.nvic.enter(exception);
        machine.bus.now += timing::ENTRY;
        machine.next_pc = target & !1;
        machine.after_memory = false;
        machine.reschedule();
    }

    /// Leaves an exception: puts the caller's registers back.
    fn leave(&mut self) -> Result<(), Stop> {
        let frame = self.register(RegisterARM::SP);
        let bytes = self.memory(frame, FRAME_BYTES as usize);
        let words: Vec<u32> = bytes
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
            .collect();
        let (Some(entry), [r0, r1, r2, r3, r12, lr, pc, xpsr, float @ ..]) =
            (self.frames.pop(), &words[..])
        else {
            return Err(Stop::Fault {
                pc: self.register(RegisterARM::PC),
                error: "return from an exception that was not entered".into(),
            });
        };
        for (register, value) in [
            (RegisterARM::R0, r0),
            (RegisterARM::R1, r1),
            (RegisterARM::R2, r2),
            (RegisterARM::R3, r3),
            (RegisterARM::R12, r12),
            (RegisterARM::LR, lr),
        ] {
            self.set_register(register, *value);
        }
        for (i, value) in float.iter().take(16).enumerate() {
            let _ = self
                .uc
                .reg_write(RegisterARM::S0 as i32 + i as i32, (*value).into());
        }
        if let Some(fpscr) = float.get(16) {
            self.set_register(RegisterARM::FPSCR, *fpscr);
        }
        let below = frame.wrapping_add(FRAME_BYTES);
        self.set_register(RegisterARM::SP, below.wrapping_add((xpsr >> 9 & 1) * 4));
        self.set_register(RegisterARM::XPSR, xpsr & !(1 << 9));
        self.set_register(RegisterARM::PC, pc | 1);

        let machine = self.uc.get_data_mut();
        machine.bus.nvic.leave();
        machine.bus.now += timing::EXIT;
        machine.next_pc = *pc;
        machine.after_memory = false;
        machine.reschedule();
        if entry.exception == CONTROL_INTERRUPT {
            let instructions = machine.instructions - entry.start.0;
            let cycles = machine.bus.now - entry.start.1;
            let cost = &mut self.cost;
            cost.runs += 1;
            cost.instructions += instructions;
            cost.cycles += cycles;
            cost.most_instructions = cost.most_instructions.max(instructions);
            cost.most_cycles = cost.most_cycles.max(cycles);
        }
        if self.lenient || self.registers() == entry.before {
            Ok(())
        } else {
            Err(Stop::RegistersDamaged { pc: entry.pc })
        }
    }
}

fn set_up(uc: &mut Unicorn<'static, Machine>, image: &Image) -> Result<(), uc_error> {
    uc.ctl_set_cpu_model(unicorn_engine::ArmCpuModel::CORTEX_M4 as i32)?;
    for base in flash::MAPPED {
        uc.mem_map(base.into(), FLASH_SIZE.into(), Prot::READ | Prot::EXEC)?;
        uc.mem_write(base.into(), &image.flash)?;
    }
    flash::hook_writes(uc)?;
    // The electronic signature [39.2]: how large flash is, KiB.
    uc.mem_map(0x1FFF_7000, 0x1000, Prot::READ)?;
    uc.mem_write(0x1FFF_7A22, &((FLASH_SIZE / 1024) as u16).to_le_bytes())?;
    uc.mem_map(RAM.into(), RAM_SIZE.into(), Prot::ALL)?;
    uc.mem_map(
        CORE_COUPLED.into(),
        CORE_COUPLED_SIZE.into(),
        Prot::READ | Prot::WRITE,
    )?;
    for (base, size) in [
        (0x4000_0000_u64, 0x10_0000_u64),
        (0x4200_0000, 0x200_0000),
        (0x5000_0000, 0x10_0000),
        (0xE000_0000, 0x10_0000),
    ] {
        let base32 = base as u32;
        uc.mmio_map(
            base,
            size,
            Some(
                move |uc: &mut Unicorn<'_, Machine>, offset: u64, size: usize| {
                    read(uc, base32 + offset as u32, size)
                },
            ),
            Some(
                move |uc: &mut Unicorn<'_, Machine>, offset: u64, size: usize, value: u64| {
                    write(uc, base32 + offset as u32, size, value as u32);
                },
            ),
        )?;
    }
    uc.add_code_hook(1, 0, |uc, address, _| {
        before_instruction(uc, address as u32);
    })?;
    uc.add_intr_hook(|uc, number| {
        // 8: branch to an EXC_RETURN value.
        let pause = if number == 8 {
            Pause::ExceptionReturn
        } else {
            let pc = uc.reg_read(RegisterARM::PC).unwrap_or(0) as u32;
            Pause::Error(Stop::Fault {
                pc,
                error: format!("exception {number} of the emulator"),
            })
        };
        uc.get_data_mut().pause.get_or_insert(pause);
        let _ = uc.emu_stop();
    })?;
    Ok(())
}

fn before_instruction(uc: &mut Unicorn<'_, Machine>, pc: u32) {
    let machine = uc.get_data_mut();
    let due = machine.it_left == 0 && machine.bus.now >= machine.deadline;
    if due {
        machine.pause = Some(Pause::Due);
        let _ = uc.emu_stop();
        return;
    }
    if machine.alert && machine.it_left == 0 {
        let primask = uc.reg_read(RegisterARM::PRIMASK).unwrap_or(0) & 1 == 1;
        let basepri = uc.reg_read(RegisterARM::BASEPRI).unwrap_or(0) as u8;
        let machine = uc.get_data_mut();
        if machine.bus.nvic.next(primask, basepri).is_some() {
            machine.pause = Some(Pause::Due);
            let _ = uc.emu_stop();
            return;
        }
    }
    let machine = uc.get_data_mut();
    let offset = if pc >= FLASH { pc - FLASH } else { pc };
    let Some(instruction) = machine.code.get(offset as usize / 2).copied() else {
        machine.pause = Some(Pause::Error(Stop::Fault {
            pc,
            error: "code outside of flash".into(),
        }));
        let _ = uc.emu_stop();
        return;
    };
    machine.instructions += 1;
    let mut cycles = u64::from(instruction.cycles);
    if instruction.memory && machine.after_memory && cycles > 1 {
        cycles = 1;
    }
    if pc != machine.next_pc {
        cycles += timing::REFILL;
    }
    machine.bus.now += cycles;
    if let Some(profile) = &mut machine.profile
        && machine.bus.nvic.active() == CONTROL_INTERRUPT
    {
        profile.add(offset as usize / 2, cycles);
    }
    machine.after_memory = instruction.memory;
    machine.next_pc = pc.wrapping_add(instruction.length.into());
    machine.it_left = machine.it_left.saturating_sub(1).max(instruction.it_block);
    let endless = pc == machine.previous_pc;
    machine.previous_pc = pc;
    if instruction.wfi {
        machine.pause = Some(Pause::Sleep(pc));
        let _ = uc.emu_stop();
    } else if endless && uc.reg_read(RegisterARM::PRIMASK).unwrap_or(0) & 1 == 1 {
        uc.get_data_mut().pause = Some(Pause::Error(Stop::Halted { pc }));
        let _ = uc.emu_stop();
    } else if endless && !uc.get_data().alert {
        // A jump to itself changes nothing until something is due.
        let machine = uc.get_data_mut();
        let left = machine.deadline.saturating_sub(machine.bus.now);
        if machine.deadline != u64::MAX {
            machine.bus.now += left.next_multiple_of(cycles);
        }
    }
}

/// Narrow accesses are made of words.
fn lane(address: u32, size: usize) -> (u32, u32, u32) {
    let shift = 8 * (address & 3);
    let mask = match size {
        1 => 0xFF,
        2 => 0xFFFF,
        _ => u32::MAX,
    };
    (address & !3, shift, mask)
}

fn read(uc: &mut Unicorn<'_, Machine>, address: u32, size: usize) -> u64 {
    let pc = uc.reg_read(RegisterARM::PC).unwrap_or(0) as u32;
    let (word, shift, mask) = lane(address, size);
    let machine = uc.get_data_mut();
    if let Ok(value) = machine.bus.read(word) {
        return (value >> shift & mask).into();
    }
    let stop = Stop::UnknownRegister {
        address,
        written: None,
        pc,
    };
    machine.pause = Some(Pause::Error(stop));
    let _ = uc.emu_stop();
    0
}

fn write(uc: &mut Unicorn<'_, Machine>, address: u32, size: usize, value: u32) {
    let pc = uc.reg_read(RegisterARM::PC).unwrap_or(0) as u32;
    let (word, shift, mask) = lane(address, size);
    let machine = uc.get_data_mut();
    let result = if mask == u32::MAX {
        machine.bus.write(word, value)
    } else {
        let rest = machine.bus.beneath(word);
        rest.and_then(|rest| {
            machine
                .bus
                .write(word, rest & !(mask << shift) | (value & mask) << shift)
        })
    };
    machine.reschedule();
    if machine.bus.system.reset_requested {
        machine.pause = Some(Pause::Error(Stop::ResetRequested));
        let _ = uc.emu_stop();
    } else if result.is_err() {
        let stop = Stop::UnknownRegister {
            address,
            written: Some(value),
            pc,
        };
        machine.pause = Some(Pause::Error(stop));
        let _ = uc.emu_stop();
    }
}
