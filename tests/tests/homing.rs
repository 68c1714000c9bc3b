//! Homing on a flexible load: core and plant as `simulate` has them, with a stop for the actuator and a home switch.

use arso_core::request::{At, Homing};
use arso_core::{Counts, Current, Fault, Measurement, Mode, Place, Request, Velocity};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::simulate::corridor::{Corridor, corridor};
use host_sim::simulate::plant::Plant;
use std::sync::OnceLock;

/// Where the stop is, and the edge of the home switch, m.
const STOP: f64 = -12.3456e-3;
const EDGE: f64 = -8e-3;
/// What the place found is called, and how far to move back from it, counts.
const NAME: i64 = 1000;
const BACK_OFF: u32 = 5000;

fn design() -> &'static Design {
    static DESIGN: OnceLock<Design> = OnceLock::new();
    DESIGN.get_or_init(|| Design::new(&Drive::default_drive()).unwrap())
}

struct Machine {
    core: Box<dyn Corridor>,
    plant: Plant,
    current: Current,
    /// Counts at which the encoder stands still.
    dead: Option<i32>,
    /// Where the actuator was at the last reading, counts.
    place: i32,
}

impl Machine {
    /// A drive that runs, zero unknown.
    fn new(plant: &PlantFile) -> Self {
        let design = design();
        let mut machine = Self {
            core: corridor(design, None).unwrap(),
            plant: Plant::new(plant, design.drive.control.sample_time),
            current: Current(0.0),
            dead: None,
            place: 0,
        };
        machine.plant.stop_at(STOP);
        machine.core.request(Request::Commission).unwrap();
        while machine.core.record().mode != Mode::Ready {
            machine.period();
        }
        machine.core.request(Request::Start).unwrap();
        for _ in 0..800 {
            machine.period();
        }
        machine
    }

    fn period(&mut self) {
        self.place = self.plant.place() as i32;
        let seen = self.dead.map_or(self.place, |dead| self.place.max(dead));
        let command = self.core.step(Measurement {
            count: Counts(seen as u32 & 0xFFFF),
            current: self.current,
            home: self.plant.state()[0] < EDGE,
        });
        self.current = command.current;
        self.plant.enable(command.enable);
        self.plant.advance(self.current.0.into()).unwrap();
    }

    /// Until zero is known: periods, largest current against the stop until it is left, and error of the place, counts.
    fn homes(&mut self, at: At, velocity: f32) -> Result<(u32, f32, f64), Fault> {
        let homing = Homing {
            velocity: Velocity(velocity),
            at,
            position: Place(NAME),
            back_off: BACK_OFF,
        };
        self.core.request(Request::Home(homing)).unwrap();
        let (mut most, mut touched, mut left) = (0.0_f32, false, false);
        for period in 1..20_000 {
            self.period();
            let position = self.plant.state()[0];
            touched |= position <= STOP;
            left |= touched && position > STOP + 0.2e-3;
            if !left {
                most = most.max(-self.current.0);
            }
            let record = self.core.record();
            if let Some(fault) = record.mode.fault() {
                return Err(fault);
            }
            if record.position_set {
                let named = f64::from(record.position) - f64::from(self.place) * 1e-6;
                let found = if at == At::Input { EDGE } else { STOP };
                return Ok((period, most, (named + found) * 1e6 - NAME as f64));
            }
        }
        panic!("{:?}", self.core.record());
    }

    /// Farthest that any mass is from where it ought to rest, m, and fastest, m/s.
    fn off(&self, found: f64) -> (f64, f64) {
        let state = self.plant.state();
        let rests = found + f64::from(BACK_OFF) * 1e-6;
        let off = state.iter().step_by(2).map(|x| (x - rests).abs());
        let fast = state.iter().skip(1).step_by(2).map(|v| v.abs());
        (off.fold(0.0, f64::max), fast.fold(0.0, f64::max))
    }
}

fn stop(current: f32) -> At {
    At::Stop {
        current: Current(current),
    }
}

fn plants() -> Vec<(&'static str, PlantFile)> {
    let plant = |change: fn(&mut PlantFile)| {
        let mut plant = PlantFile::from(&Drive::default_drive());
        change(&mut plant);
        plant
    };
    vec![
        ("as described", plant(|_| ())),
        (
            "stiff",
            plant(|p| p.loads.iter_mut().for_each(|l| l.stiffness *= 1.3)),
        ),
        (
            "soft",
            plant(|p| p.loads.iter_mut().for_each(|l| l.stiffness *= 0.7)),
        ),
        (
            "heavy",
            plant(|p| p.loads.iter_mut().for_each(|l| l.mass *= 1.3)),
        ),
        ("weak", plant(|p| p.actuator.force_constant *= 0.9)),
        ("rubbing", plant(|p| p.friction.coulomb = 0.2)),
    ]
}

/// The stop is found to a count by no more than the current that was allowed, whatever the machine is within 30 %,
/// and every mass rests where it ought to.
#[test]
fn a_stop_is_found_to_a_count() {
    for (name, plant) in plants() {
        for current in [0.1, 0.3, 1.0] {
            for velocity in [-0.005, -0.02, -0.05] {
                let mut machine = Machine::new(&plant);
                let (periods, most, error) = machine.homes(stop(current), velocity).unwrap();
                let (off, fast) = machine.off(STOP);
                println!(
                    "{name}, {current} A, {velocity} m/s: {periods} ms, {most:.3} A, {error:.2} counts; {:.1} um, \
                     {:.2} mm/s",
                    off * 1e6,
                    fast * 1e3
                );
                assert!(most <= current && error.abs() <= 1.0);
                assert!(off < 80e-6 && fast < 5e-3);
            }
        }
    }
}

/// To what a control period goes at that velocity, and a count.
#[test]
fn an_edge_is_found_to_a_period() {
    for (name, plant) in plants() {
        for velocity in [-0.02_f32, -0.2] {
            let mut machine = Machine::new(&plant);
            let (periods, _, error) = machine.homes(At::Input, velocity).unwrap();
            println!("{name}, {velocity} m/s: {periods} ms, {error:.2} counts");
            let period = f64::from(velocity.abs()) * 1e3;
            assert!(error >= -1.0 && error <= 1.1 * period + 1.0);
            let (off, fast) = machine.off(EDGE);
            assert!(off < 80e-6 + period * 1e-6 && fast < 5e-3);
        }
    }
}

/// An encoder that dies at the beginning of the approach, or on the way: a fault, and zero stays unknown.
#[test]
fn a_dead_encoder_names_nothing() {
    for dead in [-1, -6000] {
        let mut machine = Machine::new(&plants()[0].1);
        machine.dead = Some(dead);
        machine.plant.stop_at(-10.0);
        let result = machine.homes(stop(0.3), -0.05);
        let velocity = machine.plant.state()[1];
        println!("{dead}: {result:?} at {velocity:.2} m/s");
        assert!(result.is_err() && !machine.core.record().position_set);
    }
}
