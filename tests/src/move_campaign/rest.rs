//! Whether drives with friction, coarse encoders and wrong models come to rest where they ought to.
//!
//! *Drives*: 1 to 3 loads that weigh from a fifth to six times the actuator, modes from 4 Hz on, 2,000 to 30,000
//! counts in a move of 30 mm (both cutoffs as low as the check of the encoder asks for), Coulomb friction of 0.5 to 5 % of the motor's force, of which 0 to 200 % is fed forward.
//! *Plants*: the default drive with springs +-30 %, last load 0 to +50 %, force constant +-10 % and friction
//! up to 1.6 % of the motor's force, fed forward in the same way.
//!
//! Each makes one planned move. Within a second after its arrival the actuator has to be still, by at most one count
//! each way, and within the tolerance of the target, and it has to stay so. The simulated friction is the same
//! whether it holds or slides.

use super::log_uniform;
use host_sim::chain::controlled_mass;
use host_sim::design::Design;
use host_sim::design::assessment::Assessment;
use host_sim::design::checks::{Check, Verdict};
use host_sim::drive::{Drive, PlantFile, Weights};
use host_sim::machine::Load;
use host_sim::simulate::scenario::{Approach, SCENARIOS, Scenario};
use host_sim::simulate::{Law, Run, simulate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::fmt;

/// The move, m.
const DISTANCE: f64 = 0.03;
/// After which the actuator has to be still, and for how long it is then watched, s.
const STILL_AFTER: f64 = 1.0;
const WATCHED: f64 = 2.0;
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
    /// After which the actuator stays within the tolerance, s from the beginning of the move.
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
        // Written so that what is no number hangs.
        !(self.off <= 1.0)
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
        let mut drive = Drive::default_drive();
        let loads = random.random_range(1..=3);
        let actuator = log_uniform(random, 0.03, 3.0);
        let load = actuator * log_uniform(random, 0.2, 6.0) / f64::from(loads);
        let omega = std::f64::consts::TAU * log_uniform(random, 4.0, 25.0);
        drive.actuator.mass = actuator;
        // The acceleration of the whole, m/s².
        let acceleration = log_uniform(random, 20.0, 200.0);
        let total = actuator + load * f64::from(loads);
        drive.actuator.force_constant = acceleration * total / drive.actuator.current_limit;
        drive.loads = (0..loads)
            .map(|_| {
                let mass = load * random.random_range(0.7..1.4);
                let stiffness = mass * (omega * random.random_range(0.8..1.3)).powi(2);
                let damping = 2.0 * random.random_range(0.004..0.05) * (stiffness * mass).sqrt();
                Load {
                    mass,
                    stiffness,
                    damping,
                }
            })
            .collect();
        drive.encoder.resolution = DISTANCE / log_uniform(random, 2e3, 30e3);
        drive.cost.weights = Weights::SettlingTime {
            seconds: log_uniform(random, 12.0, 25.0) / omega,
            place: String::new(),
        };
        drive.cost.terminal = vec![0.0; 2 * loads as usize + 2];
        drive.motion = Default::default();
        let coulomb = drive.actuator.largest_force() * random.random_range(0.005..0.05);
        drive.friction.coulomb = coulomb * random.random_range(0.0..2.0);
        if let Some(design) = sound(drive) {
            return (design, coulomb);
        }
    }
}

/// The drive's design with cutoffs as low as its encoder needs them, if it is sound.
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
            return design.plans().is_ok().then_some(design);
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
    let (run, arrival) = moved(number, design, plant)?;
    let (free, _) = moved(number, &without.0, &without.1)?;
    let tolerance = design.motion.settling_tolerance;
    let watched = run.samples.iter();
    let watched = watched.filter(|sample| sample.time >= arrival + STILL_AFTER);
    let counts = watched
        .clone()
        .map(|sample| sample.truth[0] / run.resolution);
    let (low, high) = counts.fold((f64::MAX, f64::MIN), |(low, high), count| {
        (low.min(count), high.max(count))
    });
    let off = watched.map(|sample| (sample.truth[0] - DISTANCE).abs() / tolerance);
    let mass = 2 * controlled_mass(design.loads());
    Ok(Ending {
        number,
        motion: (high.round() - low.round()) as i64,
        off: off.fold(0.0, f64::max),
        actuator_within: within(&run, &[0], tolerance),
        both_within: within(&run, &[0, mass], tolerance),
        free: [
            within(&free, &[0], tolerance),
            within(&free, &[0, mass], tolerance),
        ],
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

/// One planned move, and when it arrives.
fn moved(number: u64, design: &Design, plant: &PlantFile) -> Result<(Run, f64), String> {
    let scenario = Scenario {
        approach: Approach::Move,
        target: DISTANCE,
        ..SCENARIOS[0]
    };
    let told = |error: host_sim::error::Error| format!("{number}: {error}");
    let period = design.drive.control.sample_time;
    let arrival = period * design.plans().map_err(told)?.duration(DISTANCE, period);
    let duration = arrival + STILL_AFTER + WATCHED;
    let run = simulate(design, plant, &scenario, Law::Core, duration).map_err(told)?;
    match run.fault {
        None => Ok((run, arrival)),
        Some((time, fault)) => {
            let value = run.samples.last().and_then(|sample| sample.record.as_ref());
            Err(format!(
                "{number}: {fault:?} after {time:.3} s with friction of {:.3} {}, value {:?}",
                plant.friction.coulomb,
                design.drive.kind.units().force,
                value.map(|record| record.fault_value),
            ))
        }
    }
}

/// After which some elements of the state stay within the tolerance of the target, s.
fn within(run: &Run, elements: &[usize], tolerance: f64) -> Option<f64> {
    let inside = |x: f64| (x - DISTANCE).abs() <= tolerance;
    let last = run.samples.iter().rposition(|sample| {
        let all = elements
            .iter()
            .all(|element| inside(sample.truth[*element]));
        !all
    });
    let from = last.map_or(0, |last| last + 1);
    run.samples.get(from).map(|sample| sample.time)
}
