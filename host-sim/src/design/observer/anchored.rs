//! The default observer: states `r_1 v_1 … r_n v_n q_1 q_2 d` relative to the actuator.
//!
//! The input is the actuator's mean velocity, the lags of both force observers are part of the model,
//! `d` is a random walk. Placed poles keep the frequency that the load has by itself and are only damped:
//! each decays `speed` times as fast as the slowest pole of the regulator, or as it does anyway where that
//! is faster ("at least twice faster than the control system"). To move frequencies as well would cost
//! gain and buy nothing. Without the disturbance state its row of the transition is zero, so that it stays
//! zero.

use super::{Model, ObserverDesign, Variant, kalman};
use crate::chain::Chain;
use crate::chain::load::on_moving_actuator;
use crate::design::require_stable;
use crate::drive::{Drive, ObserverMethod};
use crate::error::{Error, Result};
use crate::linear::eigen::{eigenvalues, separation};
use crate::linear::place::place;
use crate::linear::zoh::zero_order_hold;
use nalgebra::{Complex, DMatrix, DVector, RowDVector};

pub(super) struct Anchored;

impl Variant for Anchored {
    fn design(&self, drive: &Drive, chain: &Chain, regulator_decay: f64) -> Result<ObserverDesign> {
        let sample_time = drive.control.sample_time;
        let settings = &drive.observer;
        let (a, b) = model(drive, chain);
        let n = b.len();
        let (mut transition, input) = zero_order_hold(&a, &b, sample_time);
        // What does not act on a state does not in a period, but by rounding: the core leaves it out.
        let lags = n - 3;
        transition.view_mut((0, lags), (lags, 3)).fill(0.0);
        transition.view_mut((n - 1, 0), (1, n - 1)).fill(0.0);
        transition[(lags, n - 2)] = 0.0;
        let mut output = RowDVector::zeros(n);
        output[n - 2] = 1.0;
        // The states that are estimated: the disturbance is the last.
        let states = if settings.disturbance { n } else { n - 1 };
        let part = |matrix: &DMatrix<f64>| matrix.view((0, 0), (states, states)).into_owned();
        let (a_part, transition_part) = (part(&a), part(&transition));
        let output_part = output.columns(0, states).into_owned();
        let gain = match settings.design {
            ObserverMethod::Kalman => {
                let mut noise = DMatrix::zeros(states, states);
                for load in 0..chain.loads() {
                    let velocity = 2 * load + 1;
                    let density = settings.load_force_ratio / chain.mass[load + 1];
                    noise[(velocity, velocity)] = density.powi(2);
                }
                if settings.disturbance {
                    noise[(n - 1, n - 1)] = settings.disturbance_rate.powi(2);
                }
                kalman(&a_part, &transition_part, &output_part, &noise, sample_time)?
            }
            ObserverMethod::Poles => {
                let decay = settings.speed * regulator_decay;
                let poles = damped(&eigenvalues(&a_part)?, decay);
                let discrete: Vec<_> = poles
                    .iter()
                    .map(|pole| (pole * sample_time).exp())
                    .collect();
                // The error goes by (1 − L c) F = F − L (c F).
                let seen = &output_part * &transition_part;
                let placed = place(&transition_part.transpose(), &seen.transpose(), &discrete);
                placed.map_err(|_| {
                    Error::Design(format!(
                        "observer.speed = {}: poles that fast cannot be placed accurately, lower it or use \
                         observer.design = \"kalman\"",
                        settings.speed
                    ))
                })?
            }
        };
        let mut correction = DVector::zeros(n);
        correction.rows_mut(0, states).copy_from(&gain);
        if !settings.disturbance {
            transition.row_mut(n - 1).fill(0.0);
        }
        let observer = ObserverDesign {
            transition,
            input,
            output,
            correction,
        };
        require_stable("the observer", &observer.error_transition())?;
        Ok(observer)
    }

    fn model(&self, drive: &Drive, chain: &Chain) -> Model {
        let (a, b) = model(drive, chain);
        let n = b.len();
        let mut c = RowDVector::zeros(n);
        c[n - 2] = 1.0;
        Model { a, c, forces: 3 }
    }

    fn rigid_motion(&self) -> bool {
        false
    }

    fn distinct_eigenvalues(&self, chain: &Chain) -> Result<(f64, &'static str)> {
        let (anchored, _) = on_moving_actuator(chain);
        let value = separation(&eigenvalues(&anchored)?);
        let advice = "the free chain has a double zero (rigid motion; a single one with viscous \
                      friction), on which eq. (17) alone has no hold; the anchored observer does not \
                      estimate that motion but measures it, and its own eigenvalues, those of the loads \
                      on a held actuator, must be distinct";
        Ok((value, advice))
    }

    fn input(&self, mean_velocity: f64, _: f64) -> f64 {
        mean_velocity
    }

    fn estimate(&self, z: &DVector<f64>, actuator: [f64; 2]) -> (DVector<f64>, f64) {
        let n = z.len();
        let motion = DVector::from_fn(n - 1, |i, _| match i {
            0 | 1 => actuator[i],
            i if i % 2 == 0 => z[i - 2] + actuator[0],
            i => z[i - 2],
        });
        (motion, z[n - 1])
    }
}

/// Share by which poles that would stay where they are, or on one another, are moved on: a pole can
/// be placed neither where the model has one nor twice.
const APART: f64 = 0.05;

/// The poles with a decay of at least `decay`, 1/s, at their own frequencies, all distinct.
fn damped(poles: &[Complex<f64>], decay: f64) -> Vec<Complex<f64>> {
    let mut placed: Vec<Complex<f64>> = Vec::with_capacity(poles.len());
    // One of each conjugate pair; the other follows.
    for pole in poles.iter().filter(|pole| pole.im >= 0.0) {
        let own = -pole.re;
        let mut moved = Complex::new(-(own * (1.0 + APART)).max(decay), pole.im);
        let close = |a: &Complex<f64>, b: &Complex<f64>| (a - b).norm() < 0.5 * APART * decay;
        while placed.iter().chain(poles).any(|other| close(other, &moved)) {
            moved.re *= 1.0 + APART;
        }
        placed.push(moved);
        if moved.im > 0.0 {
            placed.push(moved.conj());
        }
    }
    placed
}

/// Continuous model of the anchored load: states `r_1 v_1 … q_1 q_2 d`, input `v_a`.
fn model(drive: &Drive, chain: &Chain) -> (DMatrix<f64>, DVector<f64>) {
    let loads = chain.loads();
    let n = 2 * loads + 3;
    let (q1, q2, d) = (n - 3, n - 2, n - 1);
    let mut a = DMatrix::zeros(n, n);
    let mut b = DVector::zeros(n);

    let (a_load, b_load) = on_moving_actuator(chain);
    a.view_mut((0, 0), (2 * loads, 2 * loads))
        .copy_from(&a_load);
    b.rows_mut(0, 2 * loads).copy_from(&b_load);

    // Reaction force −k_1 r_1 + c_1 (v_a − v_1), the viscous friction that is known, and d, through
    // both lags. In d it would be compensated, and the gain is that of a drive that has it.
    let (g_dist, g_reac) = (
        drive.control.disturbance_cutoff,
        drive.control.reaction_force_cutoff,
    );
    a[(q1, 0)] = -g_dist * chain.stiffness[0];
    a[(q1, 1)] = -g_dist * chain.damping[0];
    b[q1] = g_dist * (chain.damping[0] + chain.viscous);
    a[(q1, d)] = g_dist;
    a[(q1, q1)] = -g_dist;
    a[(q2, q1)] = g_reac;
    a[(q2, q2)] = -g_reac;
    (a, b)
}
