//! Whether drives with friction, coarse encoders and wrong models come to rest where they ought to.
//!
//! *Drives*: weights as derived, nothing that the check `stillness` warns of; 1 to 3 loads that weigh from a
//! fifth to six times the actuator, modes from 4 Hz on, 2,000 to 30,000 counts in a move of 30 mm (both cutoffs
//! as low as the check of the encoder asks for), Coulomb friction of 0.5 to 5 % of the motor's force, of which 0
//! to 200 % is fed forward.
//! *Plants*: the default drive with springs +-30 %, last load 0 to +50 %, force constant +-10 % and friction
//! up to 1.6 % of the motor's force, fed forward in the same way.
//!
//! Each makes one planned move. Within a second after its arrival the actuator has to be still, by at most one count
//! each way, and within the tolerance of the target, and it has to stay so. The simulated friction is the same
//! whether it holds or slides.

use crate::random_drive::{log_uniform, machine};
use arso_core::{Counts, Current, Measurement, Mode, Place, Request};
use host_sim::chain::controlled_mass;
use host_sim::design::Design;
use host_sim::design::assessment::Assessment;
use host_sim::design::checks::{Check, Verdict};
use host_sim::drive::{Drive, PlantFile, Weights};
use host_sim::simulate::corridor::{Corridor, Record, corridor};
use host_sim::simulate::plant::Plant;
use host_sim::simulate::stillness::stillness;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::fmt;

/// The move, m.
const DISTANCE: f64 = 0.03;
/// After which the actuator has to be still, and for how long it is then watched, s.
const STILL_AFTER: f64 = 1.0;
const WATCHED: f64 = 2.0;
/// Longest commissioning, s.
const COMMISSIONING: f64 = 5.0;
/// Counts between the ends of a motion that is still.
const STILL: i64 = 2;
/// By what both cutoffs are lowered at a time where the encoder's rounding is too loud for them, and how often.
const LOWER: f64 = 0.7;
const LOWERED: usize = 6;

/// How one move ended.
#[derive(Clone, Debug)]
pub struct Ending {
    /// Number of the drive or plant.
    pub number: u64,
    /// Peak-to-peak motion of the actuator while it was watched, counts.
    pub motion: i64,
    /// The farthest it then was from the target, over the tolerance.
    pub off: f64,
    /// Periods after which the actuator stays within the tolerance, from the beginning of the move on.
    pub actuator_within: Option<f64>,
    /// After which the controlled mass does as well.
    pub both_within: Option<f64>,
    /// The same two without friction.
    pub free: [Option<f64>; 2],
    /// What the drive is like.
    pub drive: String,
}

impl Ending {
    /// Whether the actuator goes on moving.
    #[must_use]
    pub fn hunts(&self) -> bool {
        self.motion > STILL
    }

    /// Whether it stands, or moves, outside its tolerance.
    #[must_use]
    pub fn hangs(&self) -> bool {
        // What is no number hangs.
        self.off > 1.0 || self.off.is_nan()
    }
}

/// How all of them ended.
#[derive(Clone, Debug, Default)]
pub struct Endings {
    /// Each that could be run.
    pub made: Vec<Ending>,
    /// Why others could not.
    pub failed: Vec<String>,
}

impl Endings {
    /// How many hunt.
    #[must_use]
    pub fn hunting(&self) -> usize {
        self.made.iter().filter(|ending| ending.hunts()).count()
    }

    /// How many are not within the tolerance.
    #[must_use]
    pub fn hanging(&self) -> usize {
        self.made.iter().filter(|ending| ending.hangs()).count()
    }

    /// Median, 95 % and worst of the times to the tolerance over those without friction; what has no time is longer
    /// than all.
    ///
    /// * `times`: with and without friction
    fn ratios(&self, times: impl Fn(&Ending) -> [Option<f64>; 2]) -> [f64; 3] {
        let each = self.made.iter().filter_map(|ending| {
            let [with, without] = times(ending);
            Some(with.map_or(f64::INFINITY, |time| time / without.unwrap_or(f64::NAN)))
                .filter(|ratio| !ratio.is_nan())
        });
        let mut ratios: Vec<f64> = each.collect();
        ratios.sort_by(f64::total_cmp);
        [0.5, 0.95, 1.0].map(|share: f64| {
            let rank = (share * ratios.len() as f64).ceil() as usize;
            ratios
                .get(rank.saturating_sub(1))
                .copied()
                .unwrap_or(f64::NAN)
        })
    }
}

impl fmt::Display for Endings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |ratios: [f64; 3]| ratios.map(|ratio| format!("{ratio:.2}")).join(" / ");
        let actuator = self.ratios(|ending| [ending.actuator_within, ending.free[0]]);
        let both = self.ratios(|ending| [ending.both_within, ending.free[1]]);
        let ringing = self
            .made
            .iter()
            .filter(|ending| !ending.hunts() && !ending.hangs() && ending.both_within.is_none());
        writeln!(
            f,
            "{} moves: {} hunt, {} hang outside the tolerance, {} failed; on {} more the load alone is outside it at \
             the end. Time to the tolerance over that without friction, median / 95 % / worst: actuator {}, \
             with the controlled mass {}",
            self.made.len(),
            self.hunting(),
            self.hanging(),
            self.failed.len(),
            ringing.count(),
            list(actuator),
            list(both),
        )?;
        for ending in self.made.iter().filter(|e| e.hunts() || e.hangs()) {
            writeln!(
                f,
                "  {}: {}{}moves by {} counts, {:.2} tolerances off; {}",
                ending.number,
                if ending.hunts() { "hunts, " } else { "" },
                if ending.hangs() { "hangs, " } else { "" },
                ending.motion,
                ending.off,
                ending.drive,
            )?;
        }
        for failed in &self.failed {
            writeln!(f, "  {failed}")?;
        }
        Ok(())
    }
}

/// Moves of so many random drives, each on a plant that has the friction and is else as designed.
#[must_use]
pub fn drives(count: u64, seed: u64) -> Endings {
    all(count, |number| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number);
        let (design, coulomb) = drive(&mut random);
        let mut plant = PlantFile::from(&design.drive);
        plant.friction.coulomb = coulomb;
        ending(number, &design, &plant)
    })
}

/// Moves of the default drive on so many plants with friction and model error together.
///
/// # Panics
/// When the default drive cannot be designed.
#[must_use]
pub fn plants(count: u64, seed: u64) -> Endings {
    let nominal = Design::new(&Drive::default_drive()).expect("the default drive can be designed");
    nominal.plans().expect("it has plans");
    all(count, |number| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number);
        let mut plant = PlantFile::from(&nominal.drive);
        let stiffness = random.random_range(0.7..1.3);
        for load in &mut plant.loads {
            load.stiffness *= stiffness;
        }
        if let Some(load) = plant.loads.last_mut() {
            load.mass *= random.random_range(1.0..1.5);
        }
        plant.actuator.force_constant *= random.random_range(0.9..1.1);
        let largest = nominal.drive.actuator.largest_force();
        plant.friction.coulomb = largest * random.random_range(0.0..0.0155);
        let mut design = nominal.clone();
        design.drive.friction.coulomb = plant.friction.coulomb * random.random_range(0.0..2.0);
        ending(number, &design, &plant)
    })
}

fn all(count: u64, one: impl Fn(u64) -> Result<Ending, String> + Sync + Send) -> Endings {
    let each: Vec<Result<Ending, String>> = (0..count).into_par_iter().map(one).collect();
    let mut endings = Endings::default();
    for ending in each {
        match ending {
            Ok(ending) => endings.made.push(ending),
            Err(why) => endings.failed.push(why),
        }
    }
    endings
}

/// A sound drive, and the friction that its machine has, N.
fn drive(random: &mut ChaCha8Rng) -> (Design, f64) {
    loop {
        let (mut drive, _) = machine(random, 3, 6.0);
        drive.encoder.resolution = DISTANCE / log_uniform(random, 2e3, 30e3);
        drive.cost.weights = Weights::Derived;
        let coulomb = drive.actuator.largest_force() * random.random_range(0.005..0.05);
        drive.friction.coulomb = coulomb * random.random_range(0.0..2.0);
        if let Some(design) = sound(drive) {
            return (design, coulomb);
        }
    }
}

/// The drive's design with cutoffs as low as its encoder needs them, if it is sound and `design` does not warn that
/// it would not come to rest.
fn sound(mut drive: Drive) -> Option<Design> {
    for _ in 0..LOWERED {
        let design = Design::new(&drive).ok()?;
        let checks = Assessment::new(&design).ok()?.checks;
        if checks.iter().any(|check| check.verdict == Verdict::Refuse) {
            return None;
        }
        let noisy =
            |check: &Check| check.name == "encoder_force_noise" && check.verdict != Verdict::Pass;
        if !checks.iter().any(noisy) {
            design.plans().ok()?;
            let still = stillness(&design).ok()?.verdict == Verdict::Pass;
            return still.then_some(design);
        }
        drive.control.disturbance_cutoff *= LOWER;
        drive.control.reaction_force_cutoff *= LOWER;
    }
    None
}

/// One move with friction, and the same without any, there or fed forward.
fn ending(number: u64, design: &Design, plant: &PlantFile) -> Result<Ending, String> {
    let drive = &design.drive;
    let mut without = (design.clone(), plant.clone());
    without.0.drive.friction.coulomb = 0.0;
    without.1.friction.coulomb = 0.0;
    let stride = design.plans().map_or(0, |plans| plans.plans().stride);
    let failed = |why: String| format!("{number}: {why} (plans with steps of {stride} periods)");
    let run = moved(design, plant).map_err(failed)?;
    let free = moved(&without.0, &without.1);
    let free = free.map_err(|why| failed(format!("without friction: {why}")))?;
    let tolerance = design.motion.settling_tolerance;
    let watched = run.actuator.iter().skip(run.still_after);
    let counts = watched
        .clone()
        .map(|error| error / drive.encoder.resolution);
    let (low, high) = counts.fold((f64::MAX, f64::MIN), |(low, high), count| {
        (low.min(count), high.max(count))
    });
    let off = watched.map(|error| error.abs() / tolerance);
    let within = |run: &Motion| {
        run.within(tolerance)
            .map(|time| time.map(|periods| periods as f64))
    };
    let [actuator_within, both_within] = within(&run);
    Ok(Ending {
        number,
        motion: (high.round() - low.round()) as i64,
        off: off.fold(0.0, f64::max),
        actuator_within,
        both_within,
        free: within(&free),
        drive: format!(
            "{} loads of {:.2} times the actuator, mode {:.1} Hz, {:.0} counts a move, friction {:.1} %, {:.0} % of it \
             fed forward",
            drive.loads.len(),
            drive.total_mass() / drive.actuator.mass - 1.0,
            design.modes().first().map_or(0.0, |mode| mode.frequency_hz),
            DISTANCE / drive.encoder.resolution,
            100.0 * plant.friction.coulomb / drive.actuator.largest_force(),
            100.0 * drive.friction.coulomb / plant.friction.coulomb,
        ),
    })
}

/// Distances from the target in each period from the beginning of a move on, m.
struct Motion {
    actuator: Vec<f64>,
    controlled: Vec<f64>,
    /// Period from which on the actuator has to be still.
    still_after: usize,
}

impl Motion {
    /// Periods after which the actuator, and with it the controlled mass, stays within the tolerance.
    fn within(&self, tolerance: f64) -> [Option<usize>; 2] {
        let inside = |error: &f64| error.abs() <= tolerance;
        let from = |mass: &[f64]| match mass.iter().rposition(|error| !inside(error)) {
            None => Some(0),
            Some(last) => Some(last + 1).filter(|first| *first < mass.len()),
        };
        let actuator = from(&self.actuator);
        let controlled = from(&self.controlled);
        [actuator, actuator.zip(controlled).map(|(a, b)| a.max(b))]
    }
}

/// Commissions the drive, and makes one planned move from where the machine then stands.
fn moved(design: &Design, file: &PlantFile) -> Result<Motion, String> {
    let period = design.drive.control.sample_time;
    let told = |error: host_sim::error::Error| error.to_string();
    let mut core = corridor(design, None).map_err(told)?;
    let mut plant = Plant::new(file, period);
    let mut current = Current(0.0);
    let mut step = |core: &mut dyn Corridor, plant: &mut Plant| -> Result<Record, String> {
        let count = Counts(plant.count());
        let command = core.step(Measurement {
            count,
            current,
            home: false,
        });
        current = command.current;
        plant.enable(command.enable);
        let state = core.record();
        if let Mode::Fault(fault) | Mode::Stopping(fault) = state.mode {
            return Err(format!("{fault:?}, value {}", state.fault_value));
        }
        plant.advance(current.0.into()).map_err(told)?;
        Ok(state)
    };
    let ask = |core: &mut dyn Corridor, request| {
        core.request(request).map_err(|refusal| refusal.to_string())
    };
    ask(core.as_mut(), Request::Commission)?;
    let mut patience = (COMMISSIONING / period) as usize;
    while step(core.as_mut(), &mut plant)?.mode != Mode::Ready {
        patience = patience.checked_sub(1).ok_or("commissioning did not end")?;
    }
    ask(core.as_mut(), Request::SetPosition(Place(0)))?;
    ask(core.as_mut(), Request::Start)?;
    let counts = (DISTANCE / design.drive.encoder.resolution).round();
    ask(core.as_mut(), Request::Move(Place(counts as i64)))?;
    let target = (plant.place() as f64 + counts) * design.drive.encoder.resolution;
    let arrival = design.plans().map_err(told)?.duration(DISTANCE, period);
    let still_after = (arrival + STILL_AFTER / period) as usize;
    let mass = 2 * controlled_mass(design.loads());
    let mut motion = Motion {
        actuator: Vec::new(),
        controlled: Vec::new(),
        still_after,
    };
    for k in 0..still_after + (WATCHED / period) as usize {
        motion.actuator.push(plant.state()[0] - target);
        motion.controlled.push(plant.state()[mass] - target);
        let time = k as f64 * period;
        step(core.as_mut(), &mut plant)
            .map_err(|why| format!("{why}, {time:.3} s after the beginning of the move"))?;
    }
    Ok(motion)
}
