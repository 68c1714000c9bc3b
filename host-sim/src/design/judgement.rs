//! Everything a design is judged by, together.

use super::checks::{Check, checks};
use super::margins::Margins;
use super::{Design, finite_horizon};
use crate::error::Result;
use crate::model::{eigenvalues, separation};
use nalgebra::DMatrix;
use serde::Serialize;

/// The judgement of a design.
#[derive(Clone, Debug, Serialize)]
pub struct Judgement {
    /// Whether the eigenvalues of the free chain's `A` are distinct; they never are, because its
    /// rigid motion is a double zero. The check of the same name says what that means.
    pub distinct_eigenvalues: bool,
    /// The checks.
    pub checks: Vec<Check>,
    /// Margins of the drive's loop.
    pub margins: Margins,
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

impl Judgement {
    /// Judges a design; the terminal weight of the finite horizon is zero.
    ///
    /// # Errors
    /// [`Error::Design`](crate::error::Error::Design) when something cannot be computed.
    pub fn new(design: &Design) -> Result<Self> {
        let chain = &design.chain;
        let period = design
            .modes()
            .first()
            .map_or(1.0, |mode| 1.0 / mode.frequency_hz);
        let mut times: Vec<f64> = TIMES.iter().map(|time| time * period).collect();
        times.push(CONSTANT * period);
        let terminal = DMatrix::zeros(chain.states(), chain.states());
        let mut gains = finite_horizon::gains(chain, &design.drive.cost, &terminal, &times)?;
        let constant = gains.pop().unwrap_or_else(|| design.regulator.clone());
        let finite_horizon = times.iter().zip(gains).map(|(time, gain)| HorizonGain {
            time_to_go: *time,
            distance: (&gain - &constant).norm() / constant.norm(),
            k: gain.iter().copied().collect(),
        });
        Ok(Self {
            distinct_eigenvalues: separation(&eigenvalues(&chain.a())?) > 1e-6,
            checks: checks(design)?,
            margins: Margins::of_drive(design)?,
            margins_full_state: Margins::of_full_state(design)?,
            finite_horizon: finite_horizon.collect(),
        })
    }
}
