//! Whether what identification says of itself is true: how often its intervals hold the machine.
//!
//! ```text
//! drawn machine -> record of one kind -> identified from a drive file that is off -> (figure - truth) / sigma
//! ```
//!
//! Only figures that are given count: quantities, acceleration, and modes.

use crate::learning::{learned, parameters, record, truth_of_the_whole};
use crate::random_drive::machine;
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile, Weights};
use host_sim::error::Result;
use host_sim::excite::{ExcitationPlan, ExcitationRequest};
use host_sim::identify::Identification;
use host_sim::simulate::plant::Plant;
use host_sim::simulate::scenario::Scenario;
use host_sim::simulate::sequence::{MoveSequence, simulate_moves};
use host_sim::simulate::{Law, simulate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use std::fmt::{self, Display, Formatter, Write};

/// What a record is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An excitation, with noise of amplifier and encoder.
    Noisy,
    /// An excitation, with noise of the encoder alone.
    NoisyEncoder,
    /// An excitation, with nothing but the encoder's rounding.
    Rounded,
    /// A raw step.
    Steps,
    /// Two planned moves.
    Moves,
}

/// All of them.
pub const KINDS: [Kind; 5] = [
    Kind::Noisy,
    Kind::NoisyEncoder,
    Kind::Rounded,
    Kind::Steps,
    Kind::Moves,
];

/// Noise of the amplifier, rms over the largest current of the excitation, and of the encoder, counts rms.
const NOISE: (f64, f64) = (0.01, 1.0);
/// Friction of the drawn machines, most, over the motor's largest force.
const FRICTION: f64 = 0.016;
/// m.
const DISTANCE: f64 = 0.03;

/// A machine, and the drive file that is not quite its own.
fn drawn(random: &mut ChaCha8Rng) -> (Drive, Drive) {
    let (mut truth, _) = machine(random, 6, 6.0);
    truth.cost.weights = Weights::Derived;
    truth.friction.coulomb = random.random_range(0.0..FRICTION) * truth.actuator.largest_force();
    let mut guess = truth.clone();
    guess.friction.coulomb = 0.0;
    guess.actuator.mass *= random.random_range(0.9..1.1);
    let stiffness = random.random_range(0.77..1.3);
    for load in &mut guess.loads {
        load.mass *= random.random_range(0.85..1.15);
        load.stiffness *= stiffness * random.random_range(0.95..1.05);
        load.damping *= random.random_range(0.5..2.0);
    }
    (truth, guess)
}

/// What the machine did, as CSV.
fn recorded(kind: Kind, truth: &Drive, guess: &Drive, random: &mut ChaCha8Rng) -> Result<String> {
    let mut plant = PlantFile::from(truth);
    match kind {
        Kind::Steps => {
            let design = Design::new(truth)?;
            let scenario = Scenario::named("fig3").expect("there is such a scenario");
            simulate(&design, &plant, scenario, Law::Core, 1.0).map(|run| record(&run))
        }
        Kind::Moves => {
            let design = Design::new(truth)?;
            let sequence = MoveSequence::new(&design, &[DISTANCE, -DISTANCE], &[])?;
            simulate_moves(&design, &plant, &sequence, Law::Core, sequence.duration())
                .map(|run| record(&run))
        }
        Kind::Noisy | Kind::NoisyEncoder | Kind::Rounded => {
            let plan = ExcitationPlan::new(guess, &ExcitationRequest::default())?;
            if kind != Kind::Rounded {
                plant.imperfections.noise = NOISE.1 * plant.encoder.resolution;
            }
            let amplifier = if kind == Kind::Noisy { NOISE.0 } else { 0.0 };
            let noise = Normal::new(0.0, amplifier * plan.peak()).expect("it is finite");
            let mut plant = Plant::new(&plant, plan.sample_time);
            let mut text = String::from("time[s],count[1],applied_current[A]\n0,0,0\n");
            // Beside the count the current over the period before.
            for (period, current) in (1_u32..).zip(plan.currents()) {
                plant.advance(f64::from(current) + noise.sample(random))?;
                let time = f64::from(period) * plan.sample_time;
                let _ = writeln!(text, "{time:.6},{},{current}", plant.count());
            }
            Ok(text)
        }
    }
}

/// How one figure came out.
#[derive(Clone, Debug)]
pub struct Held {
    /// Its name.
    pub name: String,
    /// Over its standard deviation.
    pub error: f64,
    /// Over its true value.
    pub relative: f64,
}

/// All figures that an identification gives.
fn held(found: &Identification, machine: &Drive) -> Result<Vec<Held>> {
    let truth = parameters(machine)?;
    let one = |name: String, value: f64, std: f64, truth: f64| Held {
        name,
        error: (value - truth).abs() / std,
        relative: (value / truth - 1.0).abs(),
    };
    let quantities = found.quantities.iter().filter(|q| q.known && !q.held);
    let quantities = quantities.map(|q| {
        let truth = truth.value(truth.start(), q.quantity);
        one(q.quantity.name(), q.value, q.std, truth)
    });
    let plant = PlantFile::from(machine);
    let figures = found.figures.iter().filter(|figure| figure.known());
    let figures = figures.filter_map(|figure| {
        let truth = truth_of_the_whole(&plant, &figure.name)?;
        Some(one(figure.name.clone(), figure.value, figure.std, truth))
    });
    Ok(quantities.chain(figures).collect())
}

/// What became of one drive.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Which.
    pub number: usize,
    /// Its loads.
    pub loads: usize,
    /// Of what its record was.
    pub kind: Kind,
    /// What was given of it, or why nothing was.
    pub given: std::result::Result<Vec<Held>, Nothing>,
}

/// Why a drive has no figures.
#[derive(Clone, Debug)]
pub enum Nothing {
    /// It has no record: gains or excitation were refused.
    NotRecorded(String),
    /// What it was told of its record.
    Refused(String),
}

/// What became of all.
#[derive(Clone, Debug)]
pub struct Coverage(pub Vec<Outcome>);

/// Draws drives by their numbers; the kinds take turns.
///
/// * `told`: of each as it is done
#[must_use]
pub fn coverage(
    drives: std::ops::Range<usize>,
    seed: u64,
    told: impl Fn(&Outcome) + Sync,
) -> Coverage {
    let outcomes = drives.into_par_iter().map(|number| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number as u64);
        let (machine, guess) = drawn(&mut random);
        let kind = KINDS[number % KINDS.len()];
        let given = match recorded(kind, &machine, &guess, &mut random) {
            Err(error) => Err(Nothing::NotRecorded(error.to_string())),
            Ok(record) => learned(&guess, &record)
                .and_then(|found| held(&found, &machine))
                .map_err(|error| Nothing::Refused(error.to_string())),
        };
        let outcome = Outcome {
            number,
            loads: machine.loads.len(),
            kind,
            given,
        };
        told(&outcome);
        outcome
    });
    Coverage(outcomes.collect())
}

impl Coverage {
    fn figures(&self, kind: Option<Kind>) -> impl Iterator<Item = (&Outcome, &Held)> {
        let of_kind = move |one: &&Outcome| kind.is_none_or(|kind| one.kind == kind);
        self.0.iter().filter(of_kind).flat_map(|one| {
            let given = one.given.iter().flatten();
            given.map(move |held| (one, held))
        })
    }

    /// Share of the figures within three of their standard deviations.
    #[must_use]
    pub fn within_three(&self, kind: Option<Kind>) -> f64 {
        let (mut all, mut within) = (0, 0);
        for (_, held) in self.figures(kind) {
            all += 1;
            within += usize::from(held.error <= 3.0);
        }
        f64::from(within as u32) / f64::from(all.max(1))
    }

    /// The figure that is farthest off, in its standard deviations.
    #[must_use]
    pub fn worst(&self, kind: Option<Kind>) -> f64 {
        let errors = self.figures(kind).map(|(_, held)| held.error);
        errors.fold(0.0, f64::max)
    }
}

impl Display for Coverage {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| | drives | refused | figures | within 3 sigma | worst, sigma |"
        )?;
        writeln!(f, "|---|---|---|---|---|---|")?;
        for kind in KINDS.into_iter().map(Some).chain([None]) {
            let of_kind = |one: &&Outcome| kind.is_none_or(|kind| one.kind == kind);
            let (mut drives, mut refused) = (0, 0);
            for one in self.0.iter().filter(of_kind) {
                drives += usize::from(!matches!(one.given, Err(Nothing::NotRecorded(_))));
                refused += usize::from(matches!(one.given, Err(Nothing::Refused(_))));
            }
            writeln!(
                f,
                "| {} | {drives} | {refused} | {} | {:.1} % | {:.1} |",
                kind.map_or("all".into(), |kind| format!("{kind:?}")),
                self.figures(kind).count(),
                100.0 * self.within_three(kind),
                self.worst(kind)
            )?;
        }
        Ok(())
    }
}

impl Display for Outcome {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "drive {} ({} loads, {:?}): ",
            self.number, self.loads, self.kind
        )?;
        match &self.given {
            Err(Nothing::NotRecorded(why)) => write!(f, "not recorded: {why}"),
            Err(Nothing::Refused(refused)) => write!(f, "refused: {refused}"),
            Ok(figures) => {
                write!(f, "{} figures", figures.len())?;
                for held in figures.iter().filter(|held| held.error > 3.0) {
                    write!(
                        f,
                        ", {} off by {:.1} sigma, {:.2} %",
                        held.name,
                        held.error,
                        100.0 * held.relative
                    )?;
                }
                Ok(())
            }
        }
    }
}
