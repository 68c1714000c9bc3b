//! The moves of a rigid machine, whose plans are known in closed form: full current one way, then the other.

extern crate std;

use super::*;
use crate::moves::plans::row_words;
use crate::request::Request;
use crate::units::{Place, Travel, Velocity};
use proptest::prelude::*;
use std::vec::Vec;

/// Mass, kg; force constant, N/A; period, s; m per count; A.
const MASS: f64 = 0.116;
const FORCE_CONSTANT: f64 = 6.43;
const PERIOD: f64 = 1e-3;
const RESOLUTION: f64 = 1e-6;
const CURRENT: f64 = 1.8;
const WORDS: usize = row_words(1);
/// Periods of half of each displacement, and of the change of velocity.
const HALVES: [usize; 3] = [5, 10, 20];
const CHANGE: usize = 20;
const ROWS: usize = 2 * (HALVES[0] + HALVES[1] + HALVES[2]) + CHANGE;

const UNIT_OF_POSITION: f64 = 1.0 / (1 << 30) as f64;

const fn put(rows: &mut [i16; ROWS * WORDS], row: usize, current: i16, position: f64) {
    let places = (position / UNIT_OF_POSITION) as i32;
    rows[row * WORDS] = current;
    rows[row * WORDS + 1] = (places >> 16) as i16;
    rows[row * WORDS + 2] = places as i16;
}

const TABLE: [i16; ROWS * WORDS] = {
    let mut rows = [0; ROWS * WORDS];
    let (mut row, mut which) = (0, 0);
    while which < HALVES.len() {
        let half = HALVES[which];
        let mut k = 0;
        while k < 2 * half {
            let (h, k_) = (half as f64, k as f64);
            let (current, position) = if k < half {
                (i16::MAX, k_ * k_ / (2.0 * h * h) - 1.0)
            } else {
                (-i16::MAX, -(2.0 * h - k_) * (2.0 * h - k_) / (2.0 * h * h))
            };
            put(&mut rows, row, current, position);
            (row, k) = (row + 1, k + 1);
        }
        which += 1;
    }
    let mut k = 0;
    while k < CHANGE {
        let left = (CHANGE - k) as f64;
        let position = PERIOD * left * left / (2.0 * CHANGE as f64);
        put(&mut rows, row, i16::MAX, position);
        (row, k) = (row + 1, k + 1);
    }
    rows
};

const fn plan(first: usize, knots: usize, reach: f64) -> Plan {
    Plan {
        first: first as u32,
        knots: knots as u16,
        reach: reach as f32,
        feed_forward: (CURRENT / reach / i16::MAX as f64) as f32,
        position: UNIT_OF_POSITION as f32,
        deflection: 1e-6,
    }
}

const fn displacement(first: usize, half: usize) -> Plan {
    let time = half as f64 * PERIOD;
    plan(
        first,
        2 * half,
        CURRENT * FORCE_CONSTANT / MASS * time * time,
    )
}

/// Plans of one load that follows rigidly.
pub(crate) const RIGID: Plans<'static> = Plans {
    bend: 6.43 * 1e-6 / (4.0 * 0.116),
    stride: 1,
    displacements: &[
        displacement(0, HALVES[0]),
        displacement(2 * HALVES[0], HALVES[1]),
        displacement(2 * (HALVES[0] + HALVES[1]), HALVES[2]),
    ],
    change: plan(
        ROWS - CHANGE,
        CHANGE,
        CURRENT * FORCE_CONSTANT / MASS * CHANGE as f64 * PERIOD,
    ),
    run: (0.5 * CHANGE as f64 * PERIOD) as f32,
    rows: &TABLE,
    checksum: 0,
};

/// Moves of the rigid machine, and the machine itself under their current alone.
struct Machine {
    moves: Moves<'static>,
    memory: Memory<1>,
    target: Place,
    asked: Option<Request>,
    travel: Option<Travel>,
    position: f64,
    velocity: f64,
    /// Largest current and velocity so far.
    largest: (f64, f64),
}

impl Machine {
    fn new() -> Self {
        RIGID.check(1).unwrap();
        Self {
            moves: Moves::new(RIGID, PERIOD as f32, RESOLUTION as f32),
            memory: Memory::default(),
            target: Place(0),
            asked: None,
            travel: None,
            position: 0.0,
            velocity: 0.0,
            largest: (0.0, 0.0),
        }
    }

    /// One period; how far the machine is from its reference, m.
    fn step(&mut self) -> f64 {
        let asked = &mut self.asked;
        let directed = self
            .moves
            .direct(&mut self.memory, asked, self.target, self.travel);
        self.target = directed.unwrap();
        let reference = self.moves.step(&mut self.memory);
        let at = self.target.0 as f64 * RESOLUTION + f64::from(reference.position.0);
        let off = self.position - at;
        let current = f64::from(reference.feed_forward.0);
        let acceleration = FORCE_CONSTANT * current / MASS;
        self.position += self.velocity * PERIOD + 0.5 * acceleration * PERIOD * PERIOD;
        self.velocity += acceleration * PERIOD;
        self.largest.0 = self.largest.0.max(current.abs());
        self.largest.1 = self.largest.1.max(self.velocity.abs());
        off
    }

    /// Goes on until nothing is under way; how many periods that took.
    fn rest(&mut self) -> usize {
        let mut periods = 0;
        while !(self.memory.rests() && self.asked.is_none()) {
            self.step();
            periods += 1;
            assert!(periods < 100_000, "{:?} {:?}", self.memory, self.asked);
        }
        periods
    }
}

const REACH: f64 = CURRENT * FORCE_CONSTANT / MASS * CHANGE as f64 * PERIOD;

/// A move takes the shortest plan that reaches that far, and beyond them all two changes of velocity.
#[test]
fn each_distance_gets_its_plan() {
    let acceleration = CURRENT * FORCE_CONSTANT / MASS;
    for (counts, periods) in [
        (1, 10),
        (-2_000, 10),
        ((acceleration * 25e-6 / RESOLUTION) as i64 - 1, 10),
        ((acceleration * 25e-6 / RESOLUTION) as i64 + 1, 20),
        (-30_000, 40),
        (39_000, 40),
        (1_000_000, (1.0 / (REACH * PERIOD)).ceil() as usize + CHANGE),
    ] {
        let mut machine = Machine::new();
        machine.asked = Some(Request::Move(Place(counts)));
        let taken = machine.rest();
        // And the period that takes the last step of it.
        assert_eq!(taken, periods + 1, "{counts}");
        assert_eq!(machine.target, Place(counts));
        let off = machine.position - counts as f64 * RESOLUTION;
        assert!(
            off.abs() < 1e-6 && machine.velocity.abs() < 1e-4,
            "{counts}: {off}"
        );
    }
}

/// A cruise ends where it is asked to, when that is not behind; otherwise the drive comes back.
#[test]
fn a_cruise_is_extended_and_cut_short() {
    for (new, direct) in [(1_500_000, true), (700_001, true), (100_000, false)] {
        let mut machine = Machine::new();
        machine.asked = Some(Request::Move(Place(1_000_000)));
        for _ in 0..200 {
            machine.step();
        }
        machine.asked = Some(Request::Move(Place(new)));
        machine.step();
        assert_eq!(machine.asked.is_none(), direct);
        machine.rest();
        assert_eq!(machine.target, Place(new));
        let off = machine.position - new as f64 * RESOLUTION;
        assert!(off.abs() < 2e-6, "{new}: {off}");
    }
}

/// A jog goes on at its velocity to the last count, and ends within the travel by itself.
#[test]
fn a_jog_is_exact_and_stays_in_the_travel() {
    let mut machine = Machine::new();
    machine.asked = Some(Request::Jog(Velocity(0.123)));
    for _ in 0..1000 {
        machine.step();
    }
    let start = machine.target.0;
    for _ in 0..256_000 {
        machine.step();
    }
    // 0.123 m/s is 123 counts a period: a whole number of parts.
    assert_eq!(machine.target.0 - start, 123 * 256_000);
    machine.asked = Some(Request::Halt);
    machine.rest();
    let off = machine.position - machine.target.0 as f64 * RESOLUTION;
    // What the currents' rounding to 16 bits makes of 256 s.
    assert!(off.abs() < 1e-2, "{off}");

    let mut machine = Machine::new();
    machine.travel = Some(Travel {
        lowest: Place(-10),
        highest: Place(300_000),
    });
    machine.asked = Some(Request::Jog(Velocity(1.0)));
    machine.step();
    machine.rest();
    assert!(
        (295_000..=300_000).contains(&machine.target.0),
        "{:?}",
        machine.target
    );
}

#[derive(Clone, Debug)]
enum Ask {
    Move(i64),
    Jog(f32),
    Halt,
}

proptest! {
    /// Whatever is asked whenever: the machine under the current alone follows the reference, no limit is
    /// broken, and it rests where the target is.
    #[test]
    fn any_requests_leave_it_at_rest_at_the_target(
        asked in prop::collection::vec(
            (
                prop_oneof![
                    (-400_000_i64..400_000).prop_map(Ask::Move),
                    (-1000_i64..1000).prop_map(Ask::Move),
                    (-3.0_f32..3.0).prop_map(Ask::Jog),
                    Just(Ask::Halt),
                ],
                0_usize..150,
            ),
            1..12,
        ),
    ) {
        let mut machine = Machine::new();
        let mut farthest = 0.0_f64;
        for (ask, periods) in asked {
            machine.asked = Some(match ask {
                Ask::Move(counts) => Request::Move(Place(counts)),
                Ask::Jog(velocity) => Request::Jog(Velocity(velocity)),
                Ask::Halt => Request::Halt,
            });
            for _ in 0..periods {
                farthest = farthest.max(machine.step().abs());
            }
        }
        machine.asked = Some(Request::Halt);
        machine.rest();
        let off = machine.position - machine.target.0 as f64 * RESOLUTION;
        prop_assert!(farthest < 1e-4 && off.abs() < 1e-4, "{} {}", farthest, off);
        prop_assert!(machine.velocity.abs() < 1e-3, "{}", machine.velocity);
        prop_assert!(machine.largest.0 <= CURRENT * (1.0 + 1e-3), "{:?}", machine.largest);
        prop_assert!(machine.largest.1 <= REACH * (1.0 + 1e-3), "{:?}", machine.largest);
    }
}

/// A million moves end on the count.
#[test]
fn a_million_moves_end_on_the_count() {
    let mut machine = Machine::new();
    let mut place = 0_i64;
    let mut seed = 1_u32;
    for _ in 0..1_000_000 / 20 {
        let mut moves: Vec<i64> = Vec::new();
        for _ in 0..20 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            moves.push(i64::from(seed >> 20) - 2048);
        }
        for distance in moves {
            place += distance;
            machine.asked = Some(Request::Move(Place(place)));
            machine.rest();
        }
    }
    assert_eq!(machine.target, Place(place));
    assert!(machine.memory.rests() && machine.memory.before == (0.0, [0.0]));
}
