//! The assessment of a design: checks, margins and the gain over the time to go, together.

use super::checks::{Check, Verdict, checks, closed_loop, peak_sensitivity};
use super::{Design, loop_margins};
use crate::chain::hamiltonian;
use crate::error::Result;
use crate::linear::eigen::{eigenvalues, separation};
use crate::linear::margins::Margins;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// What is to be said of a design.
#[derive(Clone, Debug, Serialize)]
pub struct Assessment {
    /// Whether the eigenvalues of the free chain's `A` are distinct. Without viscous friction they
    /// never are: its rigid motion is a double zero. The check of the same name says what that means.
    pub distinct_eigenvalues: bool,
    /// The checks.
    pub checks: Vec<Check>,
    /// Margins of the drive's loop; none when it is not stable.
    pub margins: Option<Margins>,
    /// Margins with feedback of the true state.
    pub margins_full_state: Margins,
    /// Gain over the time to go, eq. (14).
    pub finite_horizon: Vec<HorizonGain>,
}

/// Gain with a time to go.
#[derive(Clone, Debug, Serialize)]
pub struct HorizonGain {
    /// s.
    pub time_to_go: f64,
    /// `K`, A/m and A s/m.
    pub k: Vec<f64>,
    /// Distance from the constant gain of the continuous problem, relative to that gain.
    pub distance: f64,
}

/// Times to go, in periods of the slowest mode, and the horizon that stands for the constant gain.
const TIMES: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
const CONSTANT: f64 = 60.0;

impl Assessment {
    /// Assesses a design.
    ///
    /// # Errors
    /// [`Error::Design`](crate::error::Error::Design) when something cannot be computed.
    pub fn new(design: &Design) -> Result<Self> {
        let mut checks = checks(design)?;
        let closed_loop = closed_loop(design)?;
        let stable = closed_loop.verdict != Verdict::Refuse;
        let margins = stable.then(|| loop_margins::of_drive(design)).transpose()?;
        checks.push(closed_loop);
        checks.extend(margins.as_ref().map(peak_sensitivity));
        Ok(Self {
            distinct_eigenvalues: separation(&eigenvalues(&design.chain.a())?) > 1e-6,
            checks,
            margins,
            margins_full_state: loop_margins::of_full_state(design)?,
            finite_horizon: convergence(design, &TIMES)?,
        })
    }
}

/// Gain over the time to go with the drive file's terminal weight.
///
/// * `times`: times to go in periods of the slowest mode, rising
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when a step cannot be solved.
pub fn convergence(design: &Design, times: &[f64]) -> Result<Vec<HorizonGain>> {
    let slowest = design.modes().first().map_or(1.0, |mode| mode.frequency_hz);
    let with_constant = times.iter().chain([&CONSTANT]);
    let times: Vec<f64> = with_constant.map(|time| time / slowest).collect();
    let terminal = &design.drive.cost.terminal;
    let terminal = DMatrix::from_diagonal(&DVector::from_column_slice(terminal));
    let weights = (&design.index.state_weights()[..], design.index.current);
    let mut gains = hamiltonian::gains(&design.chain, weights, &terminal, &times)?;
    let constant = gains.pop().unwrap_or_else(|| design.regulator.clone());
    let horizon = times.iter().zip(gains).map(|(time, gain)| HorizonGain {
        time_to_go: *time,
        distance: (&gain - &constant).norm() / constant.norm(),
        k: gain.iter().copied().collect(),
    });
    Ok(horizon.collect())
}
