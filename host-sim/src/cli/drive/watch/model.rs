//! What `watch` shows: a plain picture of the drive, fed by records and statuses. Knows no line and no terminal.

use crate::capture::Origin;
use crate::link::{mode_name, passed};
use crate::simulate::corridor::Record;
use arso_core::Place;
use arso_core::link::message::{PastFault, Status};
use std::collections::VecDeque;

/// What the curves show, s.
pub(super) const WINDOW: f64 = 10.0;

/// A value over time, as far back as [`WINDOW`].
#[derive(Debug)]
pub(super) struct Curve {
    pub(super) name: String,
    /// Time, s, and value, SI.
    pub(super) points: VecDeque<(f64, f64)>,
}

impl Curve {
    fn new(name: impl Into<String>) -> Self {
        let (name, points) = (name.into(), VecDeque::new());
        Self { name, points }
    }

    /// Adds a value; the oldest go. What is no number leaves a gap.
    fn add(&mut self, time: f64, value: f64) {
        if value.is_finite() {
            self.points.push_back((time, value));
        }
        let old = |point: &(f64, f64)| point.0 < time - WINDOW;
        while self.points.front().is_some_and(old) {
            self.points.pop_front();
        }
    }
}

/// Which drive is shown, and how it is looked at.
#[derive(Clone, Debug)]
pub(super) struct Subject {
    /// Where it is.
    pub(super) port: String,
    pub(super) firmware: String,
    pub(super) origin: Origin,
    /// Distance per count, m.
    pub(super) resolution: f64,
    /// A record of every so manieth control period comes.
    pub(super) every: u16,
}

/// What is known of the drive.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) subject: Subject,
    pub(super) status: Option<Status>,
    pub(super) record: Option<Record>,
    /// What the current may be, A, where the drive says it.
    pub(super) current_limit: Option<f64>,
    /// Largest current so far, A.
    pub(super) largest_current: f64,
    /// The last faults, the oldest first.
    pub(super) faults: Vec<PastFault>,
    /// Time of the last record from the first one on, s.
    pub(super) time: f64,
    /// Of the reference, of the actuator, and of each load.
    pub(super) positions: Vec<Curve>,
    pub(super) current: Curve,
    /// Records that came, and that did not.
    pub(super) taken: u64,
    pub(super) missed: u64,
    /// For how long the drive has not answered, s.
    pub(super) silent: Option<f64>,
    /// What became of the last key.
    pub(super) said: String,
}

/// A mass, where it is, and where it is to be, m.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mass {
    pub(super) name: String,
    /// Nothing while it is not known.
    pub(super) position: Option<f64>,
    pub(super) deviation: Option<f64>,
    /// m/s.
    pub(super) velocity: Option<f64>,
}

impl Model {
    pub(super) fn new(subject: Subject) -> Self {
        let loads = 1..=subject.origin.loads;
        let masses = ["reference".to_owned(), "actuator".to_owned()];
        let masses = masses
            .into_iter()
            .chain(loads.map(|load| format!("load {load}")));
        Self {
            positions: masses.map(Curve::new).collect(),
            current: Curve::new("current"),
            subject,
            status: None,
            record: None,
            current_limit: None,
            largest_current: 0.0,
            faults: Vec::new(),
            time: 0.0,
            taken: 0,
            missed: 0,
            silent: None,
            said: String::new(),
        }
    }

    /// Takes a record. Its time from the first one on, s; nothing for one that comes twice.
    pub(super) fn take(&mut self, record: &Record) -> Option<f64> {
        if let Some(last) = &self.record {
            let every = u32::from(self.subject.every);
            // The time of a drive that was reset goes on.
            let gap = passed(last.period, record.period).unwrap_or(every);
            if gap == 0 {
                return None;
            }
            self.missed += u64::from(gap / every).saturating_sub(1);
            self.time += f64::from(gap) * self.subject.origin.period;
        }
        self.taken += 1;
        self.draw_on(record);
        self.record = Some(record.clone());
        Some(self.time)
    }

    /// Goes on with the curves; what is estimated and followed is known while the loop is closed.
    fn draw_on(&mut self, record: &Record) {
        let (time, closed) = (self.time, record.mode.closed_loop());
        let known = |value: f32| if closed { value.into() } else { f64::NAN };
        let loads = record.load_position.iter().map(|load| known(*load));
        let values = [known(record.reference), record.position.into()];
        for (curve, value) in self
            .positions
            .iter_mut()
            .zip(values.into_iter().chain(loads))
        {
            curve.add(time, value);
        }
        self.current.add(time, record.command.into());
        self.seen(record.command);
    }

    /// Remembers the largest current.
    fn seen(&mut self, current: f32) {
        let current = f64::from(current.abs());
        if current.is_finite() {
            self.largest_current = self.largest_current.max(current);
        }
    }

    /// Takes a status.
    pub(super) fn report(&mut self, status: Status) {
        self.seen(status.command);
        self.status = Some(status);
        let limit = f64::from(status.current_limit);
        let possible = limit.is_finite() && limit > 0.0;
        self.current_limit = possible.then_some(limit);
        self.silent = None;
    }

    /// What the current is measured against, A.
    pub(super) fn full_current(&self) -> f64 {
        self.current_limit.unwrap_or(self.largest_current)
    }

    /// Commanded current, A: of the last record, or of the last status before the first record.
    pub(super) fn command(&self) -> Option<f64> {
        let record = self.record.as_ref().map(|record| record.command);
        let status = || self.status.map(|status| status.command);
        record.or_else(status).map(f64::from)
    }

    /// Where the machine is held, m.
    pub(super) fn target(&self) -> Option<f64> {
        let held = self.status?.held;
        held.map(|Place(counts)| counts as f64 * self.subject.resolution)
    }

    /// Reference, m, while one is followed.
    pub(super) fn reference(&self) -> Option<f64> {
        let record = self.record.as_ref()?;
        let closed = record.mode.closed_loop();
        closed.then_some(record.reference.into())
    }

    /// Actuator and loads, the nearest to the actuator first.
    pub(super) fn masses(&self) -> Vec<Mass> {
        let reference = self.reference();
        let mass = |name: &str, position: Option<f64>, velocity: Option<f32>| Mass {
            name: name.to_owned(),
            position,
            deviation: position.zip(reference).map(|(at, to)| at - to),
            velocity: velocity.map(f64::from),
        };
        let record = self.record.as_ref();
        let closed = record.filter(|record| record.mode.closed_loop());
        let names = self.positions.iter().skip(1).enumerate();
        let masses = names.map(|(number, curve)| match number.checked_sub(1) {
            None => {
                let position = record.map(|record| record.position.into());
                let velocity = closed.map(|record| record.velocity);
                mass(&curve.name, position, velocity)
            }
            Some(load) => {
                let of = |values: &Vec<f32>| values.get(load).copied();
                let position = closed.and_then(|record| of(&record.load_position));
                let velocity = closed.and_then(|record| of(&record.load_velocity));
                mass(&curve.name, position.map(f64::from), velocity)
            }
        });
        masses.collect()
    }

    /// What the drive does, in a word.
    pub(super) fn mode(&self) -> &'static str {
        self.status
            .map_or("unknown", |status| mode_name(status.mode))
    }

    /// Whether a fault stops or has stopped the drive.
    pub(super) fn faulty(&self) -> bool {
        self.status
            .is_some_and(|status| status.mode.fault().is_some())
    }

    /// How long ago a fault came, s.
    pub(super) fn age(&self, fault: &PastFault) -> f64 {
        let now = self.status.map_or(fault.period, |status| status.period);
        f64::from(now.wrapping_sub(fault.period)) * self.subject.origin.period
    }
}
