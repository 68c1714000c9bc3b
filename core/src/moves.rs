//! Moves: where the chain ought to be in each period, and the current that takes it there.
//!
//! A move is a sum of [`plans`] under way, each leaving every spring at rest: a new target, a jog and a stop
//! add plans to those that are being played, whatever these do just then, and the sum leaves none of the
//! masses in vibration.
//!
//! ```text
//! distance --Moves::go---> segments (plan, scale, tick) --Moves::step--> i_ff + K x_ref, x_a, v_a
//! velocity --Moves::jog-->
//! ```
//!
//! Positions are relative to the target, a whole count. A plan that has ended contributes exactly zero, so
//! nothing drifts; while the drive jogs it is the target that moves, by whole counts and 256ths of one.
//!
//! **Which plan.** The shortest one that keeps the limits: of the displacements the first that reaches that
//! far, beyond them a change of velocity and the opposite one. Each segment uses a share of the limits, its
//! scale over the plan's reach, and the shares of those under way are at most one: a request on top of them
//! gets the shortest plan that fits into what they leave, or waits for their end if that is sooner.
//!
//! **A cruise can be changed.** The second change of velocity is moved in time, whole periods and, as two
//! segments that share it, a part of one: it ends on any place that is not behind.

pub mod plans;
mod requests;

pub use requests::Unreachable;

use crate::units::{Current, Position, whole};
use heapless::Vec;
use plans::{Plan, Plans};

/// Where every mass ought to be in one period, and the current that takes it there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference<const N: usize> {
    /// Position of the actuator, relative to the target.
    pub position: Position,
    /// Position of each load relative to the actuator, m.
    pub deflection: [f32; N],
    /// Distance that the actuator ought to have come since the period before, m.
    pub displacement: f32,
    /// Mean velocity of each load since then, m/s.
    pub load_velocity: [f32; N],
    /// Feed-forward current `i_ff`.
    pub feed_forward: Current,
    /// Whether all rest at the target, and have.
    pub rests: bool,
}

/// At rest at the target.
impl<const N: usize> Default for Reference<N> {
    fn default() -> Self {
        Self {
            position: Position(0.0),
            deflection: [0.0; N],
            displacement: 0.0,
            load_velocity: [0.0; N],
            feed_forward: Current(0.0),
            rests: true,
        }
    }
}

/// Most segments that are under way at once: two moves and the parts of a changed cruise.
const SEGMENTS: usize = 6;

/// Parts of a count that the target of a jog is kept in.
const PARTS: i64 = 256;
/// The moves of a drive.
#[derive(Clone, Copy, Debug)]
pub struct Moves<'p> {
    plans: Plans<'p>,
    sample_time: f32,
    /// Of the control periods, 1/s.
    frequency: f32,
    /// m per count.
    resolution: f32,
}

/// A plan under way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Segment {
    what: What,
    /// m or m/s.
    scale: f32,
    /// Periods since it began; negative while it waits.
    tick: i32,
}

/// Which plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// A displacement, by its number.
    Displacement(u16),
    Change,
}

/// What is under way; the default rests at the target.
#[derive(Clone, Debug)]
pub struct Memory<const N: usize> {
    segments: Vec<Segment, SEGMENTS>,
    /// How the target moves: 256ths of a count per period, and how far it is beyond the whole count.
    pace: i64,
    beyond: i64,
    /// The reference of the period before, relative to the present target: position of the actuator and
    /// deflections, m.
    before: (f32, [f32; N]),
}

impl<const N: usize> Default for Memory<N> {
    fn default() -> Self {
        Self {
            segments: Vec::new(),
            pace: 0,
            beyond: 0,
            before: (0.0, [0.0; N]),
        }
    }
}

impl<const N: usize> Memory<N> {
    /// Whether nothing is under way.
    pub(crate) fn rests(&self) -> bool {
        self.pace == 0 && self.beyond == 0 && self.segments.is_empty()
    }

    /// Whether the target moves.
    pub(crate) fn jogs(&self) -> bool {
        self.pace != 0
    }

    fn add(&mut self, segment: Segment) {
        // Whoever adds has seen that there is room.
        let _ = self.segments.push(segment);
    }

    fn free(&self) -> usize {
        SEGMENTS - self.segments.len()
    }

    /// The change of velocity that waits: its scale and the periods until it begins.
    fn waiting(&self) -> Option<(f32, f32)> {
        let mut sum = (0.0, 0.0);
        for segment in self.segments.iter().filter(|s| s.waits()) {
            sum.0 += segment.scale;
            sum.1 += segment.scale * -(segment.tick as f32);
        }
        (sum.0 != 0.0).then(|| (sum.0, sum.1 / sum.0))
    }
}

impl Segment {
    fn waits(&self) -> bool {
        self.what == What::Change && self.tick < 0
    }
}

impl<'p> Moves<'p> {
    /// * `resolution`: of the encoder, m
    #[must_use]
    pub fn new(plans: Plans<'p>, sample_time: f32, resolution: f32) -> Self {
        Self {
            plans,
            sample_time,
            frequency: 1.0 / sample_time,
            resolution,
        }
    }

    /// For how many periods in a row the current may be at its limit before the reference waits: an eighth of a
    /// change of velocity.
    pub(crate) fn patience(&self) -> u32 {
        self.ticks(&self.plans.change).unsigned_abs() / 8
    }

    /// Whether a cruise at that velocity, m/s, is one.
    pub(crate) fn cruises(&self, velocity: f32) -> bool {
        (self.velocity(1)..=self.plans.change.reach).contains(&velocity)
    }

    /// Whether these are as in their copy.
    pub(crate) fn same(&self, copy: &Self) -> bool {
        self.plans.same(&copy.plans)
            && (self.sample_time, self.frequency, self.resolution)
                == (copy.sample_time, copy.frequency, copy.resolution)
    }

    /// The reference of this period; the next call gives that of the next.
    pub fn step<const N: usize>(&self, memory: &mut Memory<N>) -> Reference<N> {
        let (before, deflection_before) = memory.before;
        if memory.rests() && before == 0.0 && deflection_before == [0.0; N] {
            return Reference::default();
        }
        let mut sum = Reference {
            position: Position(whole(memory.beyond) * self.part()),
            rests: false,
            ..Reference::default()
        };
        memory.segments.retain_mut(|segment| {
            let plan = self.plan(segment.what);
            self.add(&mut sum, plan, segment);
            segment.tick = segment.tick.saturating_add(1);
            segment.tick <= self.ticks(plan)
        });
        sum.displacement = sum.position.0 - before;
        for (load, velocity) in sum.load_velocity.iter_mut().enumerate() {
            let deflected = sum.deflection[load] - deflection_before[load];
            *velocity = (sum.displacement + deflected) * self.frequency;
        }
        memory.before = (sum.position.0, sum.deflection);
        sum
    }

    /// By how many whole counts the target of a jog moves on to the next period.
    fn advance<const N: usize>(memory: &mut Memory<N>) -> i64 {
        if memory.pace == 0 {
            return 0;
        }
        let beyond = memory.beyond + memory.pace;
        memory.beyond = beyond & (PARTS - 1);
        beyond >> PARTS.trailing_zeros()
    }

    /// The smallest part of a count, m.
    fn part(&self) -> f32 {
        self.resolution / PARTS as f32
    }

    /// Parts of a count per period as m/s.
    fn velocity(&self, pace: i64) -> f32 {
        whole(pace) * self.part() / self.sample_time
    }

    fn plan(&self, what: What) -> &Plan {
        match what {
            What::Displacement(number) => {
                let plan = self.plans.displacements.get(usize::from(number));
                plan.unwrap_or(&self.plans.change)
            }
            What::Change => &self.plans.change,
        }
    }

    fn ticks(&self, plan: &Plan) -> i32 {
        i32::from(plan.knots) * i32::from(self.plans.stride)
    }

    fn add<const N: usize>(&self, sum: &mut Reference<N>, plan: &Plan, segment: &Segment) {
        let scale = segment.scale;
        let Ok(tick) = u32::try_from(segment.tick) else {
            // On the line on which it will end.
            let periods = self.ahead() - segment.tick as f32;
            sum.position.0 += scale * periods * self.sample_time;
            return;
        };
        let stride = u32::from(self.plans.stride);
        let (knot, past) = (tick / stride, tick % stride);
        let Some(row) = self.row::<N>(plan, knot) else {
            return;
        };
        sum.feed_forward.0 += scale * plan.feed_forward * f32::from(row[0]);
        let (mut position, mut deflection) = Self::places::<N>(row);
        if past != 0 {
            // The current is held, the masses go on: from knot to knot as smoothly as they do. The actuator's
            // acceleration leaps with the current, so at a knot its velocity is not the mean one around it.
            let at = |knot: u32| {
                self.row::<N>(plan, knot)
                    .map_or((0.0, [0.0; N]), Self::places)
            };
            let (next, after) = (at(knot + 1), at(knot + 2));
            let share = past as f32 / stride as f32;
            // A plan begins at rest, which a change of velocity sees from the line on which it will end.
            let first = knot == 0;
            let line = if first && segment.what == What::Change {
                -(stride as f32) * self.sample_time / plan.position
            } else {
                0.0
            };
            let before = if first { next } else { at(knot - 1) };
            let last = knot + 1 >= plan.knots.into();
            let current = |knot: u32| {
                let row = self.row::<N>(plan, knot);
                row.map_or(0.0, |row| f32::from(row[0]))
            };
            let bend = self.plans.bend * plan.feed_forward;
            let bends = if first {
                (0.0, bend * (current(1) - f32::from(row[0])))
            } else {
                let here = f32::from(row[0]);
                let before = current(knot - 1);
                (bend * (here - before), bend * (current(knot + 1) - here))
            };
            let between = |here: f32, before: f32, next: f32, after: f32, line: f32, unit: f32| {
                let slope = if first {
                    line
                } else {
                    0.5 * (next - before) - bends.0 / unit
                };
                let next_slope = if last {
                    0.0
                } else {
                    0.5 * (after - here) - bends.1 / unit
                };
                let gap = next - here;
                let (square, cube) = (
                    3.0 * gap - 2.0 * slope - next_slope,
                    slope + next_slope - 2.0 * gap,
                );
                here + share * (slope + share * (square + share * cube))
            };
            position = between(position, before.0, next.0, after.0, line, plan.position);
            for (load, place) in deflection.iter_mut().enumerate() {
                let [before, next, after] = [before, next, after].map(|places| places.1[load]);
                *place = between(*place, before, next, after, 0.0, -plan.deflection);
            }
        }
        sum.position.0 += scale * plan.position * position;
        for (sum, deflection) in sum.deflection.iter_mut().zip(deflection) {
            *sum += scale * plan.deflection * deflection;
        }
    }

    /// The words of a row; none after the last.
    fn row<const N: usize>(&self, plan: &Plan, knot: u32) -> Option<&[i16]> {
        if knot >= plan.knots.into() {
            return None;
        }
        let words = plans::row_words(N);
        let first = (plan.first as usize)
            .checked_add(knot as usize)?
            .checked_mul(words)?;
        self.plans.rows.get(first..first.checked_add(words)?)
    }

    /// Position of the actuator and deflections, in their units.
    fn places<const N: usize>(row: &[i16]) -> (f32, [f32; N]) {
        let word = |index: usize| row.get(index).copied().unwrap_or(0);
        let position = i32::from(word(1)) << 16 | i32::from(word(2) as u16);
        (
            position as f32,
            core::array::from_fn(|load| f32::from(word(3 + load))),
        )
    }
}

#[cfg(test)]
pub(crate) mod tests;
