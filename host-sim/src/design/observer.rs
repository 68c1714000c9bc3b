//! Gain of the action-reaction state observer, eq. (17): steady-state Kalman filter or placed poles.
//!
//! `Variant` is what design and analysis ask of one; the variants are those of the core, a file each.
//!
//! The Kalman weights are ratios to the density of the measurement noise of `f_reac_hat`, so they mean
//! the same for every sample time and every size of drive.

mod anchored;
mod reaction;

use crate::chain::Chain;
use crate::drive::{Drive, Observer};
use crate::error::Result;
use crate::linear::dlqe::dlqe;
use nalgebra::{DMatrix, DVector, RowDVector};

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

/// What design and analysis must know of a variant of the state observer.
pub(crate) trait Variant {
    /// Designs it.
    ///
    /// * `regulator_decay`: of the regulator's slowest pole, 1/s
    ///
    /// # Errors
    /// [`Error::Design`](crate::error::Error::Design) when the Riccati equation has no solution or the
    /// observer is not stable.
    fn design(&self, drive: &Drive, chain: &Chain, regulator_decay: f64) -> Result<ObserverDesign>;

    /// The continuous model that it is built on, as far as it can be observed at all.
    fn model(&self, drive: &Drive, chain: &Chain) -> Model;

    /// Whether it estimates the rigid motion of the free chain, which makes no reaction force.
    fn rigid_motion(&self) -> bool;

    /// Smallest distance between two eigenvalues of the matrix that it is built on, relative to the largest
    /// of them, and what that means.
    ///
    /// # Errors
    /// When an eigenvalue iteration does not converge.
    fn distinct_eigenvalues(&self, chain: &Chain) -> Result<(f64, &'static str)>;

    /// Its input over a period, from the actuator's mean velocity and the current.
    fn input(&self, mean_velocity: f64, current: f64) -> f64;

    /// The motion `x_a v_a x_1 v_1 …` that it makes of its states `z` and of the actuator's measured
    /// position and velocity, and the disturbance on the actuator, N.
    fn estimate(&self, z: &DVector<f64>, actuator: [f64; 2]) -> (DVector<f64>, f64);
}

/// A continuous model and its output.
pub(crate) struct Model {
    /// System matrix.
    pub(crate) a: DMatrix<f64>,
    /// Output row, N.
    pub(crate) c: RowDVector<f64>,
    /// How many of its states, the last ones, are forces; the others are positions and velocities.
    pub(crate) forces: usize,
}

/// The variant of that name.
#[must_use]
pub(crate) fn variant(observer: Observer) -> &'static dyn Variant {
    match observer {
        Observer::Anchored => &anchored::Anchored,
        Observer::Reaction => &reaction::Reaction,
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
