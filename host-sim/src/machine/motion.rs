//! A machine in motion: its chain under a force that may come late, with dry friction on any mass.
//!
//! The chain is advanced exactly, the command held over the whole control period as an amplifier does: in
//! one step where nothing changes within the period, in [`PARTS`] where a mass may turn round or stick, or
//! where an external force begins or acts. Sticking needs no threshold velocity: the friction force is the
//! one that would hold the mass at the end of the part, as far as its limit reaches (a time-stepping scheme
//! after Moreau).
//!
//! **The force.** The command comes into effect late by the delay, and the force follows it by a first-order
//! lag. Over a period in which the command in effect changes once, from `u_1` to `u_2` after the share `s`,
//! with the force `g` at its beginning, all is a superposition:
//!
//! ```text
//! x+ = F x + B(T) u_1 + E(T) (g - u_1) + (B - E)((1 - s) T) (u_2 - u_1)
//! B(t)   response over t to 1 N held
//! E(t)   response over t to e^{-t / lag} N
//! ```
//!
//! In parts it is the mean of that force over each of them.

use super::friction::DryFriction;
use super::mechanics::Mechanics;
use crate::linear::product::{add, product};
use crate::linear::zoh::zero_order_hold;
use nalgebra::{DMatrix, DVector};
use std::collections::VecDeque;

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
    /// To 1 N on the mass, over a period and over a part.
    response: DVector<f64>,
    part_response: DVector<f64>,
    /// Found in this part, N.
    newton: f64,
}

/// A command and when it comes into effect.
#[derive(Clone, Copy, Debug)]
struct Pending {
    /// Parts since the beginning; the share of one comes on top.
    part: u64,
    force: f64,
}

/// A force that comes late, and its memory.
#[derive(Clone, Debug)]
struct Late {
    /// Delay in whole parts of a period, and the share of one that is left.
    parts: u64,
    share: f64,
    /// What is left of a deviation after the lag over a part, and over the rest of the part in which a command
    /// comes into effect.
    decay: f64,
    rest_decay: f64,
    /// Mean of that deviation over a part, the rest counted as a part.
    mean: f64,
    rest_mean: f64,
    /// The same over a period.
    period_decay: f64,
    period_rest_decay: f64,
    /// `E(T)` and `(B - E)((1 - s) T)`.
    fading: DVector<f64>,
    turned: DVector<f64>,
    /// Commands that are not in effect yet.
    pending: VecDeque<Pending>,
    /// The one in effect, and the force, N.
    acting: f64,
    force: f64,
    /// Parts since the beginning.
    now: u64,
}

impl Late {
    fn new(mechanics: &Mechanics, period: f64) -> Option<Self> {
        let (delay, lag) = (mechanics.delay, mechanics.lag);
        if delay <= 0.0 && lag <= 0.0 {
            return None;
        }
        let part = period / f64::from(PARTS);
        let parts = (delay / part).floor();
        let share = delay / part - parts;
        let parts = parts as u64;
        let within = (parts % u64::from(PARTS)) as f64 + share;
        let rest = period - within * part;
        let (a, b) = (mechanics.chain.a(), mechanics.chain.force_input(0));
        let decay = |time: f64| if lag > 0.0 { (-time / lag).exp() } else { 0.0 };
        let mean = |time: f64| -lag / part * (-time / lag).exp_m1();
        let mean = |time: f64| if lag > 0.0 { mean(time) } else { 0.0 };
        let fading = |time: f64| fading(&a, &b, lag, time);
        let (_, held) = zero_order_hold(&a, &b, rest);
        let rest_of_part = (1.0 - share) * part;
        Some(Self {
            parts,
            share,
            decay: decay(part),
            rest_decay: decay(rest_of_part),
            mean: mean(part),
            rest_mean: mean(rest_of_part),
            period_decay: decay(period),
            period_rest_decay: decay(rest),
            turned: held - fading(rest),
            fading: fading(period),
            pending: VecDeque::with_capacity((parts / u64::from(PARTS)) as usize + 3),
            acting: 0.0,
            force: 0.0,
            now: 0,
        })
    }

    fn command(&mut self, force: f64) {
        let part = self.now + self.parts;
        self.pending.push_back(Pending { part, force });
    }

    /// The commands in effect before and after the change that a period now has at its share for it; none where
    /// it changes elsewhere.
    fn over_a_period(&self, force: f64) -> Option<(f64, f64)> {
        let end = self.now + u64::from(PARTS);
        let own = self.now + self.parts;
        let change = self.now + self.parts % u64::from(PARTS);
        // The command of this period comes last.
        let commands = self.pending.iter().map(|at| (at.part, at.force));
        let mut within = commands
            .chain([(own, force)])
            .take_while(|(part, _)| *part < end);
        match (within.next(), within.next()) {
            (None, _) => Some((self.acting, self.acting)),
            (Some((part, after)), None) if part == change => Some((self.acting, after)),
            _ => None,
        }
    }

    /// Adds to a state what the force does over a period, the commands in effect being `before` and `after`.
    fn add(&self, (before, after): (f64, f64), held: &DVector<f64>, state: &mut DVector<f64>) {
        state.axpy(before, held, 1.0);
        state.axpy(self.force - before, &self.fading, 1.0);
        state.axpy(after - before, &self.turned, 1.0);
    }

    /// The period has passed.
    fn pass(&mut self, (before, after): (f64, f64)) {
        self.now += u64::from(PARTS);
        while self.pending.front().is_some_and(|at| at.part < self.now) {
            self.pending.pop_front();
        }
        self.acting = after;
        self.force = before
            + (self.force - before) * self.period_decay
            + (after - before) * (1.0 - self.period_rest_decay);
    }

    /// Mean of the force over the next part, N, which passes.
    fn part(&mut self) -> f64 {
        let before = self.acting;
        let beyond = self.force - before;
        let mut mean = before + beyond * self.mean;
        self.force = before + beyond * self.decay;
        if self.pending.front().is_some_and(|at| at.part == self.now)
            && let Some(Pending { force, .. }) = self.pending.pop_front()
        {
            mean += (force - before) * (1.0 - self.share - self.rest_mean);
            self.force += (force - before) * (1.0 - self.rest_decay);
            self.acting = force;
        }
        self.now += 1;
        mean
    }
}

/// Response over some time to a force on an input that begins with 1 N and fades by `e^{-t / lag}`.
fn fading(a: &DMatrix<f64>, b: &DVector<f64>, lag: f64, time: f64) -> DVector<f64> {
    let n = b.len();
    if lag <= 0.0 {
        return DVector::zeros(n);
    }
    let mut augmented = DMatrix::zeros(n + 1, n + 1);
    augmented.view_mut((0, 0), (n, n)).copy_from(a);
    augmented.view_mut((0, n), (n, 1)).copy_from(b);
    augmented[(n, n)] = -1.0 / lag;
    let (transition, _) = zero_order_hold(&augmented, &DVector::zeros(n + 1), time);
    transition.view((0, n), (n, 1)).column(0).into_owned()
}

impl Motion {
    /// A machine at rest at the origin, without force.
    ///
    /// * `period`: of the control, s
    #[must_use]
    pub fn new(mechanics: &Mechanics, period: f64) -> Self {
        let chain = &mechanics.chain;
        let (a, part) = (chain.a(), period / f64::from(PARTS));
        let (transition, _) = zero_order_hold(&a, &chain.force_input(0), period);
        let (part_transition, _) = zero_order_hold(&a, &chain.force_input(0), part);
        let all = mechanics.friction.iter().copied();
        let all = all.chain(std::iter::repeat(DryFriction::default()));
        let frictions = all.take(chain.mass.len()).enumerate();
        let frictions = frictions.filter(|(mass, dry)| *mass == 0 || dry.any());
        let frictions = frictions.map(|(mass, dry)| {
            let b = chain.force_input(mass);
            Rubbing {
                velocity: 2 * mass + 1,
                dry,
                response: zero_order_hold(&a, &b, period).1,
                part_response: zero_order_hold(&a, &b, part).1,
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
            late.pending.clear();
            (late.acting, late.force) = (force, force);
        }
    }

    /// A brake closes on the actuator, or opens: friction that nothing overcomes.
    pub fn brake(&mut self, closed: bool) {
        self.braked = closed;
    }

    /// One period under a held command, N: at once while all that rubs slides, in parts where it may turn
    /// round or stick.
    pub fn advance(&mut self, force: f64) {
        if !self.at_once(force) {
            self.in_parts(force, |_, _, _| ());
        }
    }

    /// One period at once, if every mass with friction is too fast for its direction to change within it:
    /// faster than its velocity changes. Whether that was so; if not, nothing has moved.
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
        product(&self.transition, &self.state, &mut self.next);
        if let (Some(late), Some(commands)) = (&self.late, commands) {
            late.add(commands, &self.frictions[0].response, &mut self.next);
        }
        for (number, rubbing) in self.frictions.iter().enumerate() {
            let before = self.state[rubbing.velocity];
            let friction = rubbing.dry.sliding(before) * before.signum();
            let newton = match commands {
                None if number == 0 => force - friction,
                _ => -friction,
            };
            add(newton, &rubbing.response, &mut self.next);
        }
        let slide = |rubbing: &Rubbing| {
            let velocity = rubbing.velocity;
            rubbing.slides(self.state[velocity], self.next[velocity])
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
            product(&self.part_transition, &self.state, &mut self.next);
            add(motor, &self.frictions[0].part_response, &mut self.next);
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
            several += usize::from(rubbing.dry.any());
        }
        several += usize::from(self.braked && !self.frictions[0].dry.any());
        for _ in 0..SWEEPS {
            let (mut change, mut largest) = (0.0_f64, 0.0_f64);
            for (number, rubbing) in self.frictions.iter_mut().enumerate() {
                let dry = if self.braked && number == 0 {
                    DryFriction::coulomb(BRAKE)
                } else {
                    rubbing.dry
                };
                if !dry.any() {
                    continue;
                }
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
        !self.dry.any() || (change < slowest && fast)
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
