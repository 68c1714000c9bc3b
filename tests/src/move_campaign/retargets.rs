//! Random retargets, jogs and stops on the nominal plant.
//!
//! A session is a drive that is commissioned once and then asked again and again, at any moment of what is under
//! way; every few requests it is left alone until its reference rests, and judged.

use crate::random_drive::log_uniform;
use arso_core::{Counts, Current, Measurement, Mode, Place, Request, Velocity};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::simulate::commission;
use host_sim::simulate::corridor::{Corridor, corridor};
use host_sim::simulate::plant::Plant;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::fmt;

/// Requests of a session, and requests before it is left to arrive, at most.
const SESSION: usize = 50;
const BURST: usize = 6;
/// Ends of the travel that is used, m from where the session begins.
const TRAVEL: f64 = 0.5;
/// Most control periods from one request to the next, for an arrival, and for which it is then watched.
const PAUSE: usize = 300;
const PATIENCE: usize = 20_000;
const WATCHED: usize = 250;
/// Control periods for which a reference that rests stands on one place.
const RESTS: usize = 8;
/// Vibration that may be left after an arrival, peak to peak of any mass, m.
pub const RESIDUAL: f64 = 20e-6;
/// Rounding of a reference in `f32`, counts, and of its velocity, as a share.
const ROUNDING: (f64, f64) = (0.1, 1e-3);

/// What became of the requests.
#[derive(Clone, Debug, Default)]
pub struct Retargets {
    /// How many were taken.
    pub requests: usize,
    /// How many arrivals were judged.
    pub arrivals: usize,
    /// The largest peak-to-peak motion of a mass after an arrival, m.
    pub residual: f64,
    /// Arrivals after which it was more than [`RESIDUAL`].
    pub ringing: usize,
    /// Arrivals whose reference is not on the count that was asked for, or not on a whole one after a stop.
    pub beside: usize,
    /// Arrivals after which the actuator was not within the tolerance.
    pub outside: usize,
    /// The farthest the actuator was from its reference after an arrival, m.
    pub error: f64,
    /// Periods in which the current was at its limit, or the reference faster than the velocity limit.
    pub limited: usize,
    /// See `limited`.
    pub too_fast: usize,
    /// Largest current (A) and reference velocity (m/s).
    pub current: f64,
    /// See `current`.
    pub velocity: f64,
    /// Sessions that ended otherwise, and how.
    pub broken: Vec<String>,
}

impl Retargets {
    fn and(mut self, other: Self) -> Self {
        self.requests += other.requests;
        self.arrivals += other.arrivals;
        self.residual = self.residual.max(other.residual);
        self.ringing += other.ringing;
        self.beside += other.beside;
        self.outside += other.outside;
        self.error = self.error.max(other.error);
        self.limited += other.limited;
        self.too_fast += other.too_fast;
        self.current = self.current.max(other.current);
        self.velocity = self.velocity.max(other.velocity);
        self.broken.extend(other.broken);
        self
    }

    /// Whether nothing failed.
    #[must_use]
    pub fn passed(&self) -> bool {
        let failures = [
            self.ringing,
            self.beside,
            self.outside,
            self.limited,
            self.too_fast,
        ];
        failures.iter().all(|number| *number == 0) && self.broken.is_empty()
    }
}

impl fmt::Display for Retargets {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} requests, {} arrivals: {} ring by more than {:.0} um (worst {:.1} um), {} beside the count, {} \
             outside the tolerance (worst {:.1} um); {} periods at the current limit (peak {:.3} A), {} beyond the \
             velocity limit (peak {:.4} m/s); {} sessions broken",
            self.requests,
            self.arrivals,
            self.ringing,
            1e6 * RESIDUAL,
            1e6 * self.residual,
            self.beside,
            self.outside,
            1e6 * self.error,
            self.limited,
            self.current,
            self.too_fast,
            self.velocity,
            self.broken.len()
        )?;
        for broken in &self.broken {
            writeln!(f, "{broken}")?;
        }
        Ok(())
    }
}

/// So many requests to the default drive, in sessions.
///
/// # Panics
/// When the default drive cannot be designed.
#[must_use]
pub fn retargets(requests: usize, seed: u64) -> Retargets {
    let design = Design::new(&Drive::default_drive()).expect("the default drive can be designed");
    design.plans().expect("it has plans");
    let sessions = requests.div_ceil(SESSION);
    let run = |number: usize| {
        let mut session = Session::new(&design, seed, number as u64);
        let asked = SESSION.min(requests - number * SESSION);
        if let Err(why) = session.run(asked) {
            let told = format!(
                "session {number}, request {}: {why}",
                session.found.requests
            );
            session.found.broken.push(told);
        }
        session.found
    };
    let each: Vec<Retargets> = (0..sessions).into_par_iter().map(run).collect();
    each.into_iter().fold(Retargets::default(), Retargets::and)
}

struct Session<'d> {
    design: &'d Design,
    core: Box<dyn Corridor + 'd>,
    plant: Plant,
    current: Current,
    /// Reference of the period before, m.
    before: Option<f64>,
    random: ChaCha8Rng,
    found: Retargets,
}

impl<'d> Session<'d> {
    fn new(design: &'d Design, seed: u64, number: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number);
        let file = PlantFile::from(&design.drive);
        Self {
            design,
            core: corridor(design, None).expect("the default drive can be built"),
            plant: Plant::new(&file, design.drive.control.sample_time),
            current: Current(0.0),
            before: None,
            random,
            found: Retargets::default(),
        }
    }

    fn run(&mut self, requests: usize) -> Result<(), String> {
        let period = self.design.drive.control.sample_time;
        let file = PlantFile::from(&self.design.drive);
        let told = |error: &dyn fmt::Display| error.to_string();
        let place = commission(self.core.as_mut(), &file, period).map_err(|e| told(&e))?;
        self.ask(Request::SetPosition(place))?;
        self.ask(Request::Start)?;
        let mut left = requests;
        while left > 0 {
            let burst = self.random.random_range(1..=BURST.min(left));
            for made in 1..=burst {
                let last = made == burst;
                let request = self.request(last);
                self.ask(request)?;
                self.found.requests += 1;
                if last {
                    self.arrive(request)?;
                } else {
                    for _ in 0..self.random.random_range(1..=PAUSE) {
                        self.period()?;
                    }
                }
            }
            left -= burst;
        }
        Ok(())
    }

    fn ask(&mut self, request: Request) -> Result<(), String> {
        self.core
            .request(request)
            .map_err(|refusal| refusal.to_string())
    }

    /// * `last`: whether it has to come to rest
    fn request(&mut self, last: bool) -> Request {
        let (resolution, at) = (self.design.drive.encoder.resolution, self.plant.state()[0]);
        let counts = |position: f64| Place((position / resolution).round() as i64);
        let sign = if self.random.random() { 1.0 } else { -1.0 };
        // Back from the ends of the travel.
        if at.abs() > TRAVEL {
            return Request::Move(counts(self.random.random_range(-TRAVEL..TRAVEL)));
        }
        match self.random.random_range(0..if last { 7 } else { 10 }) {
            0..5 => {
                let distance = log_uniform(&mut self.random, resolution, TRAVEL);
                Request::Move(counts(at + sign * distance))
            }
            5..7 => Request::Halt,
            _ => {
                let limit = self.design.motion.velocity;
                let velocity = log_uniform(&mut self.random, 1e-4 * limit, limit);
                Request::Jog(Velocity((sign * velocity) as f32))
            }
        }
    }

    /// One control period; the reference.
    fn period(&mut self) -> Result<f64, String> {
        let measurement = Measurement {
            count: Counts(self.plant.count()),
            current: self.current,
            home: false,
        };
        let command = self.core.step(measurement);
        self.current = command.current;
        self.plant.enable(command.enable);
        let record = self.core.record();
        if record.mode != Mode::Running {
            return Err(format!("{:?}, value {}", record.mode, record.fault_value));
        }
        let drive = &self.design.drive;
        let current = f64::from(command.current.0).abs();
        self.found.limited +=
            usize::from(command.limited || current > drive.actuator.current_limit);
        self.found.current = self.found.current.max(current);
        let reference = f64::from(record.reference);
        if let Some(before) = self.before {
            let velocity = (reference - before).abs() / drive.control.sample_time;
            let limit = self.design.motion.velocity * (1.0 + ROUNDING.1);
            self.found.too_fast += usize::from(velocity > limit);
            self.found.velocity = self.found.velocity.max(velocity);
        }
        self.before = Some(reference);
        let advanced = self.plant.advance(command.current.0.into());
        advanced.map_err(|error| error.to_string())?;
        Ok(reference)
    }

    /// Until the reference rests where it was asked to, and then the judgement.
    fn arrive(&mut self, request: Request) -> Result<(), String> {
        let resolution = self.design.drive.encoder.resolution;
        let target = match request {
            Request::Move(place) => Some(place.0),
            _ => None,
        };
        let (mut place, mut stood) = (f64::NAN, 0);
        for _ in 0..PATIENCE {
            let reference = self.period()?;
            stood = if reference == place { stood + 1 } else { 0 };
            place = reference;
            let there =
                target.is_none_or(|target| (place / resolution - target as f64).abs() < 0.5);
            if stood >= RESTS && there {
                break;
            }
        }
        if stood < RESTS {
            return Err(format!("{request:?} does not arrive"));
        }
        let counts = place / resolution;
        let whole = target.map_or(counts.round(), |target| target as f64);
        self.found.beside += usize::from((counts - whole).abs() > ROUNDING.0);
        let masses = self.design.loads() + 1;
        let mut ends = vec![(f64::MAX, f64::MIN); masses];
        let mut error = 0.0_f64;
        for _ in 0..WATCHED {
            let reference = self.period()?;
            if reference != place {
                return Err(format!("{request:?} leaves its place again"));
            }
            for (mass, (low, high)) in ends.iter_mut().enumerate() {
                let position = self.plant.state()[2 * mass];
                (*low, *high) = (low.min(position), high.max(position));
            }
            error = error.max((self.plant.state()[0] - whole * resolution).abs());
        }
        let residual = ends
            .iter()
            .map(|(low, high)| high - low)
            .fold(0.0, f64::max);
        let found = &mut self.found;
        found.arrivals += 1;
        found.residual = found.residual.max(residual);
        found.ringing += usize::from(residual > RESIDUAL);
        found.error = found.error.max(error);
        found.outside += usize::from(error > self.design.motion.settling_tolerance);
        Ok(())
    }
}
