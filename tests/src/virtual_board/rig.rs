//! The board on its machine: amplifier, plant and encoder close the loop around the firmware.
//!
//! The interrupt's computing time (some microseconds) is taken as zero for the plant: the current
//! that the interrupt commands flows from the beginning of the period, as it does in host-sim.

mod restart;
mod snapshot;

pub use snapshot::Snapshot;

use super::cpu::{Board, Stop};
use super::harm::interrupt_line::Arrival;
use super::harm::{Amplifier, EncoderLine, InterruptLine, LogHost, Scale};
use super::image::Image;
use super::rtt::Rtt;
use host_sim::drive::{Drive, PlantFile};
use host_sim::excite::LONGEST_EXCITATION;
use host_sim::simulate::plant::Plant;
use host_sim::simulate::scenario::{Approach, Scenario};

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
    /// Instructions of the control interrupt.
    pub instructions: u64,
    /// Estimated cycles of the control interrupt.
    pub cycles: u64,
}

/// Periods in which commissioning must be over, in which switches and drive settle, and in which the
/// drive has seen that the machine is at rest.
const COMMISSIONING: u32 = 3000;
const SETTLED: u32 = 50;
const RESTED: u32 = 2100;

/// Counts per period at which the machine is carried to its start.
const CARRY: u64 = 4000;

/// Pins of the switches.
const RUN: u32 = 2;
const EXCITE: u32 = 3;
const ZERO: u32 = 4;
const TARGET: [u32; 2] = [0, 1];
const HOME: u32 = 5;

/// Where the switches of the board stand; all open by default.
#[derive(Clone, Copy, Debug, Default)]
pub struct Switches {
    /// The drive is to run.
    pub run: bool,
    /// A run plays the excitation.
    pub excite: bool,
    /// Where the machine stands is zero.
    pub zero: bool,
    /// Which target, 0 to 3.
    pub target: u32,
}

impl Switches {
    /// The drive is to run to a target.
    #[must_use]
    pub fn run(target: u32) -> Self {
        Self {
            run: true,
            target,
            ..Self::default()
        }
    }

    /// Which target switches ask for an experiment; there are some for planned moves, and for the step of 30 mm.
    #[must_use]
    pub fn target_of(scenario: &Scenario) -> Option<u32> {
        match (scenario.approach, scenario.target) {
            (_, 0.0) => Some(0),
            (Approach::Move, 0.03) => Some(1),
            (Approach::Move, 0.015) => Some(2),
            (Approach::Step, 0.03) => Some(3),
            _ => None,
        }
    }

    /// The drive is to play its excitation.
    #[must_use]
    pub fn excite() -> Self {
        Self {
            run: true,
            excite: true,
            ..Self::default()
        }
    }
}

/// Board and machine.
pub struct Rig {
    /// The board.
    pub board: Board,
    /// How the machine is wired.
    pub wiring: Wiring,
    /// The plant does not move: somebody holds it.
    pub held: bool,
    /// What breaks the board is what it does to the machine: it goes on as the hardware would, see
    /// [`Board::run_for`], and a period ends by the clock if the control timer does not end it.
    pub as_hardware: bool,
    /// Everything the firmware has logged.
    pub log: Vec<u8>,
    /// The encoder and its cable.
    pub encoder: EncoderLine,
    /// The amplifier.
    pub amplifier: Amplifier,
    /// The line of the control interrupt.
    pub interrupts: InterruptLine,
    /// Who takes the log.
    pub log_host: LogHost,
    /// How often the board was reset because its firmware asked for it.
    pub resets: u32,
    plant: Plant,
    /// Time that the plant makes at once, s.
    plant_step: f64,
    rtt: Option<Rtt>,
    switches: Switches,
    encoder_count: i64,
    resolution: f64,
    period_timer_clocks: u32,
    sample_time: f64,
    /// Time that the plant has not made yet, s.
    owed: f64,
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
            as_hardware: false,
            log: Vec::new(),
            encoder: EncoderLine::default(),
            amplifier: Amplifier::new(Scale::from(&drive.actuator)),
            interrupts: InterruptLine::default(),
            log_host: LogHost::default(),
            resets: 0,
            plant_step: drive.control.sample_time,
            switches: Switches::default(),
            plant: Plant::new(plant, drive.control.sample_time),
            rtt: Rtt::new(image),
            encoder_count: 0,
            resolution: plant.encoder.resolution,
            sample_time: drive.control.sample_time,
            owed: 0.0,
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

    /// Another machine from now on, in the state that this one is in.
    ///
    /// * `parts`: of a control period that the plant is advanced by at once
    /// * `stopped`: its actuator stands still
    pub fn change_plant(&mut self, plant: &PlantFile, parts: u32, stopped: bool) {
        self.plant_step = self.sample_time / f64::from(parts);
        let mut state = self.plant.state().clone();
        if stopped {
            state[1] = 0.0;
        }
        self.plant = Plant::new(plant, self.plant_step);
        self.plant.set_state(state);
    }

    /// Sets the home switch.
    pub fn home_switch(&mut self, active: bool) {
        self.board.bus_mut().ports[2].set_level(HOME, active);
    }

    /// Puts a stop there, see [`Plant::stop_at`].
    pub fn stop_at(&mut self, position: f64) {
        self.plant.stop_at(position);
    }

    /// Sets the switches.
    pub fn switches(&mut self, switches: Switches) {
        self.switches = switches;
        let Switches {
            run,
            excite,
            zero,
            target,
        } = switches;
        let port = &mut self.board.bus_mut().ports[2];
        port.set_level(RUN, run);
        port.set_level(EXCITE, excite);
        port.set_level(ZERO, zero);
        for (bit, pin) in TARGET.into_iter().enumerate() {
            port.set_level(pin, target >> bit & 1 == 1);
        }
    }

    /// One control period: the interrupt, whatever the idle loop has to do, and the plant. Firmware that asks for a
    /// reset starts again, and the period ends with its first.
    ///
    /// # Errors
    /// Whatever stops the firmware; [`Stop::ResetRequested`] when it asks for another reset in the same period.
    pub fn period(&mut self) -> Result<Period, Stop> {
        let count = self.board.bus().encoder.count();
        let before = self.board.interrupt_cost();
        let result = match self.interrupts.step() {
            Arrival::InTime => self.part(1.0),
            Arrival::Never => {
                self.board.bus_mut().tick.drop_update();
                self.part(1.0)
            }
            Arrival::Late => {
                self.board.bus_mut().tick.drop_update();
                self.part(0.5).and_then(|()| {
                    self.board.bus_mut().tick.raise_update();
                    self.part(1.0)
                })
            }
        };
        // What was logged before the end matters most.
        if let Some(rtt) = &mut self.rtt {
            self.log.extend(rtt.period(self.log_host, &mut self.board));
        }
        result?;
        let code = self.board.bus().current_reference();
        let enabled = self.board.bus().ports[1].drives_high(12);
        let after = self.board.interrupt_cost();
        Ok(Period {
            count,
            code,
            enabled,
            instructions: after.instructions - before.instructions,
            cycles: after.cycles - before.cycles,
        })
    }

    /// The board until the control timer's next update, and the plant for as long.
    ///
    /// * `most`: periods after which the clock ends it, where it may
    fn run(&mut self, most: f64) -> Result<(), Stop> {
        let bus = self.board.bus();
        let began = bus.now;
        let result = if self.as_hardware {
            // A period is never this much longer than the timer makes it.
            let cycles = 1.01 * most * self.sample_time * bus.rcc.processor_hz() as f64;
            self.board.run_for(cycles as u64)
        } else {
            self.board.run_to_tick()
        };
        self.pass(began)?;
        result
    }

    /// The plant catches up with the board, under what the board's outputs are now.
    ///
    /// * `began`: the processor's cycles when they were last told to the plant
    fn pass(&mut self, began: u64) -> Result<(), Stop> {
        if self.held {
            return Ok(());
        }
        // Time passes at the pace of the board's own clock, in whole plant steps.
        let bus = self.board.bus();
        let (code, enabled) = (bus.current_reference(), bus.ports[1].drives_high(12));
        self.owed += (bus.now - began) as f64 / bus.rcc.processor_hz() as f64;
        while self.owed > 0.5 * self.plant_step {
            self.owed -= self.plant_step;
            let mut current = self.amplifier.step(code, enabled);
            if self.wiring.motor_reversed {
                current = -current;
            }
            self.plant.enable(enabled);
            self.plant.advance(current).map_err(|error| Stop::Fault {
                pc: 0,
                error: error.to_string(),
            })?;
        }
        self.feed_encoder(u64::MAX);
        Ok(())
    }

    /// Runs a number of periods.
    ///
    /// # Errors
    /// Whatever stops the firmware.
    pub fn periods(&mut self, periods: u32) -> Result<Vec<Period>, Stop> {
        (0..periods).map(|_| self.period()).collect()
    }

    /// Leaves the run switch open for a while and closes it, the target switches at 0: the drive
    /// commissions itself from now on.
    ///
    /// # Errors
    /// Whatever stops the firmware.
    pub fn switch_on(&mut self) -> Result<(), Stop> {
        self.switches(Switches::default());
        self.periods(SETTLED)?;
        self.switches(Switches::run(0));
        Ok(())
    }

    /// Leaves the run switch open for a while, closes it until the drive has commissioned itself and
    /// holds the origin, and opens it again.
    ///
    /// # Errors
    /// Whatever stops the firmware; [`Stop::NotCommissioned`] when the drive does not come to hold.
    pub fn commission(&mut self) -> Result<(), Stop> {
        self.switch_on()?;
        let last = self.periods(COMMISSIONING)?.pop();
        self.switches(Switches::default());
        self.periods(SETTLED)?;
        match last {
            Some(period) if period.enabled => Ok(()),
            _ => Err(Stop::NotCommissioned),
        }
    }

    /// Makes one experiment on a commissioned drive, as it [`begin`](Self::begin)s, and opens the switches. Returns
    /// what the board did in each period.
    ///
    /// # Errors
    /// Whatever stops the firmware.
    ///
    /// # Panics
    /// When no switches ask for the experiment, see [`Switches::target_of`].
    pub fn experiment(
        &mut self,
        scenario: &Scenario,
        plant: &PlantFile,
        periods: u32,
    ) -> Result<Vec<Period>, Stop> {
        self.begin(scenario, plant)?;
        let done = self.periods(periods)?;
        self.end()?;
        Ok(done)
    }

    /// Opens the switches after an experiment.
    ///
    /// # Errors
    /// Whatever stops the firmware.
    pub fn end(&mut self) -> Result<(), Stop> {
        self.switches(Switches::default());
        self.periods(SETTLED).map(drop)
    }

    /// Begins an experiment on a commissioned drive: puts the machine where it starts, holds it there, closes the
    /// run switch, and lets go when the drive is about to see its target.
    ///
    /// # Errors
    /// Whatever stops the firmware.
    ///
    /// # Panics
    /// When no switches ask for the experiment, see [`Switches::target_of`].
    pub fn begin(&mut self, scenario: &Scenario, plant: &PlantFile) -> Result<(), Stop> {
        let mut machine = Plant::new(plant, self.sample_time);
        machine.start_from(&scenario.initial_state(machine.chain()));
        self.plant = machine;
        self.held = true;
        // Carried back at a speed the encoder's filter lets through.
        let mut carried = 0;
        while self.feed_encoder(CARRY) {
            self.period()?;
            carried += 1;
            if carried > COMMISSIONING {
                return Err(Stop::NotCommissioned);
            }
        }
        self.periods(SETTLED)?;
        // The experiment's origin is the machine's.
        self.switches(Switches {
            zero: true,
            ..Switches::default()
        });
        self.periods(SETTLED)?;
        self.switches(Switches::default());
        let target = Switches::target_of(scenario).expect("the switches ask for it");
        self.switches(Switches::run(target));
        // The period in which the drive starts; its target comes in the next.
        let mut waited = 0;
        while !self.period()?.enabled {
            waited += 1;
            if waited > SETTLED {
                return Err(Stop::NotCommissioned);
            }
        }
        self.held = false;
        Ok(())
    }

    /// Plays the excitation to its end, or to the fault that ends it, from where the machine is, and
    /// opens the switches. Returns what the board did in each period of the play, the amplifier being
    /// enabled.
    ///
    /// # Errors
    /// Whatever stops the firmware; [`Stop::NotExcited`] when the play does not begin or does not end.
    pub fn excite(&mut self) -> Result<Vec<Period>, Stop> {
        self.switches(Switches::default());
        self.periods(SETTLED)?;
        self.switches(Switches::excite());
        let mut waited = 0;
        let mut period = self.period()?;
        while !period.enabled {
            waited += 1;
            if waited > RESTED {
                return Err(Stop::NotExcited);
            }
            period = self.period()?;
        }
        let mut played = Vec::new();
        while period.enabled {
            played.push(period);
            if played.len() > LONGEST_EXCITATION {
                return Err(Stop::NotExcited);
            }
            period = self.period()?;
        }
        self.switches(Switches::default());
        self.periods(SETTLED)?;
        Ok(played)
    }

    /// Turns the encoder towards where the actuator is, edge by edge, evenly over the period and by
    /// some counts at most; whether any were left to do.
    fn feed_encoder(&mut self, most: u64) -> bool {
        let actual = (self.plant.state()[0] / self.resolution).round() as i64;
        let target = self.encoder.step(actual);
        let edges = target.abs_diff(self.encoder_count).min(most);
        if edges == 0 {
            return false;
        }
        if edges > self.period_timer_clocks.into() {
            // More than one edge per timer clock: none of them is seen.
            self.encoder_count = target;
            return false;
        }
        let clocks = u32::try_from(u64::from(self.period_timer_clocks) / edges).unwrap_or(u32::MAX);
        let step = (target - self.encoder_count).signum();
        for _ in 0..edges {
            self.encoder_count += step;
            let Some(mut phases) = self.encoder.phases(self.encoder_count) else {
                continue;
            };
            if self.wiring.phases_swapped {
                std::mem::swap(&mut phases.a, &mut phases.b);
            }
            let bus = self.board.bus_mut();
            if self.wiring.encoder_unplugged {
                continue;
            }
            if bus.encoder_connected() {
                bus.encoder.edge(phases, clocks);
            } else {
                bus.encoder.settle(phases);
            }
        }
        true
    }
}
