//! A machine in motion: its chain under a force that may come late, with dry friction on any mass.
//!
//! The chain is advanced exactly, the command held over the whole control period as an amplifier does: in
//! one step where nothing changes within the period, in [`PARTS`] where a mass may turn round or stick, or
//! where an external force begins or acts. Sticking needs no threshold velocity: the friction force is the
//! one that would hold the mass at the end of the part, as far as its limit reaches (a time-stepping scheme
//! after Moreau).

use super::friction::DryFriction;
use super::late::Late;
use super::mechanics::Mechanics;
use crate::linear::product::{add, product_and};
use crate::linear::zoh::zero_order_hold;
use nalgebra::{DMatrix, DVector};

/// Parts of a control period in which something changes.
pub const PARTS: u32 = 20;

/// Friction of a brake, N: more than anything overcomes.
const BRAKE: f64 = 1e12;
/// Velocities, over the Stribeck velocity, from which on nothing is left of what holds at rest.
const FAST: f64 = 4.0;
/// Most times that the frictions of several masses are found after one another in a part, and the share of
/// the largest by which none of them changes any more.
const SWEEPS: usize = 30;
const SETTLED: f64 = 1e-13;

/// A machine in motion; `f64` and no allocation per step.
#[derive(Clone, Debug)]
pub struct Motion {
    transition: DMatrix<f64>,
    part_transition: DMatrix<f64>,
    /// Of each mass that has any, and of the actuator; the actuator first.
    frictions: Vec<Rubbing>,
    /// Whether a brake holds the actuator.
    braked: bool,
    /// How the force comes late; none where it does not.
    late: Option<Late>,
    state: DVector<f64>,
    next: DVector<f64>,
}

/// A mass and its friction.
#[derive(Clone, Debug)]
struct Rubbing {
    /// Of its velocity in the state.
    velocity: usize,
    dry: DryFriction,
    /// Whether there is any.
    any: bool,
    /// To 1 N on the mass, over a period and over a part.
    response: DVector<f64>,
    part_response: DVector<f64>,
    /// Found in this part, N.
    newton: f64,
}

impl Motion {
    /// A machine at rest at the origin, without force.
    ///
    /// * `period`: of the control, s
    #[must_use]
    pub fn new(mechanics: &Mechanics, period: f64) -> Self {
        let chain = &mechanics.chain;
        let (a, part) = (chain.a(), period / f64::from(PARTS));
        let held = |mass: usize, time: f64| zero_order_hold(&a, &chain.force_input(mass), time);
        let (transition, response) = held(0, period);
        let (part_transition, part_response) = held(0, part);
        let of_actuator = (response, part_response);
        let all = mechanics.friction.iter().copied();
        let all = all.chain(std::iter::repeat(DryFriction::default()));
        let frictions = all.take(chain.mass.len()).enumerate();
        let frictions = frictions.filter(|(mass, dry)| *mass == 0 || dry.any());
        let frictions = frictions.map(|(mass, dry)| {
            let (response, part_response) = match mass {
                0 => of_actuator.clone(),
                _ => (held(mass, period).1, held(mass, part).1),
            };
            Rubbing {
                velocity: 2 * mass + 1,
                any: dry.any(),
                dry,
                response,
                part_response,
                newton: 0.0,
            }
        });
        Self {
            transition,
            part_transition,
            frictions: frictions.collect(),
            braked: false,
            late: Late::new(mechanics, period),
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

    /// A force that has long been applied, N: what delay and lag remember.
    pub fn hold(&mut self, force: f64) {
        if let Some(late) = &mut self.late {
            late.hold(force);
        }
    }

    /// A brake closes on the actuator, or opens: friction that nothing overcomes.
    pub fn brake(&mut self, closed: bool) {
        self.braked = closed;
    }

    /// One period under a held command, N: at once while all that rubs slides, in parts where it may turn
    /// round or stick.
    #[inline]
    pub fn advance(&mut self, force: f64) {
        if !self.at_once(force) {
            self.in_parts(force, |_, _, _| ());
        }
    }

    /// One period at once, if every mass with friction is too fast for its direction to change within it:
    /// faster than its velocity changes. Whether that was so; if not, nothing has moved.
    #[inline]
    pub fn at_once(&mut self, force: f64) -> bool {
        if self.braked {
            return false;
        }
        let commands = match &self.late {
            None => None,
            Some(late) => {
                let Some(commands) = late.over_a_period(force) else {
                    return false;
                };
                Some(commands)
            }
        };
        let sliding = |rubbing: &Rubbing| {
            if !rubbing.any {
                return 0.0;
            }
            let before = self.state[rubbing.velocity];
            rubbing.dry.sliding(before) * before.signum()
        };
        let (actuator, loads) = self.frictions.split_at(1);
        let (state, next) = (&self.state, &mut self.next);
        if let (Some(late), Some(commands)) = (&self.late, commands) {
            let held = (commands.0, &actuator[0].response);
            product_and(&self.transition, state, held, next);
            late.add(commands, next);
            add(-sliding(&actuator[0]), &actuator[0].response, next);
        } else {
            let newton = (force - sliding(&actuator[0]), &actuator[0].response);
            product_and(&self.transition, state, newton, next);
        }
        for rubbing in loads {
            add(-sliding(rubbing), &rubbing.response, next);
        }
        let slide = |rubbing: &Rubbing| {
            let velocity = rubbing.velocity;
            !rubbing.any || rubbing.slides(self.state[velocity], self.next[velocity])
        };
        let slides = self.frictions.iter().all(slide);
        if slides {
            std::mem::swap(&mut self.state, &mut self.next);
            if let (Some(late), Some(commands)) = (&mut self.late, commands) {
                late.command(force);
                late.pass(commands);
            }
        }
        slides
    }

    /// One period in parts.
    ///
    /// * `external`: adds to the state at the end of a part, whose number and beginning it gets, what other
    ///   forces do
    pub fn in_parts(
        &mut self,
        force: f64,
        external: impl FnMut(u32, &DVector<f64>, &mut DVector<f64>),
    ) {
        self.for_parts(force, PARTS, external);
    }

    /// Some parts of a period, each a twentieth, under a held command, N: a period that is longer or shorter.
    pub fn advance_for(&mut self, force: f64, parts: u32) {
        self.for_parts(force, parts, |_, _, _| ());
    }

    /// The same, with other forces, see [`in_parts`](Self::in_parts).
    pub fn for_parts(
        &mut self,
        force: f64,
        parts: u32,
        mut external: impl FnMut(u32, &DVector<f64>, &mut DVector<f64>),
    ) {
        if let Some(late) = &mut self.late {
            late.command(force);
        }
        for part in 0..parts {
            let motor = self.late.as_mut().map_or(force, Late::part);
            let response = &self.frictions[0].part_response;
            product_and(
                &self.part_transition,
                &self.state,
                (motor, response),
                &mut self.next,
            );
            external(part, &self.state, &mut self.next);
            self.rub();
            std::mem::swap(&mut self.state, &mut self.next);
        }
    }

    /// What friction does over one part of a period. Where several masses rub, each holds or slides in view of
    /// what the others do.
    fn rub(&mut self) {
        let mut several = 0;
        for rubbing in &mut self.frictions {
            rubbing.newton = 0.0;
            several += usize::from(rubbing.any);
        }
        several += usize::from(self.braked && !self.frictions[0].any);
        for _ in 0..SWEEPS {
            let (mut change, mut largest) = (0.0_f64, 0.0_f64);
            for (number, rubbing) in self.frictions.iter_mut().enumerate() {
                let dry = if self.braked && number == 0 {
                    DryFriction::coulomb(BRAKE)
                } else if rubbing.any {
                    rubbing.dry
                } else {
                    continue;
                };
                let per_newton = rubbing.part_response[rubbing.velocity];
                let before = self.state[rubbing.velocity];
                let without = self.next[rubbing.velocity] - rubbing.newton * per_newton;
                let newton = friction(&dry, per_newton, before, without);
                let more = newton - rubbing.newton;
                add(more, &rubbing.part_response, &mut self.next);
                rubbing.newton = newton;
                change = change.max(more.abs());
                largest = largest.max(newton.abs());
            }
            if several < 2 || change <= SETTLED * largest {
                break;
            }
        }
    }
}

impl Rubbing {
    /// Whether it slides in one direction from one velocity to another, so fast that its friction is that of
    /// sliding.
    fn slides(&self, before: f64, after: f64) -> bool {
        let change = (after - before).abs();
        let slowest = before.abs().min(after.abs());
        let fast = self.dry.breakaway == 0.0 || slowest > FAST * self.dry.stribeck_velocity;
        change < slowest && fast
    }
}

/// Friction over one part of a period, from the velocity at its beginning and what it would be at
/// the end without friction: sliding, holding, or turned round in between, in which case it is the
/// mean of both directions over the times they last.
fn friction(dry: &DryFriction, per_newton: f64, before: f64, without: f64) -> f64 {
    if before != 0.0 {
        let against = -dry.sliding(before) * before.signum();
        let after = without + against * per_newton;
        if after * before > 0.0 {
            return against;
        }
        let drive = (without - before) / per_newton;
        if drive.abs() > dry.holding(drive) {
            let share = before / (before - after);
            let turned = dry.holding(drive) * before.signum();
            return against * (2.0 * share - 1.0) + (turned + against) * (1.0 - share);
        }
    }
    let limit = dry.holding(without);
    // Negative friction, tried by a fit, pushes instead.
    (-without / per_newton).clamp(-limit.abs(), limit.abs()) * limit.signum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Chain;

    const PERIOD: f64 = 1e-3;
    /// kg.
    const MASS: f64 = 0.5;

    fn alone() -> Chain {
        Chain {
            mass: vec![MASS],
            stiffness: Vec::new(),
            damping: Vec::new(),
            viscous: 0.0,
            ground: Vec::new(),
            force_constant: 1.0,
        }
    }

    /// A mass alone, moving.
    fn rubbing(dry: DryFriction, velocity: f64) -> Motion {
        let mechanics = Mechanics {
            friction: vec![dry],
            ..Mechanics::of_chain(&alone(), 0.0)
        };
        let mut motion = Motion::new(&mechanics, PERIOD);
        motion.state_mut()[1] = velocity;
        motion
    }

    fn mass(coulomb: f64, velocity: f64) -> Motion {
        rubbing(DryFriction::coulomb(coulomb), velocity)
    }

    /// A mass alone whose force comes late.
    fn late(delay: f64, lag: f64) -> Motion {
        let mechanics = Mechanics {
            delay,
            lag,
            ..Mechanics::of_chain(&alone(), 0.0)
        };
        Motion::new(&mechanics, PERIOD)
    }

    /// Position and velocity of a mass some time after the force on it began to rise to 1 N with a lag.
    fn lagging(time: f64, lag: f64) -> [f64; 2] {
        if time <= 0.0 {
            return [0.0; 2];
        }
        // Integrals of 1 - e^{-t / lag}.
        let once = time + lag * (-time / lag).exp_m1();
        let twice = 0.5 * time * time - lag * once;
        [twice / MASS, once / MASS]
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

    /// A step of force through delay and lag, on a mass alone: polynomial and exponential, at every period.
    #[test]
    fn a_late_force_is_exact() {
        // Neither, less than a part, parts, periods, periods and parts.
        let delays = [
            0.0, 0.013e-3, 0.4e-3, 0.73e-3, 1e-3, 2e-3, 2.73e-3, 3.999e-3,
        ];
        for lag in [0.0, 1e-6, 0.2e-3, 1.3e-3, 0.1] {
            for delay in delays {
                let mut motion = late(delay, lag);
                for period in 1..=12 {
                    assert!(motion.at_once(2.0));
                    let time = f64::from(period) * PERIOD - delay;
                    let expected = if lag > 0.0 {
                        lagging(time, lag)
                    } else {
                        let time = time.max(0.0);
                        [0.5 * time * time / MASS, time / MASS]
                    };
                    for (found, expected) in motion.state().iter().zip(expected) {
                        let far = (found - 2.0 * expected).abs();
                        assert!(far < 1e-14, "{delay} {lag} {period}: {found} {expected}");
                    }
                }
            }
        }
    }

    /// A force that changes every period, at once and in parts: the velocity of a mass alone is the same to the
    /// last figures, for each part has the mean force; the rest to a thousandth of what a period's force does.
    #[test]
    fn a_late_period_at_once_is_one_in_parts() {
        for lag in [0.0, 0.3e-3, 4e-3] {
            for delay in [0.0, 0.013e-3, 0.73e-3, 1e-3, 2.41e-3] {
                let mechanics = Mechanics {
                    delay,
                    lag,
                    ..Mechanics::of_chain(&Chain::of_table_1(300.0, 0.1), 0.0)
                };
                for mut at_once in [late(delay, lag), Motion::new(&mechanics, PERIOD)] {
                    let (mut in_parts, mut in_two) = (at_once.clone(), at_once.clone());
                    let mass = mechanics.chain.mass[0].min(MASS);
                    for period in 0..60 {
                        let force = (f64::from(period) * 1.7).sin();
                        assert!(at_once.at_once(force));
                        in_parts.in_parts(force, |_, _, _| ());
                        in_two.advance_for(force, 7);
                        in_two.advance_for(force, PARTS - 7);
                        let far = at_once.state() - in_parts.state();
                        let twice = (in_two.state() - in_parts.state()).amax();
                        let case = format!("{delay} {lag} {period}: {far}");
                        assert!(twice < 1e-14, "{case}");
                        assert!(at_once.state().len() > 2 || far[1].abs() < 1e-14, "{case}");
                        assert!(far.amax() < 1e-3 * PERIOD / mass, "{case}");
                    }
                }
            }
        }
    }

    /// Both ways of passing a period may follow one another: the memory of one is that of the other.
    #[test]
    fn delay_and_lag_are_remembered_across_both_ways() {
        for (delay, lag) in [(0.73e-3, 0.0), (2.41e-3, 0.4e-3)] {
            let (mut one, mut other) = (late(delay, lag), late(delay, lag));
            for period in 0..40 {
                let force = f64::from(period % 5) - 1.3;
                assert!(one.at_once(force));
                match period % 3 {
                    0 => other.in_parts(force, |_, _, _| ()),
                    _ => other.advance(force),
                }
                assert!((one.state()[1] - other.state()[1]).abs() < 1e-14);
            }
        }
    }

    /// A period of 27 parts under one command, the next of 20: the delay is one of time.
    #[test]
    fn a_late_cycle_delays_no_less() {
        let mut motion = late(1.51e-3, 0.0);
        motion.advance_for(2.0, 27);
        assert_eq!(motion.state()[1], 0.0);
        motion.advance(3.0);
        let part = PERIOD / f64::from(PARTS);
        let acting = 47.0 * part - 1.51e-3;
        assert!((motion.state()[1] - 2.0 * acting / MASS).abs() < 1e-14);
        motion.advance(0.0);
        let changed = 27.0 * part + 1.51e-3;
        let momentum = 2.0 * (27.0 * part) + 3.0 * (67.0 * part - changed);
        assert!((motion.state()[1] - momentum / MASS).abs() < 1e-14);
    }

    /// What has long been applied acts from the first period on.
    #[test]
    fn a_force_that_is_held_acts_at_once() {
        let mut motion = late(2.3e-3, 5e-3);
        motion.hold(1.5);
        for period in 1..6 {
            motion.advance(1.5);
            let expected = 1.5 * f64::from(period) * PERIOD / MASS;
            assert!((motion.state()[1] - expected).abs() < 1e-15);
        }
    }

    /// Friction of a load alone: a chain that moves as one stops after `M v / F`, `M v^2 / (2 F)` farther, and
    /// stays.
    #[test]
    fn friction_of_a_load_stops_the_chain() {
        let chain = Chain {
            mass: vec![0.05, 0.15],
            stiffness: vec![1e5],
            damping: vec![10.0],
            ..alone()
        };
        let mechanics = Mechanics {
            friction: vec![DryFriction::default(), DryFriction::coulomb(0.4)],
            ..Mechanics::of_chain(&chain, 0.0)
        };
        let mut motion = Motion::new(&mechanics, PERIOD);
        (motion.state_mut()[1], motion.state_mut()[3]) = (0.3, 0.3);
        let time = 0.2 * 0.3 / 0.4;
        let mut passed = 0.0;
        while motion.state()[3].abs() > 1e-9 {
            motion.advance(0.0);
            passed += PERIOD;
            assert!(passed < 2.0 * time);
        }
        assert!((passed - time).abs() < 2e-3, "{passed} {time}");
        for _ in 0..50 {
            motion.advance(0.0);
        }
        let distance = 0.2 * 0.3_f64.powi(2) / (2.0 * 0.4);
        assert!((motion.state()[2] / distance - 1.0).abs() < 1e-3);
        let place = motion.state()[2];
        for _ in 0..100 {
            motion.advance(0.0);
        }
        assert!((motion.state()[2] - place).abs() < 1e-12);
    }

    /// Two masses that both stick hold what is less than both frictions, with the spring between them as it is.
    #[test]
    fn two_masses_hold_together() {
        let chain = Chain {
            mass: vec![0.05, 0.15],
            stiffness: vec![1e4],
            damping: vec![5.0],
            ..alone()
        };
        let mechanics = Mechanics {
            friction: vec![DryFriction::coulomb(0.3), DryFriction::coulomb(0.4)],
            ..Mechanics::of_chain(&chain, 0.0)
        };
        let mut motion = Motion::new(&mechanics, PERIOD);
        // 0.35 N in the spring: the motor and the friction of the actuator carry it, that of the load as well.
        motion.state_mut()[2] = -0.35 / 1e4;
        let before = motion.state().clone();
        for _ in 0..100 {
            motion.advance(0.2);
        }
        assert!((motion.state() - &before).amax() < 1e-12);
        for _ in 0..100 {
            motion.advance(0.8);
        }
        assert!(motion.state()[3] > 0.01, "{}", motion.state());
    }

    /// Held up to what holds at rest, braked by Coulomb friction alone once fast, in between by the curve.
    #[test]
    fn friction_falls_with_velocity() {
        let dry = DryFriction {
            breakaway: 0.5,
            stribeck_velocity: 0.01,
            ..DryFriction::coulomb(1.0)
        };
        let mut held = rubbing(dry, 0.0);
        for _ in 0..100 {
            held.advance(1.499);
        }
        assert!(held.state()[0].abs() < 1e-15);
        held.advance(1.501);
        held.advance(1.501);
        assert!(held.state()[1] > 0.0);
        let mut fast = rubbing(dry, 0.1);
        for _ in 0..10 {
            fast.advance(0.0);
        }
        assert!((fast.state()[1] - (0.1 - 10.0 * PERIOD / MASS)).abs() < 1e-14);
        // At the Stribeck velocity it is balanced by the force of the curve there.
        let mut balanced = rubbing(dry, 0.01);
        let force = 1.0 + 0.5 * (-1.0_f64).exp();
        balanced.advance(force);
        assert!((balanced.state()[1] - 0.01).abs() < 1e-15);
    }

    /// Each direction is braked by its own friction, and where a mass turns round in a part, by one after the
    /// other.
    #[test]
    fn each_direction_has_its_friction() {
        let dry = DryFriction {
            forward: 1.0,
            backward: 0.4,
            ..DryFriction::default()
        };
        for (velocity, friction) in [(0.5, 1.0), (-0.5, 0.4)] {
            let mut motion = rubbing(dry, velocity);
            for _ in 0..5 {
                motion.advance(0.0);
            }
            let expected = velocity - velocity.signum() * friction * 5.0 * PERIOD / MASS;
            assert!((motion.state()[1] - expected).abs() < 1e-14);
        }
        let mut turning = rubbing(dry, 2.03e-3);
        turning.advance(-2.0);
        let braking = 2.03e-3 / (3.0 / MASS);
        let expected = -(PERIOD - braking) * 1.6 / MASS;
        assert!((turning.state()[1] - expected).abs() < 1e-15);
        let (mut forward, mut backward) = (rubbing(dry, 0.0), rubbing(dry, 0.0));
        forward.advance(0.9);
        backward.advance(-0.5);
        assert_eq!(forward.state()[1], 0.0);
        assert!((backward.state()[1] + 0.1 * PERIOD / MASS).abs() < 1e-16);
    }
}
