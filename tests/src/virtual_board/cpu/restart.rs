//! Starting the processor: when the board is new, after a reset, and when the power comes back.
//!
//! ```text
//!              time, pins, flash | RAM     | registers, peripherals
//! reset        stay              | stays   | new
//! power cycle  stay              | is lost | new
//! ```

use super::{Board, CORE_COUPLED, CORE_COUPLED_SIZE, STACK_PATTERN};
use crate::virtual_board::image::{RAM, RAM_SIZE};
use unicorn_engine::RegisterARM;

impl Board {
    /// Resets the processor, as its reset line, its watchdog or a request of the program does. An operation of
    /// the flash interface is broken off.
    pub fn reset(&mut self) {
        let shown = self.bus().flash.array().clone();
        self.bus_mut().reset();
        self.show_flash(&shown);
        self.start();
    }

    /// Takes the power away and gives it back.
    pub fn power_cycle(&mut self) {
        let shown = self.bus().flash.array().clone();
        self.bus_mut().power_cycle();
        self.show_flash(&shown);
        self.set_memory(RAM, &vec![0; RAM_SIZE as usize]);
        self.set_memory(CORE_COUPLED, &vec![0; CORE_COUPLED_SIZE as usize]);
        self.mark_stack();
        self.start();
    }

    /// Fills the stack with a pattern, to see later how much of it was used.
    pub(super) fn mark_stack(&mut self) {
        let size = self.stack_top.saturating_sub(self.stack_limit);
        self.set_memory(self.stack_limit, &vec![STACK_PATTERN; size as usize]);
    }

    /// Begins where the vector table says (Armv7-M ARM, B1.5.5).
    pub(super) fn start(&mut self) {
        self.frames.clear();
        self.asleep = false;
        self.dead = None;
        for mask in super::MASKS {
            self.set_register(mask, 0);
        }
        for register in super::GENERAL {
            self.set_register(register, 0);
        }
        for register in (RegisterARM::S0 as i32..).take(super::FLOATS) {
            // Every register named here exists.
            let _ = self.uc.reg_write(register, 0);
        }
        let vector = |at| self.memory(at, 4).try_into().map_or(0, u32::from_le_bytes);
        let (stack, entry) = (vector(0), vector(4));
        self.set_register(RegisterARM::XPSR, 1 << 24);
        self.set_register(RegisterARM::LR, u32::MAX);
        self.set_register(RegisterARM::SP, stack);
        self.set_register(RegisterARM::PC, entry | 1);
        let machine = self.uc.get_data_mut();
        machine.it_left = 0;
        machine.after_memory = false;
        machine.next_pc = 0;
        machine.previous_pc = 0;
        machine.pause = None;
        machine.reschedule();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_board::Stop;
    use crate::virtual_board::image::Image;

    const CORE_COUPLED_WORD: u32 = CORE_COUPLED + 8;
    const PORT_C: u32 = 0x4002_0800;
    const CSR: u32 = 0x4002_3874;

    /// Writes its mark, sets things up, and asks for a reset.
    fn board() -> Board {
        let writes = [
            [RAM + 0x4000, 0x1234_5678],
            [CORE_COUPLED_WORD, 0x1234_5678],
            [0x4002_3830, 0b100],
            [PORT_C, 0b01 << 24],
            [0x4000_3000, 0xCCCC],
            [0xE000_ED0C, 0x05FA_0004],
        ];
        let mut board = Board::new(&Image::of_writes(&writes));
        board.set_flash(0xE_0000, &[1, 2, 3]);
        board.bus_mut().ports[2].set_level(3, true);
        assert_eq!(board.run_for(1000), Err(Stop::ResetRequested));
        board
    }

    #[test]
    fn a_reset_keeps_memory_and_what_the_world_does() {
        let mut board = board();
        board.set_memory(RAM + 0x4004, &[7]);
        board.hard_fault();
        let now = board.bus().now;
        board.reset();
        assert_eq!((board.bus().now, board.dead()), (now, None));
        assert_eq!(board.memory(RAM + 0x4000, 5), [0x78, 0x56, 0x34, 0x12, 7]);
        assert_eq!(board.memory(0x080E_0000, 3), [1, 2, 3]);
        let bus = board.bus_mut();
        assert_eq!((bus.read(PORT_C), bus.watchdog.started()), (Ok(0), false));
        assert_eq!(bus.nvic.active(), 0);
        bus.write(0x4002_3830, 0b100).unwrap();
        assert_eq!(bus.read(PORT_C + 0x10), Ok(0b1000));
        assert_eq!(bus.read(CSR), Ok(0x1E00_0000));
        // The program runs as before.
        board.set_memory(RAM + 0x4000, &[0; 4]);
        assert_eq!(board.run_for(1000), Err(Stop::ResetRequested));
        assert_eq!(board.memory(RAM + 0x4000, 4), [0x78, 0x56, 0x34, 0x12]);
    }

    #[test]
    fn a_power_cycle_keeps_flash_only() {
        let mut board = board();
        board.power_cycle();
        assert_eq!(board.memory(RAM + 0x4000, 4), [0; 4]);
        assert_eq!(board.memory(CORE_COUPLED_WORD, 4), [0; 4]);
        assert_eq!(board.memory(RAM, 4), [STACK_PATTERN; 4]);
        assert_eq!(board.flash()[0xE_0000..0xE_0003], [1, 2, 3]);
        assert_eq!(board.bus_mut().read(CSR), Ok(0x0E00_0000));
        assert_eq!(board.run_for(1000), Err(Stop::ResetRequested));
        assert_eq!(board.memory(RAM + 0x4000, 4), [0x78, 0x56, 0x34, 0x12]);
    }
}
