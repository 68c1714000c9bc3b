//! Running a broken board on, as the hardware does, where the emulator alone would stop and say why.
//!
//! ```text
//! access outside of memory, undefined instruction, unknown register --> fault of the processor
//! fault in the fault handler, no memory to stack to                 --> lock-up
//! endless loop with interrupts masked, lock-up                      --> dead: time passes, pins stay
//! watchdog, reset request                                           --> Err, the caller resets
//! ```

use super::{Board, CONTROL_INTERRUPT, FRAME_BYTES, Stop};
use crate::virtual_board::image::{RAM, RAM_SIZE};
use crate::virtual_board::nvic::HARD_FAULT;
use unicorn_engine::RegisterARM;

impl Board {
    /// Runs until the next control period begins, and for a number of cycles at most.
    ///
    /// # Errors
    /// [`Stop::WatchdogReset`], [`Stop::ResetRequested`] and [`Stop::PowerCut`]; everything else the board lives through, in
    /// whatever state.
    pub fn run_for(&mut self, cycles: u64) -> Result<(), Stop> {
        self.lenient = true;
        let ticks = self.bus().ticks;
        let limit = self.bus().now + cycles;
        self.uc.get_data_mut().limit = limit;
        let result = loop {
            self.bus_mut().advance();
            self.carry_out_transfers();
            if let Err(stop) = self.end_flash_operation() {
                break Err(stop);
            }
            let machine = self.uc.get_data_mut();
            machine.reschedule();
            let bus = &mut machine.bus;
            if bus.watchdog.expires().is_some_and(|at| at <= bus.now) {
                break Err(Stop::WatchdogReset);
            }
            if bus.ticks != ticks || bus.now >= limit {
                break Ok(());
            }
            if self.dead.is_some() {
                let next = bus.next_event().unwrap_or(limit);
                bus.now = bus.now.max(next.min(limit));
                continue;
            }
            match self.run_to_event() {
                Ok(()) => {}
                Err(Stop::ResetRequested) => break Err(Stop::ResetRequested),
                Err(stop @ (Stop::Halted { .. } | Stop::AsleepForever)) => self.dead = Some(stop),
                Err(_) => self.hard_fault(),
            }
        };
        self.lenient = false;
        self.uc.get_data_mut().limit = u64::MAX;
        result
    }

    /// Why nothing runs any more, if so.
    #[must_use]
    pub fn dead(&self) -> Option<&Stop> {
        self.dead.as_ref()
    }

    /// Makes the processor take a fault here and now, whatever it is doing. It locks up if it is
    /// handling one already or has no memory to stack to (Armv7-M ARM, B1.5.15).
    pub fn hard_fault(&mut self) {
        self.asleep = false;
        let mut frames = self.frames.iter();
        let handling = frames.any(|frame| frame.exception == HARD_FAULT);
        if handling || !self.can_stack() {
            self.dead = Some(Stop::LockedUp {
                pc: self.register(RegisterARM::PC),
            });
        } else {
            self.enter(HARD_FAULT);
        }
    }

    /// Whether there is memory where the frame of an exception would go.
    pub(super) fn can_stack(&self) -> bool {
        let frame = self.register(RegisterARM::SP).wrapping_sub(FRAME_BYTES);
        (RAM + 8..RAM + RAM_SIZE - FRAME_BYTES + 1).contains(&frame)
    }

    /// Sends whatever runs now somewhere else, as a wild jump does.
    pub fn jump(&mut self, pc: u32) {
        self.asleep = false;
        self.set_register(RegisterARM::PC, pc | 1);
    }

    /// Takes the control interrupt and sends it somewhere else.
    pub fn jump_in_control_interrupt(&mut self, pc: u32) {
        self.enter(CONTROL_INTERRUPT);
        self.jump(pc);
    }

    /// Moves the stack pointer.
    pub fn set_stack_pointer(&mut self, to: u32) {
        self.set_register(RegisterARM::SP, to);
    }

    /// The stack pointer.
    #[must_use]
    pub fn stack_pointer(&self) -> u32 {
        self.register(RegisterARM::SP)
    }

    /// End of the memory with static data, and of the stack.
    #[must_use]
    pub fn stack_range(&self) -> (u32, u32) {
        (self.stack_limit, self.stack_top)
    }
}
