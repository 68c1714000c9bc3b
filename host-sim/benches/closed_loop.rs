//! What a control period costs in simulation: the core alone, the plant alone, the closed loop with its figures.
//!
//! ```text
//! cargo bench -p host-sim --bench closed_loop                  all parts, 1 to 6 loads
//! cargo bench -p host-sim --bench closed_loop -- plant 3       one part, so many loads
//! ```
//!
//! The default drive, its load repeated, with a short table of plans, moves by 30 mm there and back every 0.4 s. Core
//! and plant alone are given what the other said in the closed loop; `loop` is both with the figures of every move
//! taken as they pass, `kept` with every sample kept first. A figure is the least time of a long run less that of a short
//! one, over the periods between: what is done before the loop is gone.
//!
//! Instructions, which repeat to the last one: run one part under callgrind over so many periods and over twice as
//! many, 20,000 at most, and take the difference.
//!
//! ```text
//! valgrind --tool=callgrind --callgrind-out-file=/dev/null BINARY plant 3 10000
//! ```

use arso_core::{Command, Counts, Current, Measurement, Mode, Place, Request};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile, Weights};
use host_sim::simulate::corridor::{Corridor, corridor};
use host_sim::simulate::metrics::Metrics;
use host_sim::simulate::plant::Plant;
use host_sim::simulate::sequence::{MoveSequence, simulate_moves};
use host_sim::simulate::watch::measure_moves;
use host_sim::simulate::{Law, commission};
use std::hint::black_box;
use std::time::Instant;

/// m.
const DISTANCE: f64 = 0.03;
/// Control periods from one move to the next.
const EVERY: usize = 400;
/// Control periods of a long run, and of a short one.
const PERIODS: usize = 20_000;
const SHORT: usize = 2_000;
/// Runs of each length.
const PASSES: usize = 15;
/// Bytes of the table of plans: fewer plans, sooner found.
const TABLE: usize = 16_000;

/// The parts that are measured.
const PARTS: [&str; 4] = ["core", "plant", "kept", "loop"];

fn main() {
    // Cargo says `--bench` first.
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let number = |at: usize| arguments.get(at).and_then(|text| text.parse().ok());
    let parts: Vec<&str> = match arguments.first() {
        Some(part) => vec![part.as_str()],
        None => PARTS.to_vec(),
    };
    let loads: Vec<usize> = number(1).map_or_else(|| (1..=6).collect(), |loads| vec![loads]);
    let counted: Option<usize> = number(2);
    println!(
        "{:>5} {:>6} {:>10} {:>12}",
        "loads", "part", "ns/period", "x real time"
    );
    for loads in loads {
        let bench = Bench::new(loads);
        for part in &parts {
            if let Some(periods) = counted {
                bench.pass(part, periods);
                continue;
            }
            let least = |periods| {
                let each = (0..PASSES).map(|_| bench.pass(part, periods));
                each.fold(f64::INFINITY, f64::min)
            };
            let each = (least(PERIODS) - least(SHORT)) / (PERIODS - SHORT) as f64;
            let times = bench.period / each;
            println!("{loads:>5} {part:>6} {:>10.1} {times:>12.0}", 1e9 * each);
        }
    }
}

/// A drive, its plant, and what each said to the other.
struct Bench {
    design: Design,
    plant: PlantFile,
    sequence: MoveSequence,
    /// s.
    period: f64,
    counts: Vec<u32>,
    currents: Vec<Current>,
}

impl Bench {
    fn new(loads: usize) -> Self {
        let mut drive = Drive::default_drive();
        let load = drive.loads[0].clone();
        drive.loads.resize(loads, load);
        drive.cost.weights = Weights::Given {
            position: vec![225.0; loads + 1],
            velocity: vec![0.2; loads + 1],
        };
        drive.motion.table = Some(TABLE);
        let design = Design::new(&drive).expect("a design");
        let moves = PERIODS.div_ceil(EVERY);
        let period = drive.control.sample_time;
        let distances: Vec<f64> = (0..moves).map(|one| there_and_back(one).0).collect();
        let times: Vec<f64> = (0..moves)
            .map(|one| (one * EVERY) as f64 * period)
            .collect();
        let sequence = MoveSequence::new(&design, &distances, &times).expect("moves");
        let mut bench = Self {
            plant: PlantFile::from(&drive),
            design,
            sequence,
            period,
            counts: Vec::new(),
            currents: Vec::new(),
        };
        bench.record();
        bench
    }

    /// Closes the loop once and remembers what went through it.
    fn record(&mut self) {
        let mut core = self.core();
        let mut plant = self.plant();
        let (mut counts, mut currents) = (Vec::new(), Vec::new());
        let mut current = Current(0.0);
        for number in 0..PERIODS {
            let count = plant.count();
            counts.push(count);
            let command = step(core.as_mut(), number, count, current);
            current = command.current;
            currents.push(current);
            plant.enable(command.enable);
            plant.advance(current.0.into()).expect("motion");
        }
        drop(core);
        (self.counts, self.currents) = (counts, currents);
    }

    /// A core that has been commissioned and is started.
    fn core(&self) -> Box<dyn Corridor + '_> {
        let mut core = corridor(&self.design, None).expect("a core");
        let place = commission(core.as_mut(), &self.plant, self.period).expect("commissioned");
        core.request(Request::SetPosition(place)).expect("set");
        core.request(Request::Start).expect("started");
        core
    }

    fn plant(&self) -> Plant {
        Plant::new(&self.plant, self.period)
    }

    /// Seconds that a part takes over so many periods.
    fn pass(&self, part: &str, periods: usize) -> f64 {
        let (design, plant, moves) = (&self.design, &self.plant, &self.sequence);
        let duration = periods as f64 * self.period;
        match part {
            "core" => {
                let mut core = self.core();
                timed(|| {
                    let mut current = Current(0.0);
                    for (number, count) in self.counts[..periods].iter().enumerate() {
                        current = step(core.as_mut(), number, *count, current).current;
                    }
                    assert_eq!(core.found().mode, Mode::Running);
                    assert_eq!(current, self.currents[periods - 1]);
                })
            }
            "plant" => {
                let mut plant = self.plant();
                plant.enable(true);
                timed(|| {
                    for current in &self.currents[..periods] {
                        black_box(plant.count());
                        plant.advance(current.0.into()).expect("motion");
                    }
                    black_box(plant.state());
                })
            }
            "loop" => timed(|| {
                let metrics = measure_moves(design, plant, moves, Law::Core, duration);
                black_box(metrics.expect("figures"));
            }),
            "kept" => timed(|| {
                let run = simulate_moves(design, plant, moves, Law::Core, duration);
                black_box(Metrics::new(&run.expect("a run")));
            }),
            other => panic!("{other} is none of {PARTS:?}"),
        }
    }
}

/// Seconds that it takes.
fn timed(run: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    run();
    begin.elapsed().as_secs_f64()
}

fn step(core: &mut dyn Corridor, number: usize, count: u32, current: Current) -> Command {
    if number.is_multiple_of(EVERY) {
        let place = Place(there_and_back(number / EVERY).1);
        core.request(Request::Move(place)).expect("a move");
    }
    core.step(Measurement {
        count: Counts(count),
        current,
        home: false,
    })
}

/// Distance of a move, m, and where it leads, counts of the default drive.
fn there_and_back(number: usize) -> (f64, i64) {
    if number.is_multiple_of(2) {
        (DISTANCE, 30_000)
    } else {
        (-DISTANCE, 0)
    }
}
