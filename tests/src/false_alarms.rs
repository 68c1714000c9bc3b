//! Healthy drives that must not be stopped: random drives on plants that differ from them, with friction,
//! encoder noise and kicks on their loads, making random moves.
//!
//! ```text
//! random drive --design (sound ones only)--> core --count with noise--> plant 30 % off, friction, kicks
//!                                             +--> fault? a false alarm
//! ```

use crate::random_drive::{log_uniform, machine, weights};
use arso_core::{Counts, Current, Fault, Measurement, Mode, Position, Request};
use host_sim::design::Design;
use host_sim::design::assessment::require_sound;
use host_sim::drive::{Drive, PlantFile};
use host_sim::machine::ExternalForce;
use host_sim::simulate::commission;
use host_sim::simulate::corridor::corridor;
use host_sim::simulate::plant::Plant;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt;

/// A drive that was stopped.
#[derive(Clone, Debug)]
pub struct Alarm {
    /// Which drive, from 0.
    pub drive: u64,
    /// Which of its moves.
    pub made: usize,
    /// The fault.
    pub fault: Fault,
    /// What tripped it.
    pub value: f32,
    /// s after the beginning of the move.
    pub time: f64,
}

impl fmt::Display for Alarm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "drive {}, move {}: fault {} ({:?}), value {}, after {:.3} s",
            self.drive,
            self.made,
            self.fault.number(),
            self.fault,
            self.value,
            self.time
        )
    }
}

/// Length of each move and of what comes after it, in periods of the slowest mode.
const PERIODS: f64 = 14.0;

/// A sound drive: 1 to 4 loads that weigh from a fifth to twice the actuator, modes from 4 Hz on, declared
/// friction up to 3 % of the motor's force, 2,000 to 50,000 counts per move.
fn drive(random: &mut ChaCha8Rng) -> (Drive, Design) {
    loop {
        let (mut drive, omega) = machine(random, 4, 2.0);
        drive.encoder.resolution = log_uniform(random, 0.5e-6, 5e-6);
        let force = drive.actuator.force_constant * drive.actuator.current_limit;
        drive.friction.coulomb = force * random.random_range(0.0..0.03);
        drive.cost.weights = weights(random, omega);
        let Ok(design) = Design::new(&drive) else {
            continue;
        };
        if require_sound(&design).is_ok() {
            return (drive, design);
        }
    }
}

/// A plant that differs: springs and last load by up to 30 %, force constant by 10 %, friction from none to
/// 1.3 times what is declared; and a kick of up to half the motor's force on a load, for 1 to 5 ms.
fn plant(random: &mut ChaCha8Rng, drive: &Drive, slowest: f64) -> PlantFile {
    let mut plant = PlantFile::from(drive);
    let stiffness = random.random_range(0.7..1.3);
    for load in &mut plant.loads {
        load.stiffness *= stiffness;
    }
    if let Some(load) = plant.loads.last_mut() {
        load.mass *= random.random_range(0.7..1.3);
    }
    plant.actuator.force_constant *= random.random_range(0.9..1.1);
    plant.friction.coulomb *= random.random_range(0.0..1.3);
    let force = drive.actuator.force_constant * drive.actuator.current_limit;
    plant.forces.push(ExternalForce {
        mass: random.random_range(1..=drive.loads.len()),
        start: random.random_range(0.0..PERIODS / slowest),
        duration: random.random_range(1e-3..5e-3),
        newton: force * random.random_range(-0.5..0.5),
    });
    plant
}

/// Makes `moves` moves with the drive of that number; every false alarm.
///
/// # Panics
/// When a healthy drive cannot be commissioned.
#[must_use]
pub fn moves(number: u64, moves: usize) -> Vec<Alarm> {
    let mut random = ChaCha8Rng::seed_from_u64(number);
    let (drive, design) = drive(&mut random);
    let slowest = design.modes().first().map_or(1.0, |mode| mode.frequency_hz);
    let period = drive.control.sample_time;
    let mut alarms = Vec::new();
    for made in 0..moves {
        let file = plant(&mut random, &drive, slowest);
        let mut core = corridor(&design, None).expect("the design is sound");
        commission(core.as_mut(), &file, period).unwrap_or_else(|error| {
            panic!("drive {number}, move {made}: {error}");
        });
        let mut plant = Plant::new(&file, period);
        core.request(Request::Start).expect("it is ready");
        let distance = log_uniform(&mut random, 2e-3, 0.2);
        let target = Position(if random.random() { distance } else { -distance } as f32);
        let asked = Request::Move(design.encoder().place(target));
        let mut current = Current(0.0);
        for k in 0..(PERIODS / slowest / period) as usize {
            let noise = random.random_range(-1..=1_i32);
            let count = plant.count().wrapping_add_signed(noise) & 0xFFFF;
            let count = Counts(count);
            current = core
                .step(Measurement {
                    count,
                    current,
                    home: false,
                })
                .current;
            if k == 0 {
                core.request(asked).expect("it runs");
            }
            let record = core.record();
            if let Mode::Fault(fault) | Mode::Stopping(fault) = record.mode {
                alarms.push(Alarm {
                    drive: number,
                    made,
                    fault,
                    value: record.fault_value,
                    time: k as f64 * period,
                });
                break;
            }
            plant.advance(current.0.into()).expect("it is finite");
        }
    }
    alarms
}
