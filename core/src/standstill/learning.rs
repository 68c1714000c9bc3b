//! How much friction there is, learned while the machine settles; what the drive file declares is the first guess, or
//! what held the actuator when the signs were proven.
//! And, once it has settled, the push that overcomes it.
//!
//! ```text
//! stands, though it must move:    F += rise
//! moves as intended:              F += gain d sgn(v_intended)        0 ≤ F ≤ most
//! ```
//!
//! With too little fed forward the machine stands, and the force rises until it lets go. With too much the
//! disturbance state pulls back along the motion, and with too little along it; what a wrong model of the loads
//! does to that state is a quarter of a vibration off the motion and averages out.

use crate::check::{SettingsError, not_negative};
use crate::units::{Force, Position, Velocity};
use serde::{Deserialize, Serialize};

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrictionLearning {
    /// Share of the disturbance that is taken for friction in a period.
    pub gain: f32,
    /// By which the force rises in a period in which the actuator stands, N.
    pub rise: f32,
    /// The same of the push that takes it to its target once settled, N.
    pub push: f32,
    /// Most that friction can be, N.
    pub most: f32,
    /// Within which the actuator stands, m.
    pub stands: f32,
    /// Periods for which it is to move and has not, after which it does stand.
    pub patience: u32,
    /// Periods for which it must stand, once settled, before it is pushed: a slow loop moves by less in a few.
    pub standing: u32,
}

/// What is kept from one period to the next.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    friction: f32,
    /// Where the actuator was last seen to move, m.
    anchor: f32,
    /// Whether there has been a planned move: after a raw step the disturbance shows more than friction.
    learns: bool,
    /// For how many periods it has been there though it was to move.
    stood: u32,
    /// What pushes it to its target once settling has ended, N.
    push: f32,
}

impl Memory {
    /// * `coulomb`: the first guess
    pub(super) fn new(coulomb: Force) -> Self {
        Self {
            friction: coulomb.0,
            ..Self::default()
        }
    }

    /// The reference moves: nothing is learned before it rests.
    pub(super) fn moves(&mut self) {
        self.learns = true;
        self.stood = 0;
    }
}

impl FrictionLearning {
    /// One period; the force that friction takes.
    ///
    /// * `error`: of the actuator from its reference, which rests
    /// * `found`: what the observer finds that has to be compensated
    /// * `intended`: zero where the actuator is not to move
    /// * `urgent`: whether it must not stand
    pub(super) fn step(
        &self,
        memory: &mut Memory,
        error: Position,
        found: Force,
        intended: Velocity,
        urgent: bool,
    ) -> Force {
        let moved = self.moved(memory, error, urgent);
        memory.push = 0.0;
        let along = |force: f32| {
            if intended.0 > 0.0 {
                force
            } else if intended.0 < 0.0 {
                -force
            } else {
                0.0
            }
        };
        let change = if !memory.learns || intended.0 == 0.0 {
            0.0
        } else if moved {
            self.gain * along(found.0)
        } else if memory.stood > self.patience {
            self.rise
        } else {
            0.0
        };
        memory.friction = (memory.friction + change).max(0.0).min(self.most);
        Force(along(memory.friction))
    }

    /// One period of a machine that has settled and stands too far off: the force that takes it there. It rises from
    /// nothing while the actuator stands, and ends with the error; friction then holds it where it is.
    ///
    /// * `error`: of the actuator from its reference, which rests
    /// * `near`: whether it may stand there
    pub(super) fn push(&self, memory: &mut Memory, error: Position, near: bool) -> Force {
        let moved = self.moved(memory, error, true);
        let over = memory.push * error.0 > 0.0;
        let patience = if memory.push == 0.0 {
            self.standing
        } else {
            self.patience
        };
        if near || over {
            memory.push = 0.0;
            memory.stood = 0;
        } else if !moved && memory.stood > patience {
            let rise = if error.0 > 0.0 { -self.push } else { self.push };
            memory.push = (memory.push + rise).max(-self.most).min(self.most);
        }
        Force(memory.push)
    }

    /// Whether the actuator has moved since it was last seen to.
    fn moved(&self, memory: &mut Memory, error: Position, urgent: bool) -> bool {
        let moved = (error.0 - memory.anchor).abs() > self.stands;
        if moved {
            memory.anchor = error.0;
            memory.stood = 0;
        } else {
            memory.stood = memory.stood.saturating_add(u32::from(urgent));
        }
        moved
    }

    pub(super) fn check(&self) -> Result<(), SettingsError> {
        not_negative("standstill.learning.gain", self.gain)?;
        not_negative("standstill.learning.rise", self.rise)?;
        not_negative("standstill.learning.push", self.push)?;
        not_negative("standstill.learning.most", self.most)?;
        not_negative("standstill.learning.stands", self.stands)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEARNING: FrictionLearning = FrictionLearning {
        gain: 0.1,
        rise: 0.5,
        push: 0.5,
        most: 3.0,
        stands: 1e-6,
        patience: 3,
        standing: 6,
    };

    fn step(memory: &mut Memory, error: f32, found: f32, intended: f32) -> f32 {
        let (error, found, intended) = (Position(error), Force(found), Velocity(intended));
        LEARNING.step(memory, error, found, intended, true).0
    }

    #[test]
    fn it_rises_while_the_actuator_stands_and_no_further_than_friction_can_be() {
        let mut memory = Memory::new(Force(1.0));
        memory.moves();
        let forces = [(); 9].map(|()| step(&mut memory, 0.0, 0.0, -1.0));
        let expected = [-1.0, -1.0, -1.0, -1.5, -2.0, -2.5, -3.0, -3.0, -3.0];
        assert_eq!(forces, expected);
        // Not to move: nothing is fed forward, and nothing is forgotten.
        assert_eq!(step(&mut memory, 0.0, 1.0, 0.0), 0.0);
        assert_eq!(step(&mut memory, 1.0, 0.0, 1.0), 3.0);
    }

    /// It needs more than the force that holds it, gets it, and is left alone where it may stand.
    #[test]
    fn what_stands_too_far_off_is_pushed_until_it_is_near() {
        const HOLDS: f32 = 2.2;
        for side in [1.0, -1.0] {
            let mut memory = Memory::new(Force(0.0));
            let mut error: f32 = 10e-6 * side;
            let mut pushes = [0.0; 40];
            for push in &mut pushes {
                let near = error.abs() < 3e-6;
                *push = LEARNING.push(&mut memory, Position(error), near).0 * side;
                if push.abs() > HOLDS {
                    error -= 2e-6 * side;
                }
            }
            assert!(pushes.iter().all(|push| (-3.0..=0.0).contains(push)));
            assert!(
                pushes
                    .windows(2)
                    .all(|two| two[1] == 0.0 || two[0] - two[1] <= 0.5)
            );
            assert!(error.abs() < 3e-6, "{error}");
            assert_eq!(pushes[39], 0.0);
        }
        // Beyond its target it is not pushed on, and what moves anyway is not pushed.
        let mut memory = Memory::new(Force(0.0));
        for k in 0..40_i16 {
            let error = Position(10e-6 + 2e-6 * f32::from(k));
            assert_eq!(LEARNING.push(&mut memory, error, false), Force(0.0));
        }
        let stands = [(); 9].map(|()| LEARNING.push(&mut memory, Position(1e-4), false).0);
        assert!(stands[8] < 0.0);
        assert_eq!(
            LEARNING.push(&mut memory, Position(-1e-4), false),
            Force(0.0)
        );
        assert_eq!(
            LEARNING.push(&mut memory, Position(f32::NAN), false),
            Force(0.0)
        );
    }

    /// Too much is pulled back along the motion, whatever its direction.
    #[test]
    fn moving_it_comes_to_what_the_disturbance_leaves() {
        for direction in [1.0, -1.0] {
            let mut memory = Memory::new(Force(2.5));
            memory.moves();
            let mut force = 0.0;
            for k in 0..200_i16 {
                let found = 0.8 * direction - force;
                force = step(&mut memory, f32::from(k), found, direction);
            }
            assert!((force - 0.8 * direction).abs() < 1e-3, "{force}");
        }
    }

    #[test]
    fn what_is_no_number_is_not_kept() {
        let mut memory = Memory::new(Force(1.0));
        memory.moves();
        let force = step(&mut memory, 1.0, f32::NAN, 1.0);
        assert!((0.0..=3.0).contains(&force));
        assert!((0.0..=3.0).contains(&step(&mut memory, 2.0, 0.0, 1.0)));
    }
}
