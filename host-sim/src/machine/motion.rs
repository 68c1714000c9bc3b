//! The chain in motion, with Coulomb friction on the actuator.
//!
//! The chain is advanced exactly, the current held over the whole control period as an amplifier does: in
//! one step where nothing changes within the period, in [`PARTS`] where the actuator may turn round or
//! stick, or where an external force begins or acts. Sticking needs no threshold velocity: the friction
//! force is the one that would hold the actuator at the end of the part, as far as the Coulomb limit
//! reaches (a time-stepping scheme after Moreau).

use crate::chain::Chain;
use crate::linear::zoh::zero_order_hold;
use nalgebra::{DMatrix, DVector};

/// Parts of a control period in which something changes.
pub const PARTS: u32 = 20;

/// A chain in motion; `f64` and no allocation per step.
#[derive(Clone, Debug)]
pub struct Motion {
    coulomb: f64,
    transition: DMatrix<f64>,
    /// To 1 N on the actuator.
    response: DVector<f64>,
    part_transition: DMatrix<f64>,
    part_response: DVector<f64>,
    state: DVector<f64>,
    next: DVector<f64>,
}

impl Motion {
    /// A chain at rest at the origin.
    ///
    /// * `coulomb`: friction of the actuator, N; negative, as a fit may try it, it pushes
    /// * `period`: of the control, s
    #[must_use]
    pub fn new(chain: &Chain, coulomb: f64, period: f64) -> Self {
        let (a, b) = (chain.a(), chain.force_input(0));
        let (transition, response) = zero_order_hold(&a, &b, period);
        let (part_transition, part_response) = zero_order_hold(&a, &b, period / f64::from(PARTS));
        Self {
            coulomb,
            transition,
            response,
            part_transition,
            part_response,
            state: DVector::zeros(chain.states()),
            next: DVector::zeros(chain.states()),
        }
    }

    /// State `x_a v_a x_1 v_1 …`, m and m/s.
    #[must_use]
    pub fn state(&self) -> &DVector<f64> {
        &self.state
    }

    /// The same, to be put elsewhere or corrected.
    pub fn state_mut(&mut self) -> &mut DVector<f64> {
        &mut self.state
    }

    /// One period under a held force on the actuator, N: at once while the actuator slides, in parts
    /// where it may turn round or stick.
    pub fn advance(&mut self, force: f64) {
        if !self.at_once(force) {
            self.in_parts(force, |_, _| ());
        }
    }

    /// One period at once, if the actuator is too fast for its direction to change within it: faster than
    /// its velocity changes. Whether that was so; if not, nothing has moved.
    pub fn at_once(&mut self, force: f64) -> bool {
        let before = self.state[1];
        let sliding = force - self.coulomb * before.signum();
        self.next.gemv(1.0, &self.transition, &self.state, 0.0);
        self.next.axpy(sliding, &self.response, 1.0);
        let change = (self.next[1] - before).abs();
        let slides = self.coulomb == 0.0 || change < before.abs().min(self.next[1].abs());
        if slides {
            std::mem::swap(&mut self.state, &mut self.next);
        }
        slides
    }

    /// One period in parts.
    ///
    /// * `external`: adds to the state at the end of a part, whose number it gets, what other forces do
    pub fn in_parts(&mut self, force: f64, mut external: impl FnMut(u32, &mut DVector<f64>)) {
        for part in 0..PARTS {
            let before = self.state[1];
            self.next.gemv(1.0, &self.part_transition, &self.state, 0.0);
            self.next.axpy(force, &self.part_response, 1.0);
            external(part, &mut self.next);
            if self.coulomb != 0.0 {
                let friction = self.friction(before, self.next[1]);
                self.next.axpy(friction, &self.part_response, 1.0);
            }
            std::mem::swap(&mut self.state, &mut self.next);
        }
    }

    /// Friction over one part of a period, from the velocity at its beginning and what it would be at
    /// the end without friction: sliding, holding, or turned round in between, in which case it is the
    /// mean of both directions over the times they last.
    fn friction(&self, before: f64, without: f64) -> f64 {
        let limit = self.coulomb;
        let per_newton = self.part_response[1];
        if before != 0.0 {
            let against = -limit * before.signum();
            let after = without + against * per_newton;
            if after * before > 0.0 {
                return against;
            }
            let drive = (without - before) / per_newton;
            if drive.abs() > limit {
                let share = before / (before - after);
                return against * (2.0 * share - 1.0);
            }
        }
        // Negative friction, tried by a fit, pushes instead.
        (-without / per_newton).clamp(-limit.abs(), limit.abs()) * limit.signum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1e-3;

    /// A mass alone, moving.
    fn mass(coulomb: f64, velocity: f64) -> Motion {
        let chain = Chain {
            mass: vec![0.5],
            stiffness: Vec::new(),
            damping: Vec::new(),
            viscous: 0.0,
            force_constant: 1.0,
        };
        let mut motion = Motion::new(&chain, coulomb, PERIOD);
        motion.state_mut()[1] = velocity;
        motion
    }

    /// Pushed back against its motion, a mass is braked by force and friction, and speeds up the other way
    /// by what the friction leaves of the force: its velocity is exact, wherever in a part it turns.
    #[test]
    fn turning_round_is_exact_within_a_part() {
        for velocity in [1.9e-3, 2.03e-3, 3.511e-3, -2.03e-3] {
            let mut motion = mass(1.0, velocity);
            motion.advance(-3.0 * velocity.signum());
            let braking = velocity.abs() / (4.0 / 0.5);
            let expected = -velocity.signum() * (PERIOD - braking) * 2.0 / 0.5;
            let found = motion.state()[1];
            assert!((found - expected).abs() < 1e-15, "{velocity}: {found}");
        }
    }

    /// Where the force is less than friction it stops and stays; with less than no friction, as a fit may
    /// try, it is pushed on.
    #[test]
    fn friction_holds_and_negative_friction_pushes() {
        let mut held = mass(1.0, 1e-3);
        let mut pushed = mass(-1.0, 1e-3);
        for _ in 0..10 {
            held.advance(0.9);
            pushed.advance(0.0);
        }
        assert!(held.state()[1].abs() < 1e-15);
        assert!((pushed.state()[1] - (1e-3 + 10.0 * PERIOD / 0.5)).abs() < 1e-14);
    }
}
