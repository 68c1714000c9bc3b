//! The assessment of a design: checks, margins and the gain over the time to go, together.

use super::Design;
use super::checks::{
    Check, OBSERVER_SPEED, Verdict, checks, closed_loop, of_margins, what_changes_its_speed,
};
use super::drive_loop::Compensation;
use super::loop_margins::{self, LoopMargins};
use crate::chain::hamiltonian;
use crate::error::{Error, Result};
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
    /// Margins of the drive's loop while the compensation follows; none when it is not stable.
    pub margins: Option<Margins>,
    /// The same while it is held, at rest.
    pub margins_held: Option<Margins>,
    /// Margins with feedback of the true state.
    pub margins_full_state: Margins,
    /// Gain over the time to go, eq. (14); nothing where it cannot be computed.
    pub finite_horizon: Vec<HorizonGain>,
    /// Why it cannot.
    pub finite_horizon_failure: Option<String>,
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
    /// [`Error::Design`] when something cannot be computed.
    pub fn new(design: &Design) -> Result<Self> {
        let (mut checks, margins) = judged(design)?;
        let slow =
            |check: &&mut Check| check.name == OBSERVER_SPEED && check.verdict != Verdict::Pass;
        if let Some(check) = checks.iter_mut().find(slow) {
            check.advice += &what_changes_its_speed(design)?;
        }
        let (finite_horizon, failure) = match convergence(design, &TIMES) {
            Ok(gains) => (gains, None),
            Err(Error::Design(why)) => (Vec::new(), Some(why)),
            Err(other) => return Err(other),
        };
        Ok(Self {
            distinct_eigenvalues: separation(&eigenvalues(&design.chain.a())?) > 1e-6,
            checks,
            margins: margins.as_ref().map(|margins| margins.following.clone()),
            margins_held: margins.map(|margins| margins.held),
            margins_full_state: loop_margins::of_full_state(design)?,
            finite_horizon,
            finite_horizon_failure: failure,
        })
    }

    /// # Errors
    /// As [`require_sound`].
    pub fn require_sound(&self) -> Result<()> {
        refusal(&self.checks)
    }
}

/// The checks, those of the loop among them, and the margins of the drive's loop where it is stable.
pub(super) fn judged(design: &Design) -> Result<(Vec<Check>, Option<LoopMargins>)> {
    judged_by(design, loop_margins::of_drive)
}

/// The checks, the margins at a first look: what it finds wrong is wrong.
pub(super) fn at_first_look(design: &Design) -> Result<Vec<Check>> {
    Ok(judged_by(design, loop_margins::of_drive_at_first_look)?.0)
}

fn judged_by(
    design: &Design,
    margins: impl Fn(&Design, Compensation) -> Result<Margins>,
) -> Result<(Vec<Check>, Option<LoopMargins>)> {
    let mut checks = checks(design)?;
    let closed_loop = closed_loop(design)?;
    let stable = closed_loop.verdict != Verdict::Refuse;
    let margins = stable
        .then(|| LoopMargins::new(design, margins))
        .transpose()?;
    checks.push(closed_loop);
    checks.extend(
        margins
            .iter()
            .flat_map(|margins| of_margins(design, margins)),
    );
    Ok((checks, margins))
}

/// The checks of a design that may be run: what passes, and what warns.
///
/// # Errors
/// As [`require_sound`].
pub fn sound(design: &Design) -> Result<Vec<Check>> {
    let checks = judged(design)?.0;
    refusal(&checks)?;
    Ok(checks)
}

/// Whether what is seen at a first look forbids to run a design.
///
/// # Errors
/// As [`require_sound`].
pub fn require_sound_at_first_look(design: &Design) -> Result<()> {
    refusal(&at_first_look(design)?)
}

/// Whether a design may be run at all.
///
/// # Errors
/// [`Error::Design`] with the sentence of the first check that refuses it.
pub fn require_sound(design: &Design) -> Result<()> {
    sound(design).map(drop)
}

fn refusal(checks: &[Check]) -> Result<()> {
    let Some(check) = checks.iter().find(|check| check.verdict == Verdict::Refuse) else {
        return Ok(());
    };
    let figure = check.value.map_or(String::new(), |value| {
        format!(" ({value:.4e}, limit {:.4e})", check.limit)
    });
    Err(Error::Design(format!(
        "the check {} refuses it{figure}: {}",
        check.name, check.advice
    )))
}

/// Gain over the time to go with the drive file's terminal weight.
///
/// * `times`: times to go in periods of the slowest mode, rising
///
/// # Errors
/// [`Error::Design`] when a step cannot be solved.
pub fn convergence(design: &Design, times: &[f64]) -> Result<Vec<HorizonGain>> {
    let Some(index) = &design.index else {
        let why = "[gain] states the constant gain itself, and no performance index whose gain changes with the time to go";
        return Err(Error::Design(why.into()));
    };
    let slowest = design.modes().first().map_or(1.0, |mode| mode.frequency_hz);
    let with_constant = times.iter().chain([&CONSTANT]);
    let times: Vec<f64> = with_constant.map(|time| time / slowest).collect();
    let terminal = &design.drive.cost.terminal;
    let terminal = DMatrix::from_diagonal(&DVector::from_column_slice(terminal));
    let weights = (&index.state_weights()[..], index.current);
    let mut gains = hamiltonian::gains(&design.chain, weights, &terminal, &times)?;
    let constant = gains.pop().unwrap_or_else(|| design.regulator.clone());
    if constant.norm() == 0.0 {
        let why = "the gain that K(t) tends to is zero";
        return Err(Error::Design(why.into()));
    }
    let horizon = times.iter().zip(gains).map(|(time, gain)| HorizonGain {
        time_to_go: *time,
        distance: (&gain - &constant).norm() / constant.norm(),
        k: gain.iter().copied().collect(),
    });
    Ok(horizon.collect())
}
