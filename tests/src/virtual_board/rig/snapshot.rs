//! Snapshots of board and machine together, between two control periods.

use super::{Rig, Switches, Wiring};
use crate::virtual_board::cpu;
use crate::virtual_board::harm::{Amplifier, EncoderLine, InterruptLine, LogHost};
use crate::virtual_board::rtt::Rtt;
use host_sim::simulate::plant::Plant;

/// A rig at one moment, its log left out; plain data, for any rig with the same firmware.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The board.
    pub board: cpu::Snapshot,
    wiring: Wiring,
    held: bool,
    as_hardware: bool,
    plant: Plant,
    plant_step: f64,
    rtt: Option<Rtt>,
    encoder: EncoderLine,
    amplifier: Amplifier,
    interrupts: InterruptLine,
    log_host: LogHost,
    resets: u32,
    switches: Switches,
    encoder_count: i64,
    owed: f64,
}

impl Rig {
    /// The rig as it is now.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            board: self.board.snapshot(),
            wiring: self.wiring,
            held: self.held,
            as_hardware: self.as_hardware,
            plant: self.plant.clone(),
            plant_step: self.plant_step,
            rtt: self.rtt.clone(),
            encoder: self.encoder.clone(),
            amplifier: self.amplifier.clone(),
            interrupts: self.interrupts.clone(),
            log_host: self.log_host,
            resets: self.resets,
            switches: self.switches,
            encoder_count: self.encoder_count,
            owed: self.owed,
        }
    }

    /// Puts the rig back into a state it, or another one with the same firmware, was in, with an empty log.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.board.restore(&snapshot.board);
        self.wiring = snapshot.wiring;
        self.held = snapshot.held;
        self.as_hardware = snapshot.as_hardware;
        self.plant.clone_from(&snapshot.plant);
        self.plant_step = snapshot.plant_step;
        self.rtt.clone_from(&snapshot.rtt);
        self.encoder.clone_from(&snapshot.encoder);
        self.amplifier.clone_from(&snapshot.amplifier);
        self.interrupts.clone_from(&snapshot.interrupts);
        self.log_host = snapshot.log_host;
        self.resets = snapshot.resets;
        self.switches = snapshot.switches;
        self.encoder_count = snapshot.encoder_count;
        self.owed = snapshot.owed;
        self.log.clear();
    }

    /// Resets the board, as watchdog or reset line do, while the machine goes on: its firmware has come as
    /// far as the first update of the control timer.
    ///
    /// * `fresh`: that board
    pub fn reset_board(&mut self, fresh: &cpu::Snapshot) {
        self.board.restore(fresh);
        self.switches(self.switches);
    }
}
