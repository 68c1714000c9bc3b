//! The rule for rest: what is done against friction once the machine ought to stand, and when it ends.
//!
//! Two things go wrong at the end of a move. Friction holds the actuator while the loads still swing, so that
//! nothing damps them; and the disturbance state integrates against stiction, slips, and integrates the other
//! way, for ever. So there are three phases:
//!
//! ```text
//! reference moves --> settling --(quiet, or long enough)--> held
//!                                                           ^  |  error beyond the tolerance
//!                                                           |  v
//!                                                  pushed, follows slowly
//! ```
//!
//! * *Settling*: friction is fed forward in the direction in which the actuator would soon move without it,
//!   `v + τ dv/dt` of the frictionless closed loop; to the loop the machine then has none. How much there is, is
//!   learned. What the disturbance state finds is compensated at once.
//! * *Held*: no friction is fed forward, the compensation stays at what it was on average, and nothing in the loop
//!   integrates.
//! * *Pushed*: farther from the target than the tolerance, where the feedback alone would take seconds to overcome
//!   friction. A force towards the target rises from nothing while the actuator stands, so that friction lets go of
//!   it without a leap, and ends within half the tolerance, where friction stops it at once. A machine without
//!   friction does not stand and is not pushed; against what pushes it the compensation follows slowly.

mod learning;

use crate::check::{SettingsError, not_negative, positive};
use crate::observer::Estimate;
use crate::regulator::Regulator;
use crate::units::{Force, Velocity};
pub use learning::FrictionLearning;
use serde::{Deserialize, Serialize};

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Standstill<const N: usize> {
    /// How far from the target the actuator may stand, m.
    pub tolerance: f32,
    /// Longest time that settling may take, periods.
    pub settling: u32,
    /// How long nothing must want to move for it to have settled, periods.
    pub quiet: u32,
    /// Velocity below which the actuator does not want to move, m/s.
    pub least_velocity: f32,
    /// `−(v + τ dv/dt)`, of the difference from the reference: 1/s, and 1.
    pub intention: Regulator<N>,
    /// Share of the way to what is found that the compensation follows in a period where it follows slowly.
    pub rate: f32,
    /// Share of the way that the average of what is found comes in a period.
    pub averaging: f32,
    /// Intended velocity from which on the actuator must not stand, however near the target, m/s.
    pub urgent: f32,
    /// How much friction there is.
    pub learning: FrictionLearning,
}

/// What is kept from one period to the next.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory {
    compensation: f32,
    /// Average of what is found, N.
    average: f32,
    learning: learning::Memory,
    /// Periods since the reference came to rest.
    rested: u32,
    /// Periods since anything wanted to move.
    quiet: u32,
    /// Whether settling has ended.
    ended: bool,
    /// Whether it is held.
    holds: bool,
}

impl Memory {
    /// Whether the machine rests at its target and has settled.
    pub(crate) fn ended(&self) -> bool {
        self.ended
    }

    /// At rest under a steady force.
    ///
    /// * `coulomb`: friction as far as it is known
    pub(crate) fn at_rest(force: Force, coulomb: Force) -> Self {
        Self {
            compensation: force.0,
            average: force.0,
            learning: learning::Memory::new(coulomb),
            ..Self::default()
        }
    }

    /// Whether it has settled and is held.
    pub(crate) const fn holds(&self) -> bool {
        self.holds
    }
}

/// What the rule says for one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rule {
    /// The force that is compensated.
    pub(crate) compensation: Force,
    /// What friction takes of an actuator that is to move though its reference rests.
    pub(crate) friction: Force,
}

/// Share of the tolerance within which it is held, and farther off again let go.
const NEAR: f32 = 0.5;

impl<const N: usize> Standstill<N> {
    /// One period.
    ///
    /// * `rests`: whether the reference does
    /// * `difference`: of the machine from it
    pub(crate) fn step(&self, memory: &mut Memory, rests: bool, difference: &Estimate<N>) -> Rule {
        let found = difference.disturbance;
        let error = difference.position.0.abs();
        memory.average += self.averaging * (found.0 - memory.average);
        if rests {
            memory.rested = memory.rested.saturating_add(1);
        } else {
            memory.rested = 0;
            memory.learning.moves();
        }
        let intended = self.intention.step(difference).0;
        let wants = intended.abs() > self.least_velocity;
        let still = rests && !wants && error <= NEAR * self.tolerance;
        memory.quiet = if still {
            memory.quiet.saturating_add(1)
        } else {
            0
        };
        let settled = memory.rested > self.settling || memory.quiet >= self.quiet;
        if !rests || !(memory.ended || settled) {
            memory.ended = false;
            memory.holds = false;
            memory.compensation = found.0;
            let intended = Velocity(if rests && wants { intended } else { 0.0 });
            let urgent = error > NEAR * self.tolerance || intended.0.abs() > self.urgent;
            let learning = &mut memory.learning;
            let friction =
                self.learning
                    .step(learning, difference.position, found, intended, urgent);
            return Rule {
                compensation: found,
                friction,
            };
        }
        if !memory.ended {
            memory.ended = true;
            memory.compensation = memory.average;
        }
        let near = if memory.holds { 1.0 } else { NEAR };
        // Written so that what is no number is not held.
        memory.holds = error <= near * self.tolerance;
        if !memory.holds {
            memory.compensation += self.rate * (found.0 - memory.compensation);
        }
        let push = self
            .learning
            .push(&mut memory.learning, difference.position, memory.holds);
        Rule {
            compensation: Force(memory.compensation),
            friction: push,
        }
    }

    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        positive("standstill.tolerance", self.tolerance)?;
        not_negative("standstill.least_velocity", self.least_velocity)?;
        not_negative("standstill.rate", self.rate)?;
        not_negative("standstill.urgent", self.urgent)?;
        not_negative("standstill.averaging", self.averaging)?;
        self.learning.check()?;
        self.intention.check()
    }
}
