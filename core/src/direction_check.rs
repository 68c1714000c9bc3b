//! Direction check: a small motion that proves the signs before the loop is ever closed.
//!
//! With swapped encoder phases or motor leads the feedback drives the load away from its target
//! instead of towards it. So no loop is closed until the drive has seen that a change of the current turns
//! the encoder's motion round. That the encoder moves while current flows proves nothing: an offset of the
//! amplifier or a weight moves it as well.
//!
//! ```text
//! Rest    amplifier off, until the encoder has stood still
//! Ramp    current rises from zero until the encoder has moved, whichever way
//! Return  current changes against that motion, by a fifth of its limit at once and then at the rate of the
//!         ramp, until the encoder comes back: the signs are proven; or runs on: the drive stops
//! Brake   the loop is closed around actuator and encoder alone, as if the load were rigid, which
//!         no observer can upset, until the actuator stands
//! ```
//!
//! At most `FARTHEST` grains (see [`rest`](crate::rest)), and what one period adds, are travelled with an
//! unproven sign. What moves the machine beside the motor must be less than a tenth of its force.

use crate::actuator::Actuator;
use crate::encoder::Reading;
use crate::fault::Fault;
use crate::limits::Limits;
use crate::rest::{self, Rest, SLOW as PROOF};
use crate::units::{Current, Place};

/// Grains by which the actuator is seen to move at all.
const SEEN: f32 = 3.0;
/// Grains by which it has come back, and from which on it has not.
const BACK: f32 = 10.0;
const FARTHEST: f32 = 4.0 * PROOF;
/// How long to wait for that, before and after the ramp, s.
pub(crate) const PATIENCE: f32 = 2.0;
/// How long the current rises, s, and to which share of its limit.
const RAMP_TIME: f32 = 0.5;
const RAMP_SHARE: f32 = 0.5;
/// Periods in which the force of the ramp rises by what friction can be told from none.
const TOLD: f32 = 2.0;
/// Share of the current limit by which the current changes at once to turn the motion round.
const RETURN_SHARE: f32 = 0.2;

/// What is to be done in this period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Amplifier off.
    Wait,
    /// Open loop: this current.
    Push(Current),
    /// Close the loop around the actuator alone, towards this place.
    Brake(Place),
    /// All proven, the actuator stands.
    Done,
}

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionCheck {
    sample_time: f32,
    largest_current: f32,
    rest: Rest,
    /// N/A, kg
    force_constant: f32,
    actuator_mass: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Phase {
    #[default]
    Rest,
    Ramp,
    Return(Turn),
    Brake,
}

/// Where and from what the motion is turned round.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turn {
    /// 1 for a motion forward, -1 for one backward.
    direction: f32,
    /// A.
    current: f32,
    /// How far the motion has come, grains.
    farthest: f32,
}

/// How far it has come.
#[derive(Clone, Copy, Debug, Default)]
pub struct Memory {
    phase: Phase,
    /// Periods in this phase.
    periods: u32,
    rest: rest::Memory,
    /// What cannot be the encoder's noise, grains.
    noise: f32,
    /// Where the actuator was when the current began to rise.
    origin: Option<Place>,
    /// Current at which it was first seen to move, and by how many grains it had.
    breakaway: Option<(f32, f32)>,
}

impl DirectionCheck {
    /// * `sample_time`: s
    #[must_use]
    pub(crate) fn new(limits: &Limits, actuator: &Actuator, rest: Rest, sample_time: f32) -> Self {
        Self {
            sample_time,
            largest_current: RAMP_SHARE * limits.current_limit,
            rest,
            force_constant: actuator.actual_force_constant(),
            actuator_mass: actuator.actual_mass(),
        }
    }

    /// Force by which friction held the actuator still, as far as the ramp has shown it, N: the motor's force
    /// when it was first seen to move, less what a machine without friction has when it is.
    ///
    /// A force that rises at `F'` moves the actuator by `F' t³ / 6 m`, before its springs know of it. What the force
    /// rises by in two periods cannot be told from none.
    #[must_use]
    pub fn stiction(&self, memory: &Memory) -> Option<f32> {
        let rate = self.force_constant * self.largest_current / RAMP_TIME;
        let (current, grains) = memory.breakaway?;
        let moved = self.rest.metres(grains);
        let time = libm::powf(6.0 * self.actuator_mass * moved / rate, 1.0 / 3.0);
        let breakaway = self.force_constant * current;
        // One period, because it is seen in whole ones.
        let seen = breakaway - rate * (time + self.sample_time);
        Some(if seen > TOLD * rate * self.sample_time {
            seen
        } else {
            0.0
        })
    }

    /// What proves that the encoder moves, m.
    #[must_use]
    pub fn least_motion(&self) -> f32 {
        self.rest.metres(PROOF)
    }

    /// Current that turns a motion round, some time after that began, s.
    fn turning(&self, turn: &Turn, time: f32) -> Current {
        let change = RETURN_SHARE / RAMP_SHARE + time / RAMP_TIME;
        let current = turn.current - turn.direction * self.largest_current * change;
        Current(current.max(-self.largest_current).min(self.largest_current))
    }

    /// One period.
    ///
    /// # Errors
    /// The fault that stops the drive: no rest, no motion, or motion in the wrong direction.
    pub fn step(&self, memory: &mut Memory, reading: &Reading) -> Result<Action, Fault> {
        let origin = *memory.origin.get_or_insert(reading.place);
        let moved = self.rest.grains(origin, reading.place);
        let time = memory.periods as f32 * self.sample_time;
        memory.periods = memory.periods.saturating_add(1);
        let rested = if memory.phase == Phase::Rest {
            self.rest.step(&mut memory.rest, reading)
        } else {
            self.rest.within(&mut memory.rest, reading, PROOF)
        };
        let rising = self.largest_current * time / RAMP_TIME;
        if memory.phase == Phase::Ramp && memory.breakaway.is_none() {
            let seen = SEEN.max(memory.noise);
            memory.breakaway = (moved.abs() >= seen).then_some((rising, seen));
        }
        let before = *memory;
        let next = |phase, origin| Memory {
            phase,
            periods: 0,
            origin: Some(origin),
            rest: before.rest.moved_to(reading.place),
            ..before
        };
        match memory.phase {
            Phase::Rest if rested => {
                *memory = Memory {
                    noise: before.rest.beyond_noise(),
                    ..next(Phase::Ramp, reading.place)
                };
                Ok(Action::Push(Current(0.0)))
            }
            Phase::Rest => {
                if time > PATIENCE {
                    Err(Fault::NotAtRest)
                } else {
                    Ok(Action::Wait)
                }
            }
            Phase::Ramp if moved.abs() >= PROOF => {
                let turn = Turn {
                    direction: if moved > 0.0 { 1.0 } else { -1.0 },
                    current: rising,
                    farthest: moved.abs(),
                };
                *memory = next(Phase::Return(turn), origin);
                Ok(Action::Push(self.turning(&turn, 0.0)))
            }
            Phase::Ramp if time > RAMP_TIME => Err(Fault::NoMotion),
            Phase::Ramp => Ok(Action::Push(Current(rising))),
            Phase::Return(ref mut turn) => {
                let out = turn.direction * moved;
                turn.farthest = turn.farthest.max(out);
                if turn.farthest - out >= BACK.max(memory.noise) {
                    *memory = next(Phase::Brake, origin);
                    Ok(Action::Brake(origin))
                } else if out >= FARTHEST {
                    Err(Fault::Direction)
                } else if time > 2.0 * RAMP_TIME {
                    Err(Fault::NoMotion)
                } else {
                    Ok(Action::Push(self.turning(turn, time)))
                }
            }
            Phase::Brake if rested => Ok(Action::Done),
            Phase::Brake if time > PATIENCE => Err(Fault::NotAtRest),
            Phase::Brake => Ok(Action::Brake(origin)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::{self, Encoder};
    use crate::units::Counts;

    const T: f32 = 1e-3;
    const RESOLUTION: f32 = 1e-6;
    const ENCODER: Encoder = Encoder {
        resolution: RESOLUTION,
        counter_bits: 32,
    };

    fn check() -> DirectionCheck {
        let limits = Limits {
            current_limit: 2.0,
            current_resolution: 1e-3,
        };
        let actuator = Actuator {
            mass: 0.1,
            force_constant: 6.0,
            mass_deviation: 0.0,
            force_constant_deviation: 0.0,
        };
        let rest = Rest::new(&ENCODER, &actuator, &limits, T);
        DirectionCheck::new(&limits, &actuator, rest, T)
    }

    /// What an encoder reads at a position.
    fn read(memory: &mut encoder::Memory, position: f32) -> Reading {
        ENCODER.step(
            memory,
            Counts(libm::roundf(position / RESOLUTION) as i32 as u32),
        )
    }

    /// A rigid actuator of 0.1 kg and `gain` N/A under the pushed current; brought back by hand.
    fn run(gain: f32) -> (Result<Action, Fault>, f32) {
        let (mut memory, mut encoder, check) =
            (Memory::default(), encoder::Memory::default(), check());
        let (mut position, mut velocity, mut farthest) = (0.3_f32, 0.0_f32, 0.0_f32);
        for _ in 0..10_000 {
            match check.step(&mut memory, &read(&mut encoder, position)) {
                Ok(Action::Push(current)) => velocity += gain * current.0 / 0.1 * T,
                Ok(Action::Brake(origin)) => {
                    assert_eq!(origin, Place(300_000));
                    velocity = 0.0;
                    position += (0.3 - position) * 0.05;
                }
                Ok(Action::Wait) => {}
                end => return (end, farthest),
            }
            position += velocity * T;
            farthest = farthest.max((position - 0.3).abs());
        }
        panic!("no end");
    }

    #[test]
    fn the_right_sign_is_proven() {
        assert_eq!(run(6.0).0, Ok(Action::Done));
    }

    /// A machine that friction holds: the force at which it breaks away, to what one period of the ramp
    /// makes.
    #[test]
    fn the_breakaway_force_is_measured() {
        for friction in [0.0, 0.05, 0.2, 1.0] {
            let (mut memory, mut encoder, check) =
                (Memory::default(), encoder::Memory::default(), check());
            let (mut position, mut velocity) = (0.3_f32, 0.0_f32);
            let found = loop {
                match check.step(&mut memory, &read(&mut encoder, position)) {
                    Ok(Action::Push(current)) => {
                        let force = 6.0 * current.0;
                        let sliding = velocity > 0.0 || force > friction;
                        velocity += if sliding {
                            (force - friction) / 0.1 * T
                        } else {
                            0.0
                        };
                    }
                    Ok(Action::Brake(_)) => break check.stiction(&memory).unwrap(),
                    Ok(_) => {}
                    Err(fault) => panic!("{fault:?}"),
                }
                position += velocity * T;
            };
            let one_period = 6.0 * 2.0 * T;
            assert!(
                (found - friction).abs() < 2.0 * one_period,
                "{friction}: {found}"
            );
        }
    }

    #[test]
    fn the_wrong_sign_stops_within_a_few_counts() {
        let (end, farthest) = run(-6.0);
        assert_eq!(end, Err(Fault::Direction));
        assert!(farthest < 1.5 * FARTHEST * RESOLUTION, "{farthest}");
    }

    /// The same where a constant force moves the machine either way: it neither hides a wrong sign nor makes
    /// a right one look wrong.
    #[test]
    fn a_push_from_outside_proves_nothing() {
        for push in [-1.0, -0.3, -0.05, 0.05, 0.3, 1.0] {
            for gain in [6.0_f32, -6.0] {
                let (mut memory, mut encoder, check) =
                    (Memory::default(), encoder::Memory::default(), check());
                let (mut position, mut velocity) = (0.3_f32, 0.0_f32);
                let end = loop {
                    match check.step(&mut memory, &read(&mut encoder, position)) {
                        Ok(Action::Push(current)) => {
                            velocity += (gain * current.0 + push) / 0.1 * T;
                        }
                        Ok(Action::Wait) => {}
                        end => break end,
                    }
                    position += velocity * T;
                };
                let expected = if gain > 0.0 {
                    Ok(Action::Brake(Place(300_000)))
                } else {
                    Err(Fault::Direction)
                };
                assert_eq!(end, expected, "{push} N, {gain} N/A");
                assert!((position - 0.3).abs() < 3.0 * FARTHEST * RESOLUTION);
            }
        }
    }

    #[test]
    fn no_motion_is_found() {
        assert_eq!(run(0.0), (Err(Fault::NoMotion), 0.0));
    }

    #[test]
    fn a_moving_machine_is_not_pushed() {
        let (mut memory, mut encoder, check) =
            (Memory::default(), encoder::Memory::default(), check());
        let mut k = 0;
        let end = loop {
            let position = k as f32 * 3.0 * RESOLUTION;
            k += 1;
            match check.step(&mut memory, &read(&mut encoder, position)) {
                Ok(action) => assert_eq!(action, Action::Wait),
                Err(fault) => break fault,
            }
        };
        assert_eq!(end, Fault::NotAtRest);
    }
}
