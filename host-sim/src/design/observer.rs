//! Gain of the action-reaction state observer, eq. (17): steady-state Kalman filter or placed poles.
//!
//! *Anchored* (default): states `r_1 v_1 … r_n v_n q_1 q_2 d` relative to the actuator; the
//! input is the actuator's mean velocity, the lags of both force observers are part of the
//! model, `d` is a random walk. *Reaction* (eq. (17) as printed): the free chain. Its centre of
//! mass is unobservable, so the gain is designed for the motion relative to it and leaves the
//! centre of mass alone.
//!
//! The Kalman weights are ratios to the density of the measurement noise of `f_reac_hat`, so they mean
//! the same for every sample time and every size of drive. Placed poles keep the frequency that the
//! load has by itself and are only damped: each decays `speed` times as fast as the slowest pole of
//! the regulator, or as it does anyway where that is faster ("at least twice faster than the control
//! system"). To move frequencies as well would cost gain and buy nothing.
//!
//! Without the disturbance state its row of the transition is zero, so that it stays zero.

use super::require_stable;
use crate::chain::Chain;
use crate::chain::load::{on_moving_actuator, relative_motion};
use crate::drive::{Drive, ObserverMethod};
use crate::error::{Error, Result};
use crate::linear::dlqe::dlqe;
use crate::linear::eigen::{eigenvalues, spectral_radius};
use crate::linear::place::place;
use crate::linear::zoh::zero_order_hold;
use arso_core::observer::Form;
use nalgebra::{Complex, DMatrix, DVector, RowDVector};

/// A discrete observer `z⁺ = F z + g u`, then `z += L (f − c z)`.
#[derive(Clone, Debug)]
pub struct ObserverDesign {
    /// `F`.
    pub transition: DMatrix<f64>,
    /// `g`, per m/s (anchored) or per A (reaction).
    pub input: DVector<f64>,
    /// `c`.
    pub output: RowDVector<f64>,
    /// `L`.
    pub correction: DVector<f64>,
}

impl ObserverDesign {
    /// Transition of the estimation error, `(1 − L c) F`.
    #[must_use]
    pub fn error_transition(&self) -> DMatrix<f64> {
        let n = self.input.len();
        (DMatrix::identity(n, n) - &self.correction * &self.output) * &self.transition
    }
}

/// Designs the observer that the drive asks for.
///
/// * `regulator_decay`: of the regulator's slowest pole, 1/s
///
/// # Errors
/// [`Error::Design`] when the Riccati equation has no solution or
/// the observer is not stable.
pub fn design(drive: &Drive, chain: &Chain, regulator_decay: f64) -> Result<ObserverDesign> {
    match drive.control.observer {
        Form::Anchored => anchored(drive, chain, regulator_decay),
        Form::Reaction => reaction(drive, chain),
    }
}

/// Steady-state Kalman gain where the measurement noise has a density of one.
///
/// * `noise`: continuous process noise covariance density over that of the measurement, n x n
pub(crate) fn kalman(
    a: &DMatrix<f64>,
    transition: &DMatrix<f64>,
    output: &RowDVector<f64>,
    noise: &DMatrix<f64>,
    sample_time: f64,
) -> Result<DVector<f64>> {
    // A density of one, averaged over the period.
    let measurement = 1.0 / sample_time;
    Ok(dlqe(
        a,
        transition,
        output,
        noise,
        measurement,
        sample_time,
    )?)
}

fn anchored(drive: &Drive, chain: &Chain, regulator_decay: f64) -> Result<ObserverDesign> {
    let sample_time = drive.control.sample_time;
    let settings = &drive.observer;
    let (a, b) = anchored_model(drive, chain);
    let n = b.len();
    let (mut transition, input) = zero_order_hold(&a, &b, sample_time);
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
pub(super) fn anchored_model(drive: &Drive, chain: &Chain) -> (DMatrix<f64>, DVector<f64>) {
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

fn reaction(drive: &Drive, chain: &Chain) -> Result<ObserverDesign> {
    let sample_time = drive.control.sample_time;
    let loads = chain.loads();
    let a = chain.a();
    let (transition, input) = zero_order_hold(&a, &chain.b(), sample_time);

    let (relative, lift) = relative_motion(chain);
    let a_relative = &relative * &a * &lift;
    let output_relative = chain.reaction_force() * &lift;
    let transition_relative = &relative * &transition * &lift;

    let n = 2 * loads;
    // Random forces on every mass, seen in the relative velocities.
    let mut noise = DMatrix::zeros(n, n);
    for mass in 0..=loads {
        let force = &relative * chain.force_input(mass) * drive.observer.load_force_ratio;
        noise += &force * force.transpose();
    }
    let gain = kalman(
        &a_relative,
        &transition_relative,
        &output_relative,
        &noise,
        sample_time,
    )?;
    let error = (DMatrix::identity(n, n) - &gain * &output_relative) * &transition_relative;
    require_stable("the observer", &error)?;
    let observer = ObserverDesign {
        transition,
        input,
        output: chain.reaction_force(),
        correction: lift * gain,
    };
    // With friction in the model the relative motion is not all; nothing may grow but what rounding
    // makes of the rigid motion's double one.
    let radius = spectral_radius(&observer.error_transition())?;
    if radius > 1.0 + 1e-5 {
        return Err(Error::Design(format!(
            "the observer is not stable (largest pole {radius:.6})"
        )));
    }
    Ok(observer)
}
