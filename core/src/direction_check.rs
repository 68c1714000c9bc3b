//! Direction check: a small motion that proves the signs before the loop is ever closed.
//!
//! With swapped encoder phases or motor leads the feedback drives the load away from its target
//! instead of towards it. So no loop is closed until the drive has seen that a positive current
//! moves the encoder forward:
//!
//! ```text
//! Rest    amplifier off, until the encoder has stood still
//! Ramp    current rises from zero until the encoder has moved: forward, or the drive stops
//! Brake   the loop is closed around actuator and encoder alone, as if the load were rigid, which
//!         no observer can upset, until the actuator stands
//! ```
//!
//! At most `COUNTS` counts are travelled with an unproven sign.

use crate::fault::Fault;
use crate::limits::Limits;
use crate::rest::{self, Rest};
use crate::units::{Current, Position};

/// Counts that prove a direction.
const COUNTS: f32 = 50.0;
/// Counts by which the actuator is seen to move at all.
const SEEN_COUNTS: f32 = 3.0;
/// How long to wait for that, before and after the ramp, s.
pub(crate) const PATIENCE: f32 = 2.0;
/// How long the current rises, s, and to which share of its limit.
const RAMP_TIME: f32 = 0.5;
const RAMP_SHARE: f32 = 0.5;

/// What is to be done in this period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Amplifier off.
    Wait,
    /// Open loop: this current.
    Push(Current),
    /// Close the loop around the actuator alone, towards this position.
    Brake(Position),
    /// All proven, the actuator stands.
    Done,
}

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionCheck {
    sample_time: f32,
    resolution: f32,
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
    Brake,
}

/// How far it has come.
#[derive(Clone, Copy, Debug, Default)]
pub struct Memory {
    phase: Phase,
    /// Periods in this phase.
    periods: u32,
    rest: rest::Memory,
    /// Where the actuator was when the current began to rise.
    origin: Option<f32>,
    /// Current at which it was first seen to move.
    breakaway: Option<f32>,
}

impl DirectionCheck {
    /// * `resolution`: m per count
    /// * `force_constant`: N/A; `actuator_mass`: kg
    /// * `sample_time`: s
    #[must_use]
    pub fn new(
        limits: &Limits,
        resolution: f32,
        (force_constant, actuator_mass): (f32, f32),
        sample_time: f32,
    ) -> Self {
        Self {
            sample_time,
            resolution,
            largest_current: RAMP_SHARE * limits.current_limit,
            rest: Rest::new(resolution, sample_time),
            force_constant,
            actuator_mass,
        }
    }

    /// Force by which friction held the actuator still, as far as the ramp has shown it, N: the motor's force
    /// when it was first seen to move, less what a machine without friction has when it is.
    ///
    /// A force that rises at `F'` moves the actuator by `F' t³ / 6 m`, before its springs know of it.
    #[must_use]
    pub fn stiction(&self, memory: &Memory) -> Option<f32> {
        let rate = self.force_constant * self.largest_current / RAMP_TIME;
        let time = libm::powf(
            6.0 * self.actuator_mass * SEEN_COUNTS * self.resolution / rate,
            1.0 / 3.0,
        );
        let breakaway = self.force_constant * memory.breakaway?;
        // One period, because it is seen in whole ones.
        Some((breakaway - rate * (time + self.sample_time)).max(0.0))
    }

    /// What proves that the encoder moves, m.
    #[must_use]
    pub fn least_motion(&self) -> f32 {
        COUNTS * self.resolution
    }

    /// One period at a measured position.
    ///
    /// # Errors
    /// The fault that stops the drive: no rest, no motion, or motion in the wrong direction.
    pub fn step(&self, memory: &mut Memory, position: Position) -> Result<Action, Fault> {
        let origin = *memory.origin.get_or_insert(position.0);
        let moved = (position.0 - origin) / self.resolution;
        let time = memory.periods as f32 * self.sample_time;
        memory.periods = memory.periods.saturating_add(1);
        let rested = if memory.phase == Phase::Rest {
            self.rest.step(&mut memory.rest, position)
        } else {
            self.rest.within(&mut memory.rest, position, COUNTS)
        };
        let breakaway = memory.breakaway;
        let next = |phase, origin| Memory {
            phase,
            origin: Some(origin),
            rest: rest::Memory::at(position),
            breakaway,
            ..Memory::default()
        };

        let rising = self.largest_current * time / RAMP_TIME;
        if memory.phase == Phase::Ramp && memory.breakaway.is_none() && moved.abs() >= SEEN_COUNTS {
            memory.breakaway = Some(rising);
        }
        match memory.phase {
            Phase::Rest if rested => {
                *memory = next(Phase::Ramp, position.0);
                Ok(Action::Push(Current(0.0)))
            }
            Phase::Rest => {
                if time > PATIENCE {
                    Err(Fault::NotAtRest)
                } else {
                    Ok(Action::Wait)
                }
            }
            Phase::Ramp if moved >= COUNTS => {
                *memory = next(Phase::Brake, origin);
                Ok(Action::Brake(Position(origin)))
            }
            Phase::Ramp if moved <= -COUNTS => Err(Fault::Direction),
            Phase::Ramp if time > RAMP_TIME => Err(Fault::NoMotion),
            Phase::Ramp => Ok(Action::Push(Current(rising))),
            Phase::Brake if rested => Ok(Action::Done),
            Phase::Brake if time > PATIENCE => Err(Fault::NotAtRest),
            Phase::Brake => Ok(Action::Brake(Position(origin))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: f32 = 1e-3;
    const RESOLUTION: f32 = 1e-6;

    fn check() -> DirectionCheck {
        let limits = Limits {
            current_limit: 2.0,
            current_resolution: 1e-3,
        };
        DirectionCheck::new(&limits, RESOLUTION, (6.0, 0.1), T)
    }

    /// A rigid actuator of 0.1 kg and `gain` N/A under the pushed current; brought back by hand.
    fn run(gain: f32) -> (Result<Action, Fault>, f32) {
        let (mut memory, check) = (Memory::default(), check());
        let (mut position, mut velocity, mut farthest) = (0.3_f32, 0.0_f32, 0.0_f32);
        for _ in 0..10_000 {
            match check.step(&mut memory, Position(position)) {
                Ok(Action::Push(current)) => velocity += gain * current.0 / 0.1 * T,
                Ok(Action::Brake(origin)) => {
                    assert!((origin.0 - 0.3).abs() < 1e-6);
                    velocity = 0.0;
                    position += (origin.0 - position) * 0.05;
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
            let (mut memory, check) = (Memory::default(), check());
            let (mut position, mut velocity) = (0.3_f32, 0.0_f32);
            let found = loop {
                match check.step(&mut memory, Position(position)) {
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
        assert!(farthest < 2.0 * COUNTS * RESOLUTION, "{farthest}");
    }

    #[test]
    fn no_motion_is_found() {
        assert_eq!(run(0.0), (Err(Fault::NoMotion), 0.0));
    }

    #[test]
    fn a_moving_machine_is_not_pushed() {
        let (mut memory, check) = (Memory::default(), check());
        let mut k = 0;
        let end = loop {
            let position = Position(k as f32 * 3.0 * RESOLUTION);
            k += 1;
            match check.step(&mut memory, position) {
                Ok(action) => assert_eq!(action, Action::Wait),
                Err(fault) => break fault,
            }
        };
        assert_eq!(end, Fault::NotAtRest);
    }
}
