//! Homing on a rigid machine with a stop, which the actuator does not pass.

use super::*;
use crate::request::{At, Homing};

/// The most that the encoder's motion may change in a period, m, and the current of an approach, A.
const STEP: f32 = 120e-6;
const CURRENT: f32 = 0.3;
/// Where the stop is, and from where on the home switch is active, m and counts.
const WALL: f64 = -5e-3;
const EDGE: i64 = -3000;

const STOP: Homing = Homing {
    velocity: Velocity(-0.05),
    at: At::Stop {
        current: Current(CURRENT),
    },
    position: Place(200),
    back_off: 2000,
};
const INPUT: Homing = Homing {
    at: At::Input,
    ..STOP
};

/// A machine of 0.116 kg, and the drive that is on it.
struct Machine {
    controller: Drive,
    position: f64,
    velocity: f64,
    current: f32,
    /// What the encoder makes of the counts that there are.
    seen: fn(i64) -> i64,
    stop: bool,
    /// Largest current and velocity since the last request, and counts at which the switch was first active.
    most: (f32, f64),
    edge: Option<i64>,
    /// Its line is disturbed.
    spike: bool,
}

impl Machine {
    /// One that is held near its origin, zero unknown.
    fn new(change: impl FnOnce(&mut Settings<1, Anchored<1, 5>>)) -> Self {
        let mut settings = settings();
        settings.protection.encoder_step = STEP;
        settings.protection.stiction = 0.4;
        change(&mut settings);
        let mut controller = drive(&settings);
        commission(&mut controller);
        controller.request(Request::Start).unwrap();
        let position = f64::from(controller.telemetry().position);
        let mut machine = Self {
            controller,
            position,
            velocity: 0.0,
            current: 0.0,
            seen: |counts| counts,
            stop: true,
            most: (0.0, 0.0),
            edge: None,
            spike: false,
        };
        machine.periods(200);
        machine
    }

    fn counts(&self) -> i64 {
        (self.position / 1e-6).round() as i64
    }

    fn ask(&mut self, request: Request) -> Result<(), Reason> {
        self.most = (0.0, 0.0);
        self.controller
            .request(request)
            .map_err(|refusal| refusal.reason)
    }

    fn period(&mut self) {
        let counts = self.counts();
        let home = counts <= EDGE;
        if home && self.edge.is_none() {
            self.edge = Some(counts);
        }
        let command = self.controller.step(Measurement {
            home: home || self.spike,
            ..measured((self.seen)(counts) as u32 & 0xFFFF, self.current)
        });
        self.current = command.current.0;
        let acceleration = f64::from(6.43 * self.current) / 0.116;
        self.position += self.velocity * 1e-3 + 0.5 * acceleration * 1e-6;
        self.velocity += acceleration * 1e-3;
        if self.stop && self.position < WALL {
            self.position = WALL;
            self.velocity = self.velocity.max(0.0);
        }
        self.most.0 = self.most.0.max(self.current.abs());
        self.most.1 = self.most.1.max(self.velocity.abs());
    }

    fn periods(&mut self, periods: usize) {
        for _ in 0..periods {
            self.period();
        }
    }

    /// Until it no longer homes; the largest current before it moved back.
    fn homed(&mut self) -> f32 {
        let mut largest = 0.0;
        for _ in 0..100_000 {
            self.period();
            let running = match &self.controller.activity {
                Activity::Running(running) => running.homing.as_ref(),
                _ => None,
            };
            if running.is_some_and(|homing| homing.found().is_none()) {
                largest = self.most.0;
            }
            if !self.controller.doing().homes {
                return largest;
            }
        }
        panic!("it homes for ever");
    }

    fn set(&self) -> bool {
        self.controller.telemetry().position_set
    }

    fn fault(&self) -> Option<Fault> {
        self.controller.mode().fault()
    }
}

#[test]
fn a_stop_is_found_and_named() {
    for (velocity, back_off) in [(-0.05, 2000), (-0.01, 100), (-0.058, 2000)] {
        let mut machine = Machine::new(|_| ());
        let homing = Homing {
            velocity: Velocity(velocity),
            back_off,
            ..STOP
        };
        machine.ask(Request::Home(homing)).unwrap();
        assert!(machine.controller.doing().homes && !machine.controller.doing().jogs);
        let largest = machine.homed();
        assert!(largest <= CURRENT, "{largest}");
        assert_eq!(machine.controller.mode(), Mode::Running);
        assert!(machine.set());
        // What the stop is called, by the machine's own counts.
        let named = machine.controller.encoder.place().0 - machine.counts();
        assert_eq!(named, 200 - (WALL / 1e-6) as i64);
        let rests = Place(200 + i64::from(back_off));
        assert_eq!(machine.controller.doing().course, Course::Held(rests));
        assert!(machine.velocity.abs() < 1e-3);
        assert!((machine.position - WALL - f64::from(back_off) * 1e-6).abs() < 50e-6);
        // It goes on as any.
        machine.ask(Request::Move(Place(10_000))).unwrap();
        machine.periods(800);
        assert!((machine.position - WALL - 9800e-6).abs() < 50e-6);
    }
}

#[test]
fn the_edge_is_latched_in_its_period() {
    for back_off in [0, 2000] {
        let mut machine = Machine::new(|_| ());
        let homing = Homing { back_off, ..INPUT };
        machine.ask(Request::Home(homing)).unwrap();
        machine.homed();
        let named = machine.controller.encoder.place().0 - machine.counts();
        let edge = machine.edge.unwrap();
        assert!((edge - EDGE).abs() <= 60, "{edge}");
        assert_eq!(named, 200 - edge);
        let rests = Place(200 + i64::from(back_off));
        assert_eq!(machine.controller.doing().course, Course::Held(rests));
        assert!(machine.set());
    }
}

/// One that is active for less than three periods is none, and what moves is not homed: the edge may lie behind.
#[test]
fn a_spike_is_no_edge() {
    let mut machine = Machine::new(|_| ());
    machine.ask(Request::Home(INPUT)).unwrap();
    machine.periods(20);
    for active in [true, true, false, true, false] {
        machine.spike = active;
        machine.period();
    }
    machine.spike = false;
    assert_eq!(machine.ask(Request::Home(INPUT)), Err(Reason::Homing));
    machine.homed();
    let named = machine.controller.encoder.place().0 - machine.counts();
    assert_eq!(named, 200 - machine.edge.unwrap());

    let mut machine = Machine::new(|_| ());
    for request in [Request::MoveBy(2000), Request::Jog(Velocity(-0.05))] {
        machine.ask(request).unwrap();
        machine.periods(10);
        for homing in [INPUT, STOP] {
            assert_eq!(machine.ask(Request::Home(homing)), Err(Reason::Moving));
        }
    }
}

/// Nor is one that friction, or what the machine is held with, could not be told from.
#[test]
fn an_approach_that_tells_nothing_is_refused() {
    let mut machine = Machine::new(|settings| settings.friction.coulomb = 1.5);
    let with = |current: f32, velocity: f32| {
        Request::Home(Homing {
            at: At::Stop {
                current: Current(current),
            },
            velocity: Velocity(velocity),
            ..STOP
        })
    };
    // 1.5 N are 0.2333 A, which is nine tenths of 0.2592 A.
    assert_eq!(machine.ask(with(0.255, -0.05)), Err(Reason::Current));
    assert_eq!(machine.ask(with(0.3, -50e-6)), Err(Reason::Velocity));
    assert_eq!(machine.ask(with(0.3, -0.05)), Ok(()));
}

/// Whatever the places are called, the commands are the same to the bit, and so they are in the period in which the
/// names change.
#[test]
fn new_names_are_not_felt() {
    let run = |position| {
        let mut machine = Machine::new(|_| ());
        machine
            .ask(Request::Home(Homing { position, ..STOP }))
            .unwrap();
        let commands = (0..2000).map(|_| {
            machine.period();
            machine.current
        });
        let commands: Vec<f32> = commands.collect();
        assert!(machine.set());
        commands
    };
    let near = run(Place(5));
    assert!(near == run(Place(1 << 40)));
    assert!(near == run(Place(-(1 << 50))));
}

#[test]
fn what_cannot_find_a_place_is_refused() {
    let stop = |current| At::Stop {
        current: Current(current),
    };
    let homing = |change: fn(&mut Homing)| {
        let mut homing = STOP;
        change(&mut homing);
        homing
    };
    for (homing, reason) in [
        (homing(|h| h.velocity.0 = 0.0), Reason::Velocity),
        (homing(|h| h.velocity.0 = f32::NAN), Reason::Velocity),
        (homing(|h| h.velocity.0 = f32::INFINITY), Reason::Velocity),
        // A stop would be taken for a fault of the encoder.
        (homing(|h| h.velocity.0 = 0.061), Reason::Velocity),
        (
            Homing {
                at: stop(2.0),
                ..STOP
            },
            Reason::Current,
        ),
        (
            Homing {
                at: stop(f32::NAN),
                ..STOP
            },
            Reason::Current,
        ),
        (
            Homing {
                at: stop(-0.3),
                ..STOP
            },
            Reason::Current,
        ),
        // 1.5 N of friction through 6.43 N/A.
        (
            Homing {
                at: stop(0.23),
                ..STOP
            },
            Reason::Current,
        ),
        (homing(|h| h.back_off = 50), Reason::BackOff),
        (homing(|h| h.back_off = 20_000), Reason::Travel),
    ] {
        let mut machine = Machine::new(|settings| {
            settings.friction.coulomb = 1.5;
            settings.protection.travel = Some(Travel {
                lowest: Place(0),
                highest: Place(10_000),
            });
        });
        assert_eq!(
            machine.ask(Request::Home(homing)),
            Err(reason),
            "{homing:?}"
        );
        assert!(!machine.controller.doing().homes);
    }
    let mut machine = Machine::new(|_| ());
    machine.ask(Request::Move(Place(-4000))).unwrap();
    machine.periods(500);
    assert_eq!(machine.ask(Request::Home(INPUT)), Err(Reason::HomeSwitch));
    assert_eq!(machine.ask(Request::Home(STOP)), Ok(()));
    machine.period();
    for request in [
        Request::Move(Place(0)),
        Request::MoveBy(5),
        Request::Step(Place(0)),
        Request::Jog(Velocity(0.1)),
        Request::Home(INPUT),
    ] {
        assert_eq!(machine.ask(request), Err(Reason::Homing));
    }
}

/// The machine runs on for 1.5 times the travel, or a minute, and is brought to a stand.
#[test]
fn where_there_is_nothing_it_says_so() {
    // Twice the time to settle more than the way takes.
    for (travel, expected) in [(Some(40_000), 1.4), (None, 60.2)] {
        let mut machine = Machine::new(|settings| {
            settings.protection.travel = travel.map(|counts| Travel {
                lowest: Place(0),
                highest: Place(counts),
            });
        });
        machine.stop = false;
        let velocity = Velocity(0.05);
        machine
            .ask(Request::Home(Homing {
                velocity,
                position: Place(5000),
                ..INPUT
            }))
            .unwrap();
        let from = machine.position;
        machine.homed();
        assert_eq!(machine.controller.mode(), Mode::Stopping(Fault::Homing));
        let value = machine.controller.telemetry().fault_value;
        assert!((value - expected).abs() < 2e-3, "{value}");
        let way = machine.position - from;
        assert!((way - 0.05 * f64::from(expected)).abs() < 2e-3, "{way}");
        machine.periods(1100);
        assert_eq!(machine.controller.mode(), Mode::Fault(Fault::Homing));
        assert!(machine.velocity.abs() < 1e-3 && !machine.set());
    }
}

/// Pushed, it cannot be told from a stop; it is by the way back, before anything is named.
#[test]
fn an_encoder_that_dies_is_found() {
    for (seen, faults) in [
        (
            (|counts| counts.max(-2000)) as fn(i64) -> i64,
            [Fault::EncoderStep, Fault::Stalled],
        ),
        // Another one turns round.
        (
            |counts| {
                if counts < -2000 {
                    -4000 - counts
                } else {
                    counts
                }
            },
            [Fault::Velocity, Fault::EncoderStep],
        ),
    ] {
        let mut machine = Machine::new(|_| ());
        machine.stop = false;
        machine.seen = seen;
        machine.ask(Request::Home(STOP)).unwrap();
        machine.homed();
        let fault = machine.fault().unwrap();
        assert!(faults.contains(&fault), "{fault:?}");
        assert_eq!(machine.controller.mode(), Mode::Fault(fault));
        assert!(!machine.set());
        // By its limited current for the time that it takes.
        assert!(machine.most.1 < 2.5, "{}", machine.most.1);
    }
}

/// Zero is what it was, on the way, against the stop and on the way back.
#[test]
fn a_halt_ends_it_and_changes_nothing() {
    for after in [1, 50, 130, 320, 350, 365] {
        let mut machine = Machine::new(|_| ());
        machine.ask(Request::Stop).unwrap();
        machine.ask(Request::SetPosition(Place(7_000_000))).unwrap();
        machine.periods(60);
        machine.ask(Request::Start).unwrap();
        machine.periods(60);
        let named = machine.controller.encoder.place().0 - machine.counts();
        machine.ask(Request::Home(STOP)).unwrap();
        machine.periods(after);
        assert!(machine.controller.doing().homes, "{after}");
        machine.ask(Request::Halt).unwrap();
        machine.homed();
        assert_eq!(machine.controller.mode(), Mode::Running, "{after}");
        machine.periods(300);
        assert_eq!(
            machine.controller.encoder.place().0 - machine.counts(),
            named
        );
        assert!(machine.velocity.abs() < 1e-3);
        assert!(matches!(machine.controller.doing().course, Course::Held(_)));
        machine.ask(Request::Stop).unwrap();
    }
}

/// Its ends do not stop the search; they count again when it has found zero, or has been given up at rest.
#[test]
fn the_travel_counts_again_once_zero_is_known() {
    let travel = |settings: &mut Settings<1, Anchored<1, 5>>| {
        settings.protection.travel = Some(Travel {
            lowest: Place(0),
            highest: Place(20_000),
        });
    };
    let mut machine = Machine::new(travel);
    machine.ask(Request::Stop).unwrap();
    machine.ask(Request::SetPosition(Place(1000))).unwrap();
    machine.periods(60);
    machine.ask(Request::Start).unwrap();
    machine.periods(60);
    // It stands 5 mm from the stop, and 1 mm from the end.
    machine.ask(Request::Home(STOP)).unwrap();
    machine.periods(60);
    assert!(machine.controller.telemetry().position < -500e-6);
    machine.ask(Request::Halt).unwrap();
    machine.homed();
    assert_eq!(machine.controller.mode(), Mode::Running);
    assert_eq!(
        machine.ask(Request::Move(Place(-5000))),
        Err(Reason::Travel)
    );
    let position = Place(-500);
    machine.periods(300);
    machine
        .ask(Request::Home(Homing { position, ..STOP }))
        .unwrap();
    machine.homed();
    assert!(machine.set());
    machine.ask(Request::Move(Place(10))).unwrap();
    machine.periods(600);
    assert_eq!(machine.controller.mode(), Mode::Running);
    // Somebody pulls it out of its travel.
    machine.seen = |counts| counts - 30;
    machine.periods(3);
    assert_eq!(machine.fault(), Some(Fault::Travel));
}
