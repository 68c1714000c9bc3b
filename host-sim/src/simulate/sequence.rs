//! Planned moves asked for one after the other: when, where to, and what each of them came to.
//!
//! ```text
//! distances, times --MoveSequence::new--> moves --simulate_moves--> one run --MoveSequence::parts--> a run per move
//! ```
//!
//! Distances are counted from the target before. A move that is asked for while another is under way is put on
//! top of it by the core. Each is judged by itself, from where the machine is when it is asked for to where the
//! next one is, so that the same figures serve one move and many.

use super::corridor::{Found, Record};
use super::scenario::{Approach, Scenario, Start};
use super::{
    Ask, Control, ControlOutput, Core, FullState, Instant, Law, Run, Sample, Time, follow,
};
use crate::design::Design;
use crate::drive::{Drive, PlantFile};
use crate::error::{Error, Result};
use arso_core::{Fault, Place, Request};
use nalgebra::DVector;
use std::collections::VecDeque;
use std::ops::Range;

/// Time after the planned end of a move until the next one is asked for, in periods of the slowest mode.
pub const ROOM: f64 = 15.0;
/// The same in control periods, at least.
const LEAST_ROOM: f64 = 200.0;
/// Longest move, in control periods: every one of a run is kept.
const LONGEST: f64 = 1e6;
/// A distance is whole when it is so near to a whole number of counts.
const WHOLE: f64 = 1e-6;

/// One planned move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// From the target before, m.
    pub distance: f64,
    /// Where to, m.
    pub target: f64,
    /// In which control period it is asked for.
    pub at: usize,
    /// How long its plan takes from rest, control periods.
    pub planned: usize,
    /// Whether the next one is asked for before its end.
    pub retargeted: bool,
    place: Place,
}

/// Planned moves asked for one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct MoveSequence {
    moves: Vec<Move>,
    /// Control periods left to the last one after its plan.
    room: usize,
    /// s.
    period: f64,
}

impl MoveSequence {
    /// Plans the moves.
    ///
    /// * `distances`: m, each rounded to whole counts
    /// * `times`: when each is asked for, s; none: the first at 0, each further one [`ROOM`] after the end of the
    ///   one before
    ///
    /// # Errors
    /// [`Error::Parameter`] for a distance of less than half a count, one that leads out of the travel or takes
    /// too long, and for times that are too few, too many or not in order; [`Error::Design`] without plans.
    pub fn new(design: &Design, distances: &[f64], times: &[f64]) -> Result<Self> {
        let drive = &design.drive;
        let (resolution, period) = (drive.encoder.resolution, drive.control.sample_time);
        if !times.is_empty() && times.len() != distances.len() {
            return Err(Error::Parameter {
                parameter: "at",
                values: times.iter().map(f64::to_string).collect(),
                rule: format!(
                    "must be one time for each of the {} moves, or none",
                    distances.len()
                ),
            });
        }
        let plans = design.plans()?;
        let slowest = design
            .modes()
            .first()
            .map_or(0.0, |mode| 1.0 / mode.frequency_hz);
        let room = (ROOM * slowest / period).max(LEAST_ROOM).ceil() as usize;
        let mut moves: Vec<Move> = Vec::with_capacity(distances.len());
        for (number, &distance) in distances.iter().enumerate() {
            let before = moves.last().copied();
            let counts = (distance / resolution).round();
            let planned = plans.duration(counts * resolution, period);
            require_possible(design, distance, planned)?;
            let place = Place(before.map_or(0, |before| before.place.0) + counts as i64);
            require_within_travel("move", design, distance, place)?;
            let at = match times.get(number) {
                None => before.map_or(0, |before| before.at + before.planned + room),
                Some(time) => asked_at(*time, period, before)?,
            };
            if let Some(before) = moves.last_mut() {
                before.retargeted = at < before.at + before.planned;
            }
            moves.push(Move {
                distance: counts * resolution,
                target: place.0 as f64 * resolution,
                at,
                planned: planned as usize,
                retargeted: false,
                place,
            });
        }
        Ok(Self {
            moves,
            room,
            period,
        })
    }

    /// The moves, in order.
    #[must_use]
    pub fn moves(&self) -> &[Move] {
        &self.moves
    }

    /// When a move is asked for, s.
    #[must_use]
    pub fn time(&self, one: &Move) -> f64 {
        one.at as f64 * self.period
    }

    /// Time until the last one has ended, with as much room after it as between them, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        let end = |last: &Move| last.at + last.planned + self.room;
        self.moves.last().map_or(0, end) as f64 * self.period
    }

    /// The part of a run of so many samples that belongs to each move.
    pub(super) fn windows(&self, samples: usize) -> Vec<Window> {
        let ends = self.moves.iter().skip(1).map(|next| next.at);
        let ends = ends.chain([samples]);
        let parts = self.moves.iter().zip(ends).map(|(one, end)| {
            let end = end.min(samples);
            Window {
                samples: one.at.min(end)..end,
                at: one.at,
                target: one.target,
                last: end == samples,
            }
        });
        parts.collect()
    }

    /// The part of a run that belongs to each move, its time counted from when that is asked for.
    pub(super) fn parts(&self, run: &Run) -> Vec<Run> {
        let windows = self.windows(run.samples.len()).into_iter();
        let parts = windows.map(|part| {
            let samples = run.samples[part.samples.clone()].iter().enumerate();
            let samples = samples.map(|(k, sample)| Sample {
                time: k as f64 * self.period,
                ..sample.clone()
            });
            Run {
                scenario: Scenario {
                    target: part.target,
                    ..run.scenario
                },
                samples: samples.collect(),
                fault: part.fault(run.fault, self.period),
                ..*run
            }
        });
        parts.collect()
    }
}

/// The part of a run that belongs to a move.
pub(super) struct Window {
    /// Which samples, by number.
    pub(super) samples: Range<usize>,
    /// In which control period the move is asked for.
    pub(super) at: usize,
    /// Where it leads, m.
    pub(super) target: f64,
    /// Whether it ends with the run.
    last: bool,
}

impl Window {
    /// A run's fault as that of this part, its time counted from the beginning of the part, s: none that came after
    /// its end.
    pub(super) fn fault(&self, fault: Option<(f64, Fault)>, period: f64) -> Option<(f64, Fault)> {
        let fault = fault.map(|(time, fault)| (time - self.samples.start as f64 * period, fault));
        fault.filter(|(time, _)| self.last || *time < self.samples.len() as f64 * period)
    }
}

/// Refuses a distance that no drive with this encoder can move.
///
/// # Errors
/// [`Error::Parameter`] for less than half a count, and for what is no number.
pub fn require_a_count(drive: &Drive, distance: f64) -> Result<()> {
    let resolution = drive.encoder.resolution;
    // What is no number is not.
    if (distance / resolution).round().abs() >= 1.0 {
        return Ok(());
    }
    let unit = drive.kind.units().position;
    let rule = format!("must be one count of the encoder at least, {resolution:e} {unit}");
    Err(Error::parameter("move", distance, rule))
}

/// A move must be one, and of a length that can be kept.
fn require_possible(design: &Design, distance: f64, planned: f64) -> Result<()> {
    require_a_count(&design.drive, distance)?;
    if planned.is_nan() || planned > LONGEST {
        let rule = format!(
            "takes {planned:.0} control periods within the limits of planned moves: must be {LONGEST} at most"
        );
        return Err(Error::parameter("move", distance, rule));
    }
    Ok(())
}

/// Refuses a place that the drive may not go to.
///
/// * `name`: of the distance that leads there, as it is asked for
///
/// # Errors
/// [`Error::Parameter`].
pub fn require_within_travel(
    name: &'static str,
    design: &Design,
    distance: f64,
    place: Place,
) -> Result<()> {
    let resolution = design.drive.encoder.resolution;
    let Some([lowest, highest]) = design.drive.protection.travel else {
        return Ok(());
    };
    let within = (lowest / resolution).ceil() as i64..=(highest / resolution).floor() as i64;
    if within.contains(&place.0) {
        return Ok(());
    }
    let unit = design.drive.kind.units().position;
    // Without what the product adds to its decimals.
    let target = (1e9 * place.0 as f64 * resolution).round() / 1e9;
    let rule =
        format!("leads to {target} {unit}, outside the travel from {lowest} to {highest} {unit}");
    Err(Error::parameter(name, distance, rule))
}

/// The control period of a time.
fn asked_at(time: f64, period: f64, before: Option<Move>) -> Result<usize> {
    let at = (time / period).round();
    if !(0.0..=LONGEST).contains(&at) {
        let rule = format!("must be from 0 to {LONGEST} control periods of {period} s");
        return Err(Error::parameter("at", time, rule));
    }
    let at = at as usize;
    if before.is_some_and(|before| at <= before.at) {
        let rule = format!("must be a control period of {period} s later than the one before");
        return Err(Error::parameter("at", time, rule));
    }
    Ok(at)
}

/// Whether a distance is a whole number of counts, as far as its decimals can say.
#[must_use]
pub fn whole_counts(distance: f64, resolution: f64) -> bool {
    let counts = distance / resolution;
    (counts - counts.round()).abs() <= WHOLE * counts.abs().max(1.0)
}

/// Simulates planned moves.
///
/// * `duration`: s
///
/// # Errors
/// As [`simulate`](super::simulate).
pub fn simulate_moves(
    design: &Design,
    file: &PlantFile,
    sequence: &MoveSequence,
    law: Law,
    duration: f64,
) -> Result<Run> {
    let time = Time::new(sequence.period, duration);
    let mut samples = Vec::with_capacity(time.periods);
    let keep = |instant: &Instant<'_>| samples.push(instant.sample());
    let fault = follow_moves(design, file, sequence, law, time, keep)?;
    Ok(Run {
        kind: file.kind,
        scenario: Scenario {
            target: sequence.moves.last().map_or(0.0, |last| last.target),
            ..AT_THE_ORIGIN
        },
        law,
        resolution: file.encoder.resolution,
        settling_tolerance: design.motion.settling_tolerance,
        samples,
        fault,
    })
}

/// What planned moves begin with.
pub(super) const AT_THE_ORIGIN: Scenario = Scenario {
    name: "move",
    linear_title: "planned moves",
    approach: Approach::Move,
    target: 0.0,
    start: Start::Origin,
};

/// Closes the loop for planned moves, see [`follow`].
///
/// # Errors
/// As [`simulate`](super::simulate).
pub(super) fn follow_moves(
    design: &Design,
    file: &PlantFile,
    sequence: &MoveSequence,
    law: Law,
    time: Time,
    look: impl FnMut(&Instant<'_>),
) -> Result<Option<(f64, Fault)>> {
    let plant = (file, 0);
    if law == Law::Core {
        let core = Core::new(design, file, &AT_THE_ORIGIN)?;
        let mut control = InOrder::new(core, sequence);
        follow(&mut control, plant, &AT_THE_ORIGIN, time, look)
    } else {
        let full_state = FullState::new(design, &AT_THE_ORIGIN)?;
        let mut control = InOrder::new(full_state, sequence);
        follow(&mut control, plant, &AT_THE_ORIGIN, time, look)
    }
}

/// A law that is asked for one thing after the other, until it stops itself.
struct InOrder<C> {
    control: C,
    /// When, control periods, and for what.
    orders: VecDeque<(usize, Request)>,
    period: usize,
}

impl<C: Ask> InOrder<C> {
    fn new(control: C, sequence: &MoveSequence) -> Self {
        let orders = sequence.moves.iter();
        let orders = orders.map(|one| (one.at, Request::Move(one.place)));
        Self {
            control,
            orders: orders.collect(),
            period: 0,
        }
    }

    fn stopped(&self) -> bool {
        let found = self.control.found();
        found.is_some_and(|found| found.mode.fault().is_some())
    }
}

impl<C: Ask> Control for InOrder<C> {
    #[inline]
    fn step(&mut self, count: u32, truth: &DVector<f64>, applied: f64) -> Result<ControlOutput> {
        if let Some(&(at, request)) = self.orders.front()
            && at <= self.period
        {
            self.orders.pop_front();
            if !self.stopped() {
                self.control.ask(request)?;
            }
        }
        self.period += 1;
        self.control.step(count, truth, applied)
    }

    fn found(&self) -> Option<Found<'_>> {
        self.control.found()
    }

    fn record(&self) -> Option<Record> {
        self.control.record()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    /// Distances are from target to target and whole counts, and each move but the last is given the time of its
    /// plan and 15 periods of the slowest mode, 11.936 Hz.
    #[test]
    fn each_move_begins_where_the_one_before_ends() {
        let mut drive = Drive::default_drive();
        drive.protection.travel = Some([-0.015, 0.031]);
        let design = Design::new(&drive).unwrap();
        let sequence = |distances: &[f64], times: &[f64]| {
            MoveSequence::new(&design, distances, times).map(|sequence| sequence.moves)
        };
        let moves = sequence(&[0.03, -0.0400004, 0.005], &[]).unwrap();
        let places: Vec<i64> = moves.iter().map(|one| one.place.0).collect();
        assert_eq!(places, [30_000, -10_000, -5_000]);
        assert!((moves[1].target + 0.01).abs() < 1e-12);
        for pair in moves.windows(2) {
            let room = (pair[1].at - pair[0].at - pair[0].planned) as f64;
            assert!((0.0..=1.0).contains(&(room - 15e3 / 11.936)), "{room}");
            assert!(!pair[0].retargeted);
        }
        let moves = sequence(&[0.03, -0.04], &[0.1, 0.13]).unwrap();
        assert_eq!((moves[0].at, moves[1].at), (100, 130));
        assert!(moves[0].retargeted && !moves[1].retargeted);

        for (distances, times, expected) in [
            (&[0.0][..], &[][..], "`move` 0: must be one count"),
            (&[0.03, 4e-7], &[], "`move` 0.0000004: must be one count"),
            (&[f64::NAN], &[], "`move` NaN: must be one count"),
            (&[0.032], &[], "outside the travel from -0.015 to 0.031 m"),
            (&[0.02, 0.02], &[], "leads to 0.04 m, outside the travel"),
            (&[1e9], &[], "`move` 1000000000: takes"),
            (&[0.01, 0.01], &[0.1], "one time for each of the 2 moves"),
            (&[0.01, 0.01], &[0.1, 0.1], "later than the one before"),
            (&[0.01], &[-0.1], "`at` -0.1: must be from 0"),
            (&[0.01], &[f64::NAN], "`at` NaN: must be from 0"),
        ] {
            let error = sequence(distances, times).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(expected), "{error}");
        }
        assert!(whole_counts(0.03, 1e-6) && whole_counts(1e3 / 3.0, 1e3 / 3.0 / 8192.0));
        assert!(!whole_counts(0.0300004, 1e-6));
    }
}
