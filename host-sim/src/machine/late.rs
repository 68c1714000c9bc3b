//! A force that comes late: what a command becomes on its way to the actuator.
//!
//! The command comes into effect late by the delay, and the force follows it by a first-order
//! lag. Over a period in which the command in effect changes once, from `u_1` to `u_2` after the share `s`,
//! with the force `g` at its beginning, all is a superposition:
//!
//! ```text
//! x+ = F x + B(T) u_1 + E(T) (g - u_1) + (B - E)((1 - s) T) (u_2 - u_1)
//! B(t)   response over t to 1 N held
//! E(t)   response over t to e^{-t / lag} N
//! ```
//!
//! In parts of a period it is the mean of that force over each of them.

use super::mechanics::Mechanics;
use super::motion::PARTS;
use crate::linear::zoh::zero_order_hold;
use nalgebra::{DMatrix, DVector};
use std::collections::VecDeque;

/// A command and when it comes into effect.
#[derive(Clone, Copy, Debug)]
struct Pending {
    /// Parts since the beginning; the share of one comes on top.
    part: u64,
    force: f64,
}

/// A force that comes late, and its memory.
#[derive(Clone, Debug)]
pub(super) struct Late {
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
    /// None where the force comes at once.
    pub(super) fn new(mechanics: &Mechanics, period: f64) -> Option<Self> {
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

    /// A force that has long been applied, N.
    pub(super) fn hold(&mut self, force: f64) {
        self.pending.clear();
        (self.acting, self.force) = (force, force);
    }

    /// A command is given, N.
    pub(super) fn command(&mut self, force: f64) {
        let part = self.now + self.parts;
        self.pending.push_back(Pending { part, force });
    }

    /// The commands in effect before and after the change that a period now has at its share for it; none where
    /// it changes elsewhere.
    pub(super) fn over_a_period(&self, force: f64) -> Option<(f64, f64)> {
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

    /// Adds to a state what the force does over a period beyond `before`, the commands in effect being `before` and
    /// `after`.
    pub(super) fn add(&self, (before, after): (f64, f64), state: &mut DVector<f64>) {
        state.axpy(self.force - before, &self.fading, 1.0);
        state.axpy(after - before, &self.turned, 1.0);
    }

    /// The period has passed.
    pub(super) fn pass(&mut self, (before, after): (f64, f64)) {
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
    pub(super) fn part(&mut self) -> f64 {
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

/// A machine over one period, its current held: transition and input per A. States: the chain, then, where the
/// force comes late, the force and the commands of the periods before, the last one first, all in A.
pub(super) fn sampled(mechanics: &Mechanics, period: f64) -> (DMatrix<f64>, DVector<f64>) {
    let chain = &mechanics.chain;
    let (transition, held) = zero_order_hold(&chain.a(), &chain.b(), period);
    let Some(late) = Late::new(mechanics, period) else {
        return (transition, held);
    };
    let whole = (late.parts / u64::from(PARTS)) as usize;
    let (n, k_f) = (held.len(), chain.force_constant);
    let (force, size) = (n, n + 2 + whole);
    let (mut a, mut b) = (DMatrix::zeros(size, size), DVector::zeros(size));
    a.view_mut((0, 0), (n, n)).copy_from(&transition);
    // What the three of the superposition do, to the chain and to the force.
    let with = |of_chain: DVector<f64>, of_force: f64| of_chain.push(of_force);
    let rest = with(late.turned * k_f, 1.0 - late.period_rest_decay);
    let own = with(late.fading * k_f, late.period_decay);
    let before = with(held, 1.0) - &own - &rest;
    a.view_mut((0, force), (n + 1, 1)).copy_from(&own);
    a.view_mut((0, size - 1), (n + 1, 1)).copy_from(&before);
    // The command after the change is this period's or one of those before.
    if whole == 0 {
        b.rows_mut(0, n + 1).copy_from(&rest);
    } else {
        a.view_mut((0, size - 2), (n + 1, 1)).copy_from(&rest);
    }
    b[force + 1] = 1.0;
    for older in force + 2..size {
        a[(older, older - 1)] = 1.0;
    }
    (a, b)
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
