//! What is asked of the moves: which plans are begun, and when.

use super::{Memory, Moves, PARTS, SEGMENTS, Segment, What};
use crate::limits::clamped;
use crate::request::Request;
use crate::units::{Place, Travel, Velocity, whole};

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Answer {
    /// By how many counts the target moves on now.
    shift: i64,
    /// Whether that is all; otherwise it has to be asked again in the next period, with the distance that is
    /// then left, when what is under way leaves room.
    done: bool,
}

/// No move leads there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreachable;

/// Longest wait, in periods: up to here `f32` counts them well enough.
const LONGEST: f32 = 8_388_608.0;

impl Moves<'_> {
    /// One period, before its reference: the target of a jog moves on, and what is asked is begun as soon as
    /// the moves under way allow, when it is no longer asked. What the target is then.
    ///
    /// * `travel`: which a jog does not leave
    ///
    /// # Errors
    /// [`Unreachable`] when no move leads there.
    pub fn direct<const N: usize>(
        &self,
        memory: &mut Memory<N>,
        asked: &mut Option<Request>,
        target: Place,
        travel: Option<Travel>,
    ) -> Result<Place, Unreachable> {
        let on = |target: Place, counts| Place(target.0.wrapping_add(counts));
        let before = target;
        let mut target = target;
        if memory.pace != 0 {
            target = on(target, Self::advance(memory));
            // Where it stops when it is halted one period later.
            let pace = memory.pace / PARTS + memory.pace.signum();
            let stop = on(target, self.stop(memory).wrapping_add(pace));
            if travel.is_some_and(|travel| !travel.contains(stop)) {
                *asked = Some(Request::Halt);
            }
        }
        let answer = match *asked {
            // A step is from rest, and waits for it.
            Some(Request::Step(place)) if memory.rests() => {
                *asked = None;
                return Ok(place);
            }
            // A jog has none.
            Some(Request::Step(_)) if memory.pace != 0 => {
                let Answer { shift, .. } = self.halt(memory);
                Ok(Answer { shift, done: false })
            }
            Some(Request::Move(place)) => self.go(memory, place.counts_from(target)),
            Some(Request::Jog(velocity)) => self.jog(memory, velocity),
            Some(Request::Halt) => Ok(self.halt(memory)),
            _ => Ok(Answer {
                shift: 0,
                done: false,
            }),
        };
        let Answer { shift, done } = answer?;
        if done {
            *asked = None;
        }
        let moved = on(target, shift);
        memory.before.0 -= whole(moved.counts_from(before)) * self.resolution;
        Ok(moved)
    }

    /// Whether a move leads from one place to another, with as much to spare as it may have to wait.
    #[must_use]
    pub fn lead(&self, from: Place, to: Place) -> bool {
        let distance = whole(to.counts_from(from)) * self.resolution;
        let periods = distance.abs() / (self.plans.change.reach * self.sample_time);
        periods < LONGEST / 2.0
    }

    /// The target is to be another one, so many counts from the one before.
    fn go<const N: usize>(
        &self,
        memory: &mut Memory<N>,
        counts: i64,
    ) -> Result<Answer, Unreachable> {
        let taken = Answer {
            shift: counts,
            done: true,
        };
        let wait = Answer {
            shift: 0,
            done: false,
        };
        let distance = whole(counts) * self.resolution;
        let soonest = self.soonest(memory);
        if memory.pace != 0 {
            let beyond = whole(memory.beyond) * self.part();
            let velocity = self.velocity(memory.pace);
            let delay = (distance - beyond) / (velocity * self.sample_time) - self.ahead();
            if self.worthwhile(velocity, delay, soonest) {
                self.end_jog(memory, delay);
                return Ok(taken);
            }
        } else {
            if counts == 0 {
                return Ok(taken);
            }
            match memory.waiting() {
                None => return self.start(memory, counts),
                Some((scale, delay)) => {
                    // It cruises with the opposite of that scale.
                    let delay = delay - distance / (scale * self.sample_time);
                    if self.worthwhile(-scale, delay, soonest) {
                        Self::put_off(memory, scale, delay);
                        return Ok(taken);
                    }
                }
            }
        }
        // It lies behind: stop first.
        let Answer { shift, .. } = self.halt(memory);
        Ok(Answer { shift, ..wait })
    }

    /// Whether a cruise may go on for so many periods: it is to end neither behind nor later than a stop now and a
    /// move of its own would.
    fn worthwhile(&self, velocity: f32, delay: f32, soonest: f32) -> bool {
        let distance = velocity * self.sample_time * (delay - soonest);
        let stop = self.ticks(&self.plans.change);
        let by_itself = self.shortest(distance, 1.0).map(|(_, ticks)| ticks);
        let latest = by_itself.map_or(LONGEST, |ticks| soonest + stop.saturating_add(ticks) as f32);
        delay >= soonest && delay < LONGEST && delay <= latest
    }

    /// A move from rest by a cruise, however short: on a short way the actuator of a displacement swings far beyond
    /// both ends, and that of a change of velocity does not turn round. Where the target is then.
    pub(crate) fn retreat<const N: usize>(
        &self,
        memory: &mut Memory<N>,
        from: Place,
        to: Place,
    ) -> Result<Place, Unreachable> {
        let distance = whole(to.counts_from(from)) * self.resolution;
        let (segments, _) = self.cruise(distance, distance.abs()).ok_or(Unreachable)?;
        for segment in segments.into_iter().flatten() {
            memory.add(segment);
        }
        memory.before.0 -= distance;
        Ok(to)
    }

    /// A move on top of what is under way, none of which is a cruise.
    fn start<const N: usize>(
        &self,
        memory: &mut Memory<N>,
        counts: i64,
    ) -> Result<Answer, Unreachable> {
        let distance = whole(counts) * self.resolution;
        let (_, after_rest) = self.shortest(distance, 1.0).ok_or(Unreachable)?;
        let latest = self.remaining(memory).saturating_add(after_rest);
        match self.shortest(distance, 1.0 - self.used(memory)) {
            Some((segments, ticks)) if ticks <= latest && memory.free() >= SEGMENTS / 2 => {
                for segment in segments.into_iter().flatten() {
                    memory.add(segment);
                }
                Ok(Answer {
                    shift: counts,
                    done: true,
                })
            }
            _ => Ok(Answer {
                shift: 0,
                done: false,
            }),
        }
    }

    /// The machine is to move at a velocity from now on, as near to it as the plans reach.
    fn jog<const N: usize>(
        &self,
        memory: &mut Memory<N>,
        velocity: Velocity,
    ) -> Result<Answer, Unreachable> {
        let wait = Answer {
            shift: 0,
            done: false,
        };
        let reach = self.plans.change.reach;
        let parts = libm::roundf(clamped(velocity.0, reach) / self.velocity(1));
        if parts.is_nan() || parts.abs() >= 1e15 {
            return Err(Unreachable);
        }
        let pace = parts as i64;
        if pace == 0 {
            return Ok(self.halt(memory));
        }
        let change = self.velocity(pace.wrapping_sub(memory.pace));
        if change == 0.0 {
            return Ok(Answer { done: true, ..wait });
        }
        let room = self.used(memory) + change.abs() / reach <= 1.0;
        if memory.waiting().is_some() || memory.free() < SEGMENTS / 2 || !room {
            // The other way, or out of a move: through rest.
            let Answer { shift, .. } = self.halt(memory);
            return Ok(Answer { shift, ..wait });
        }
        // The new line is the one on which the change ends; where it passes now, in parts of counts.
        let start = -change * self.ahead() * self.sample_time;
        let parts = (libm::roundf(start / self.part()) as i64).wrapping_add(memory.beyond);
        memory.pace = pace;
        memory.beyond = parts & (PARTS - 1);
        memory.add(Segment {
            what: What::Change,
            scale: change,
            tick: 0,
        });
        Ok(Answer {
            shift: parts >> PARTS.trailing_zeros(),
            done: true,
        })
    }

    /// Everything is to come to rest as soon as the plans allow, on a whole count; a displacement under way
    /// is played to its end.
    fn halt<const N: usize>(&self, memory: &mut Memory<N>) -> Answer {
        let done = |shift| Answer { shift, done: true };
        let soonest = self.soonest(memory);
        if memory.pace != 0 {
            let shift = self.stop(memory);
            let beyond = whole(memory.beyond) * self.part();
            let velocity = self.velocity(memory.pace);
            let distance = whole(shift) * self.resolution - beyond;
            let delay = distance / (velocity * self.sample_time) - self.ahead();
            self.end_jog(memory, if delay > soonest { delay } else { soonest });
            return done(shift);
        }
        let Some((scale, delay)) = memory.waiting() else {
            return done(0);
        };
        if delay <= soonest {
            return done(0);
        }
        let per_period = scale * self.sample_time / self.resolution;
        let shift = libm::truncf((delay - soonest) * per_period);
        Self::put_off(memory, scale, delay - shift / per_period);
        done(shift as i64)
    }

    /// How far a jog that is halted now comes to rest from the target, in counts.
    fn stop<const N: usize>(&self, memory: &Memory<N>) -> i64 {
        if memory.pace == 0 {
            return 0;
        }
        let periods = self.soonest(memory) + self.ahead();
        let parts = whole(memory.pace) * periods + whole(memory.beyond);
        let counts = parts / PARTS as f32;
        (if memory.pace > 0 {
            libm::ceilf(counts)
        } else {
            libm::floorf(counts)
        }) as i64
    }

    /// Ends a jog so many periods from now.
    fn end_jog<const N: usize>(&self, memory: &mut Memory<N>, delay: f32) {
        let scale = -self.velocity(memory.pace);
        memory.pace = 0;
        memory.beyond = 0;
        Self::put_off(memory, scale, delay);
    }

    /// The change of velocity that waits, if any, is made anew, so many periods from now; two segments share
    /// it, so that parts of a period count.
    fn put_off<const N: usize>(memory: &mut Memory<N>, scale: f32, delay: f32) {
        memory.segments.retain(|segment| !segment.waits());
        let whole = libm::floorf(delay);
        let part = delay - whole;
        let tick = -(whole as i32);
        for (share, tick) in [(1.0 - part, tick), (part, tick.saturating_sub(1))] {
            if share > 0.0 {
                memory.add(Segment {
                    what: What::Change,
                    scale: scale * share,
                    tick,
                });
            }
        }
    }

    /// The shortest move over a distance that uses a share of the limits, and its periods.
    fn shortest(&self, distance: f32, share: f32) -> Option<([Option<Segment>; 2], i32)> {
        if share.is_nan() || share <= 0.0 {
            return None;
        }
        let needed = distance.abs() / share;
        let plans = self.plans.displacements;
        let number = plans.partition_point(|plan| plan.reach < needed);
        if let Some(plan) = plans.get(number) {
            let segment = Segment {
                what: What::Displacement(number as u16),
                scale: distance,
                tick: 0,
            };
            return Some(([Some(segment), None], self.ticks(plan)));
        }
        self.cruise(distance, needed)
    }

    /// A move over a distance by two changes of velocity, and its periods.
    ///
    /// * `needed`: the distance, over the share of the limits that it may use, m
    fn cruise(&self, distance: f32, needed: f32) -> Option<([Option<Segment>; 2], i32)> {
        let change = &self.plans.change;
        let least = libm::ceilf(needed / (change.reach * self.sample_time));
        if least.is_nan() || least >= LONGEST {
            return None;
        }
        // The two do not overlap.
        let periods = (least as i32).max(self.ticks(change));
        let velocity = distance / (periods as f32 * self.sample_time);
        let segment = |scale, tick| {
            Some(Segment {
                what: What::Change,
                scale,
                tick,
            })
        };
        let segments = [segment(velocity, 0), segment(-velocity, -periods)];
        Some((segments, periods.saturating_add(self.ticks(change))))
    }

    /// Share of the limits that what is under way uses; of a cruise the two ends do not overlap.
    fn used<const N: usize>(&self, memory: &Memory<N>) -> f32 {
        let reach = self.plans.change.reach;
        let cruise = self.velocity(memory.pace).abs() / reach;
        let (mut displacements, mut changes) = (0.0, [0.0, 0.0]);
        for segment in &memory.segments {
            let share = segment.scale.abs() / self.plan(segment.what).reach;
            match segment.what {
                What::Displacement(_) => displacements += share,
                What::Change => changes[usize::from(segment.tick < 0)] += share,
            }
        }
        displacements + changes[0].max(changes[1]).max(cruise)
    }

    /// Periods until all has ended.
    fn remaining<const N: usize>(&self, memory: &Memory<N>) -> i32 {
        let segments = memory.segments.iter();
        let remaining = segments.map(|s| self.ticks(self.plan(s.what)).saturating_sub(s.tick));
        remaining.max().unwrap_or(0)
    }

    /// Periods until what is being played has ended, and a change of velocity may begin.
    fn soonest<const N: usize>(&self, memory: &Memory<N>) -> f32 {
        let played = memory.segments.iter().filter(|s| s.tick >= 0);
        let remaining = played.map(|s| self.ticks(self.plan(s.what)).saturating_sub(s.tick));
        remaining.max().unwrap_or(0) as f32
    }

    /// By how many periods of its velocity a stop is ahead of where it begins.
    pub(super) fn ahead(&self) -> f32 {
        self.ticks(&self.plans.change) as f32 - self.plans.run / self.sample_time
    }
}
