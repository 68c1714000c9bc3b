//! Snapshots: a board as it is between two control periods, to be put into any board with the same firmware.
//!
//! Flash is in it as the flash interface has it, whose copies share the sectors that have not changed. Only where the
//! board has others are these written; what the emulator has translated of the firmware stays good.

use super::{Board, Frame, InterruptCost, MASKS};
use crate::virtual_board::bus::Bus;
use crate::virtual_board::image::{RAM, RAM_SIZE};
use unicorn_engine::RegisterARM;

/// Processor, memory and peripherals at one moment; plain data.
#[derive(Clone, Debug)]
pub struct Snapshot {
    registers: Vec<u64>,
    masks: [u64; 4],
    memory: Vec<u8>,
    bus: Bus,
    frames: Vec<Frame>,
    asleep: bool,
    cost: InterruptCost,
    instructions: u64,
    it_left: u8,
    after_memory: bool,
    next_pc: u32,
    previous_pc: u32,
}

impl Board {
    /// The board as it is now.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        let machine = self.uc.get_data();
        Snapshot {
            registers: self.registers(),
            masks: MASKS.map(|mask| self.uc.reg_read(mask).unwrap_or(0)),
            memory: self.memory(RAM, RAM_SIZE as usize),
            bus: machine.bus.clone(),
            frames: self.frames.clone(),
            asleep: self.asleep,
            cost: self.cost,
            instructions: machine.instructions,
            it_left: machine.it_left,
            after_memory: machine.after_memory,
            next_pc: machine.next_pc,
            previous_pc: machine.previous_pc,
        }
    }

    /// Puts the board back into a state it, or another one with the same firmware, was in.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.set_memory(RAM, &snapshot.memory);
        let (general, float) = snapshot.registers.split_at(super::GENERAL.len());
        for (register, value) in super::GENERAL.into_iter().zip(general) {
            let value = match register {
                // The processor is in Thumb state, which the emulator takes from here.
                RegisterARM::PC => value | 1,
                _ => *value,
            };
            let _ = self.uc.reg_write(register, value);
        }
        for (register, value) in (RegisterARM::S0 as i32..).zip(float) {
            let _ = self.uc.reg_write(register, *value);
        }
        for (register, value) in MASKS.into_iter().zip(snapshot.masks) {
            let _ = self.uc.reg_write(register, value);
        }
        self.frames.clone_from(&snapshot.frames);
        self.asleep = snapshot.asleep;
        self.cost = snapshot.cost;
        self.dead = None;
        let shown = self.bus().flash.array().clone();
        self.bus_mut().clone_from(&snapshot.bus);
        self.show_flash(&shown);
        let machine = self.uc.get_data_mut();
        machine.instructions = snapshot.instructions;
        machine.it_left = snapshot.it_left;
        machine.after_memory = snapshot.after_memory;
        machine.next_pc = snapshot.next_pc;
        machine.previous_pc = snapshot.previous_pc;
        machine.pause = None;
        machine.reschedule();
    }
}
