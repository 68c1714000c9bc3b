//! One move teaches the drive: how often, how well, and what real machines have beside the model.
//!
//! ```text
//! drive file -> gains -> first move on a plant that differs -> its record -> identified -> drive file
//!            -> gains -> second move on the same plant -> settling, against the plant's own bound
//! ```
//!
//! Frequencies are held against those of the plant, which the identification never sees.

use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::error::{Error, Result};
use host_sim::identify::{
    Columns, Experiment, Identification, Log, Parameters, drive_file, identify,
};
use host_sim::machine::chain_of;
use host_sim::simulate::bound::bound_from;
use host_sim::simulate::sequence::{MoveSequence, simulate_moves};
use host_sim::simulate::watch::watched_moves;
use host_sim::simulate::{Law, Run};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::fmt::{self, Display, Formatter, Write};

/// Friction of the *wide* set, over the motor's largest force: 0.2 N of the default drive.
const FRICTION: f64 = 0.2 / 12.86;

/// Plants far from the drive file: springs ±30 %, last load 0 to +50 %, force constant ±10 %, friction up to
/// 1.6 % of the motor's force.
#[must_use]
pub fn wide(drive: &Drive, count: usize, seed: u64) -> Vec<PlantFile> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let force = drive.actuator.largest_force();
    let plants = (0..count).map(|_| {
        let mut plant = PlantFile::from(drive);
        let stiffness = random.random_range(0.7..=1.3);
        for load in &mut plant.loads {
            load.stiffness *= stiffness;
        }
        if let Some(last) = plant.loads.last_mut() {
            last.mass *= random.random_range(1.0..=1.5);
        }
        plant.actuator.force_constant *= random.random_range(0.9..=1.1);
        plant.friction.coulomb = random.random_range(0.0..=FRICTION) * force;
        plant
    });
    plants.collect()
}

/// A record of a run, as `simulate --csv` writes it.
#[must_use]
pub fn record(run: &Run) -> String {
    let mut text = String::from("time[s],count[1],applied_current[A]\n");
    for sample in &run.samples {
        let _ = writeln!(
            text,
            "{:.6},{},{}",
            sample.time, sample.count, sample.applied_current
        );
    }
    text
}

/// What of a drive a record is to say: all but the scale of the forces.
pub(crate) fn parameters(drive: &Drive) -> Result<Parameters> {
    let hold = ["actuator.force_constant".to_owned()];
    Parameters::new(drive, Experiment::Excitation, &hold)
}

/// What a record says of a drive.
///
/// # Errors
/// What the identification refuses.
pub fn learned(drive: &Drive, record: &str) -> Result<Identification> {
    let log = Log::parse(record.as_bytes(), "record", drive, &Columns::default())?;
    identify(drive, &[log], &parameters(drive)?, &|_, _, _| ())
}

/// What is true of a plant as a whole: its `acceleration`, or the frequency of a `mode`.
#[must_use]
pub fn truth_of_the_whole(plant: &PlantFile, name: &str) -> Option<f64> {
    let chain = chain_of(&plant.actuator, &plant.loads, plant.friction.viscous);
    if name == "acceleration" {
        let total: f64 = chain.mass.iter().sum();
        return Some(chain.force_constant / total);
    }
    let number: usize = name.strip_prefix("mode ")?.parse().ok()?;
    Some(chain.modes().get(number - 1)?.frequency_hz)
}

/// Largest error of the figures that an identification gives of the whole, over what is true; that of the
/// frequencies and the acceleration.
#[must_use]
pub fn error_of_the_whole(identification: &Identification, plant: &PlantFile) -> f64 {
    let known = identification
        .figures
        .iter()
        .filter(|figure| figure.known());
    known
        .filter_map(|figure| {
            Some((figure.value / truth_of_the_whole(plant, &figure.name)? - 1.0).abs())
        })
        .fold(0.0, f64::max)
}

/// What became of one plant.
#[derive(Clone, Debug)]
pub struct Lesson {
    /// Settling time of the first move, s; none when it does not settle.
    pub first: Option<f64>,
    /// Of the second; none when it does not settle, or when nothing was learned.
    pub second: Option<f64>,
    /// Least time in which the plant can settle, s.
    pub bound: f64,
    /// What stood in the way.
    pub refused: Option<String>,
}

/// A first move, what it teaches, and a second.
///
/// * `text`: the drive file
///
/// # Errors
/// Of the simulation.
pub fn lesson(design: &Design, text: &str, plant: &PlantFile, distance: f64) -> Result<Lesson> {
    let (run, first) = moved(design, plant, distance)?;
    let start = run.samples.first().map(|sample| sample.truth.clone());
    let start = start.ok_or_else(|| Error::Simulation("no sample".into()))?;
    let bound = bound_from(&design.drive, plant, &start, distance);
    let bound = bound.map_or(f64::NAN, |bound| bound.settled);
    let taught = || -> Result<Option<f64>> {
        let found = learned(&design.drive, &record(&run))?;
        let text = drive_file(text, &found.quantities)?;
        let drive = Drive::parse(&text, "learned")?;
        let design = Design::new(&drive)?;
        Ok(moved(&design, plant, distance)?.1)
    };
    let (second, refused) = match taught() {
        Ok(second) => (second, None),
        Err(error) => (None, Some(error.to_string())),
    };
    Ok(Lesson {
        first,
        second,
        bound,
        refused,
    })
}

/// A planned move: the run, and when it settles.
fn moved(design: &Design, plant: &PlantFile, distance: f64) -> Result<(Run, Option<f64>)> {
    let sequence = MoveSequence::new(design, &[distance], &[])?;
    let duration = sequence.duration();
    let (run, judged) = watched_moves(design, plant, &sequence, Law::Core, duration)?;
    let settled = judged
        .first()
        .and_then(|(_, metrics)| metrics.settling_time);
    Ok((run, settled))
}

/// All plants of a set.
#[derive(Clone, Debug)]
pub struct Lessons(pub Vec<Lesson>);

/// Teaches each plant.
///
/// # Errors
/// Of the simulation.
pub fn lessons(
    design: &Design,
    text: &str,
    plants: &[PlantFile],
    distance: f64,
) -> Result<Lessons> {
    let all = plants
        .par_iter()
        .map(|plant| lesson(design, text, plant, distance))
        .collect::<Result<_>>()?;
    Ok(Lessons(all))
}

impl Lessons {
    /// Plants of which something was learned.
    #[must_use]
    pub fn learned(&self) -> usize {
        self.0.iter().filter(|one| one.refused.is_none()).count()
    }

    /// A share of all, sorted, those that never settle last.
    fn quantile(&self, share: f64, of: impl Fn(&Lesson) -> Option<f64>) -> f64 {
        let mut all: Vec<f64> = self
            .0
            .iter()
            .map(|one| of(one).unwrap_or(f64::INFINITY))
            .collect();
        all.sort_by(f64::total_cmp);
        let last = all.len().saturating_sub(1);
        all.get((share * last as f64).ceil() as usize)
            .copied()
            .unwrap_or(f64::NAN)
    }

    /// Second move over the bound that 95 % of the plants keep.
    #[must_use]
    pub fn second_over_bound(&self) -> f64 {
        self.quantile(0.95, |one| Some(one.second? / one.bound))
    }
}

impl Display for Lessons {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let row =
            |f: &mut Formatter<'_>, name: &str, of: &dyn Fn(&Lesson) -> Option<f64>, scale: f64| {
                let [median, most, worst] =
                    [0.5, 0.95, 1.0].map(|share| scale * self.quantile(share, of));
                writeln!(f, "| {name} | {median:.2} | {most:.2} | {worst:.2} |")
            };
        writeln!(f, "learned: {} of {}", self.learned(), self.0.len())?;
        for (number, one) in self.0.iter().enumerate() {
            match (&one.refused, one.second) {
                (Some(refused), _) => writeln!(f, "  plant {number} is refused: {refused}")?,
                (None, None) => writeln!(f, "  plant {number} does not settle in its second move")?,
                (None, Some(_)) => {}
            }
        }
        writeln!(f, "| | median | 95 % | worst |")?;
        writeln!(f, "|---|---|---|---|")?;
        row(f, "first move, ms", &|one| one.first, 1e3)?;
        row(f, "second move, ms", &|one| one.second, 1e3)?;
        row(f, "bound, ms", &|one| Some(one.bound), 1e3)?;
        row(
            f,
            "second over bound",
            &|one| Some(one.second? / one.bound),
            1.0,
        )
    }
}

/// One thing that real machines have, put into a plant or its record.
pub struct Imperfection {
    /// Its name.
    pub name: &'static str,
    plant: fn(&mut PlantFile),
    record: fn(&str, &mut ChaCha8Rng) -> String,
}

/// What became of the plants that have it.
#[derive(Clone, Debug, Default)]
pub struct Degradation {
    /// The whole within 2 %.
    pub right: usize,
    /// Refused.
    pub refused: Vec<String>,
    /// Given, and more than 2 % off.
    pub wrong: Vec<f64>,
    /// What was said beside the figures, and how often.
    pub remarks: std::collections::BTreeMap<String, usize>,
}

/// What frequencies may be off.
const WITHIN: f64 = 0.02;

fn as_it_is(record: &str, _: &mut ChaCha8Rng) -> String {
    record.to_owned()
}

/// The record with some rows changed or left out.
fn rows(record: &str, mut of: impl FnMut(usize, [f64; 3]) -> Option<[f64; 3]>) -> String {
    let mut lines = record.lines();
    let mut text = format!("{}\n", lines.next().unwrap_or_default());
    for (number, line) in lines.enumerate() {
        let mut fields = line
            .split(',')
            .map(|field| field.parse().unwrap_or(f64::NAN));
        let row = [(); 3].map(|()| fields.next().unwrap_or(f64::NAN));
        if let Some([time, count, current]) = of(number, row) {
            let _ = writeln!(text, "{time:.6},{count:.0},{current}");
        }
    }
    text
}

/// The rows of the table.
#[must_use]
pub fn imperfections() -> Vec<Imperfection> {
    let plain = |name, plant| Imperfection {
        name,
        plant,
        record: as_it_is,
    };
    vec![
        plain("nothing", |_| ()),
        plain("lag 0.1 ms", |p| p.actuator.lag = 1e-4),
        plain("lag 0.5 ms", |p| p.actuator.lag = 5e-4),
        plain("lag 2 ms", |p| p.actuator.lag = 2e-3),
        plain("delay 1 ms", |p| p.actuator.delay = 1e-3),
        plain("load friction 0.05 N", |p| p.loads[1].coulomb = 0.05),
        plain("load viscous 0.05 N s/m", |p| p.loads[1].viscous = 0.05),
        plain("static friction twice Coulomb", |p| {
            p.friction.breakaway = p.friction.coulomb;
            p.friction.stribeck_velocity = 5e-3;
        }),
        plain("friction by direction, half backwards", |p| {
            p.friction.coulomb_backward = Some(0.5 * p.friction.coulomb);
        }),
        plain("gravity 0.2 N", |p| {
            p.forces.push(host_sim::machine::ExternalForce {
                mass: 0,
                start: 0.0,
                duration: 1e3,
                newton: -0.2,
            });
        }),
        plain("cogging 0.1 N, 8 mm", |p| {
            p.imperfections.cogging.amplitude = 0.1;
            p.imperfections.cogging.pitch = 8e-3;
        }),
        plain("backlash 20 um", |p| p.imperfections.backlash = vec![2e-5]),
        plain("backlash 100 um", |p| p.imperfections.backlash = vec![1e-4]),
        plain("eccentricity 100 um, 20 mm", |p| {
            p.imperfections.eccentricity.amplitude = 1e-4;
            p.imperfections.eccentricity.pitch = 2e-2;
        }),
        plain("encoder noise 5 counts", |p| {
            p.imperfections.noise = 5.0 * p.encoder.resolution;
        }),
        Imperfection {
            name: "current offset 20 mA",
            plant: |_| (),
            record: |record, _| rows(record, |_, [t, x, i]| Some([t, x, i + 0.02])),
        },
        Imperfection {
            name: "jitter 5 % of the period",
            plant: |_| (),
            record: |record, random| {
                rows(record, |_, [t, x, i]| {
                    Some([(t + random.random_range(0.0..5e-5)), x, i])
                })
            },
        },
        Imperfection {
            name: "one row in 100 missing",
            plant: |_| (),
            record: |record, random| {
                rows(record, |number, row| {
                    (number < 5 || random.random_range(0.0..1.0) > 0.01).then_some(row)
                })
            },
        },
    ]
}

/// What comes of some plants that have one thing more.
///
/// # Errors
/// Of the simulation.
pub fn degradation(
    design: &Design,
    plants: &[PlantFile],
    distance: f64,
    imperfection: &Imperfection,
) -> Result<Degradation> {
    let sequence = MoveSequence::new(design, &[distance], &[])?;
    let taught = |number: usize, plant: &PlantFile| {
        let run = simulate_moves(design, plant, &sequence, Law::Core, sequence.duration())?;
        let mut random = ChaCha8Rng::seed_from_u64(number as u64);
        let record = (imperfection.record)(&record(&run), &mut random);
        learned(&design.drive, &record)
    };
    // A drive that stops itself refuses too.
    let all: Vec<(Result<Identification>, PlantFile)> = plants
        .par_iter()
        .enumerate()
        .map(|(number, plant)| {
            let mut plant = plant.clone();
            (imperfection.plant)(&mut plant);
            (taught(number, &plant), plant)
        })
        .collect();
    let mut result = Degradation::default();
    for (found, plant) in all {
        match found {
            Err(error) => result.refused.push(error.to_string()),
            Ok(found) => {
                for remark in &found.remarks {
                    let kind: String = remark.chars().filter(|c| !c.is_ascii_digit()).collect();
                    *result.remarks.entry(kind).or_default() += 1;
                }
                let error = error_of_the_whole(&found, &plant);
                if error <= WITHIN {
                    result.right += 1;
                } else {
                    result.wrong.push(error);
                }
            }
        }
    }
    Ok(result)
}
