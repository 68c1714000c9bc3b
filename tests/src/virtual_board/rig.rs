//! The board on its machine: amplifier, plant and encoder close the loop around the firmware.
//!
//! The interrupt's computing time (some microseconds) is taken as zero for the plant: the current
//! that the interrupt commands flows from the beginning of the period, as it does in host-sim.

use super::cpu::{Board, Stop};
use super::image::Image;
use super::peripheral::encoder_timer::Phases;
use super::rtt::Rtt;
use host_sim::drive::{Drive, PlantFile};
use host_sim::plant::Plant;
use nalgebra::DVector;

/// How the machine is wired to the board.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wiring {
    /// Phases A and B of the encoder are swapped.
    pub phases_swapped: bool,
    /// The motor's leads are swapped.
    pub motor_reversed: bool,
    /// The encoder is not connected.
    pub encoder_unplugged: bool,
}

/// What the board did in one control period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Period {
    /// Encoder timer when the period began.
    pub count: u32,
    /// Converter code that was on the output afterwards.
    pub code: Option<u16>,
    /// Whether the amplifier was enabled afterwards.
    pub enabled: bool,
}

/// Code of zero current, and amperes per code, of the amplifier.
const ZERO_CODE: f64 = 2048.0;
const AMPERES_PER_CODE: f64 = 1e-3;

/// Switches of the board.
const RUN: u32 = 2;
const TARGET: [u32; 2] = [0, 1];

/// Board and machine.
pub struct Rig {
    /// The board.
    pub board: Board,
    /// How the machine is wired.
    pub wiring: Wiring,
    /// The plant does not move: somebody holds it.
    pub held: bool,
    /// Everything the firmware has logged.
    pub log: Vec<u8>,
    plant: Plant,
    rtt: Option<Rtt>,
    encoder_count: i64,
    resolution: f64,
    period_timer_clocks: u32,
}

impl Rig {
    /// Board with a firmware, machine at rest at the origin; runs the firmware until its control
    /// timer has its first update.
    ///
    /// * `prepare`: seeds faults before the firmware starts
    ///
    /// # Errors
    /// Whatever stops the firmware.
    pub fn start(
        image: &Image,
        drive: &Drive,
        plant: &PlantFile,
        prepare: impl FnOnce(&mut Board),
    ) -> Result<Self, Stop> {
        let mut board = Board::new(image);
        prepare(&mut board);
        let mut rig = Self {
            board,
            wiring: Wiring::default(),
            held: false,
            log: Vec::new(),
            plant: Plant::new(plant, drive.control.sample_time),
            rtt: Rtt::new(image),
            encoder_count: 0,
            resolution: plant.encoder.resolution,
            // APB1 timers run at 84 MHz on this board.
            period_timer_clocks: (drive.control.sample_time * 84e6) as u32,
        };
        rig.board.run_to_tick()?;
        Ok(rig)
    }

    /// The plant.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Puts another plant, or the same in another state, on the machine.
    pub fn set_plant(&mut self, plant: Plant, state: Option<DVector<f64>>) {
        self.plant = plant;
        if let Some(state) = state {
            self.plant.set_state(state);
        }
        self.feed_encoder();
    }

    /// Sets the switches.
    pub fn switches(&mut self, run: bool, target: u32) {
        let port = &mut self.board.bus_mut().ports[2];
        port.set_level(RUN, run);
        for (bit, pin) in TARGET.into_iter().enumerate() {
            port.set_level(pin, target >> bit & 1 == 1);
        }
    }

    /// One control period: the interrupt, whatever the idle loop has to do, and the plant.
    ///
    /// # Errors
    /// Whatever stops the firmware.
    pub fn period(&mut self) -> Result<Period, Stop> {
        let count = self.board.bus().encoder.count();
        let result = self.board.run_to_tick();
        // What was logged before the end matters most.
        if let Some(rtt) = &mut self.rtt {
            self.log.extend(rtt.take(&mut self.board));
        }
        result?;
        let code = self.board.bus().current_reference();
        let enabled = self.board.bus().ports[1].drives_high(12);
        if !self.held {
            // Without a reference the amplifier's input rests at half its range.
            let code = code.map_or(ZERO_CODE, f64::from);
            let mut current = if enabled { (code - ZERO_CODE) * AMPERES_PER_CODE } else { 0.0 };
            if self.wiring.motor_reversed {
                current = -current;
            }
            self.plant.advance(current).map_err(|error| Stop::Fault {
                pc: 0,
                error: error.to_string(),
            })?;
            self.feed_encoder();
        }
        Ok(Period { count, code, enabled })
    }

    /// Runs a number of periods.
    ///
    /// # Errors
    /// Whatever stops the firmware.
    pub fn periods(&mut self, periods: u32) -> Result<Vec<Period>, Stop> {
        (0..periods).map(|_| self.period()).collect()
    }

    /// Turns the encoder to where the actuator is, edge by edge, evenly over the period.
    fn feed_encoder(&mut self) {
        let target = (self.plant.state()[0] / self.resolution).round() as i64;
        let edges = target.abs_diff(self.encoder_count);
        if self.wiring.encoder_unplugged || edges == 0 {
            self.encoder_count = target;
            return;
        }
        let clocks = u32::try_from(u64::from(self.period_timer_clocks) / edges).unwrap_or(u32::MAX);
        let step = (target - self.encoder_count).signum();
        while self.encoder_count != target {
            self.encoder_count += step;
            let mut phases = Phases::at(self.encoder_count);
            if self.wiring.phases_swapped {
                std::mem::swap(&mut phases.a, &mut phases.b);
            }
            let bus = self.board.bus_mut();
            if bus.encoder_connected() {
                bus.encoder.edge(phases, clocks);
            }
        }
    }
}
