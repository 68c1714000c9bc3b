//! The drive's own loop: whether it is stable, and how far from the brink.

use super::{Check, Design, Verdict, verdict, weaker};
use crate::design::drive_loop::{Compensation, DriveLoop};
use crate::design::loop_margins::LoopMargins;
use crate::error::Result;
use crate::linear::eigen::spectral_radius;
use crate::linear::margins::Margins;

/// Largest pole of the drive's own loop, plant, force observers, state observer and gain together, while the
/// compensation follows and while it is held.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when the eigenvalue iteration does not converge.
pub(in crate::design) fn closed_loop(design: &Design) -> Result<Check> {
    let mut value = 0.0_f64;
    let (ad, bd) = design.sampled(&design.chain);
    for compensation in [Compensation::Follows, Compensation::Held] {
        let closed = DriveLoop::new(design, compensation).closed(&ad, &bd);
        value = value.max(spectral_radius(&closed)?);
    }
    // Of eq. (17) alone the rigid motion stays in the estimate, a double one that rounding splits.
    let limit = if design.observer_variant().rigid_motion() {
        1.0 + 1e-4
    } else {
        1.0
    };
    Ok(Check::new(
        "closed_loop",
        if value < limit {
            Verdict::Pass
        } else {
            Verdict::Refuse
        },
        (value, limit),
        format!(
            "largest pole of the drive's own loop, with its observers, moving or held at rest; from 1 on it is not \
             stable: higher control.disturbance_cutoff and control.reaction_force_cutoff, {} or a shorter \
             control.sample_time",
            weaker(design)
        ),
    ))
}

/// Where a peak of the sensitivity is a warning, and where the drive is refused: with 4 a quarter of the
/// loop's gain missing in one place or another brings it to the brink, and springs, loads and force
/// constants are known no better than that.
const PEAK: f64 = 2.0;
const WORST_PEAK: f64 = 4.0;
/// The same for the phase margin, degrees: 30 is what a peak of 2 leaves, below 15 a lag of one sample or
/// a spring that is a third softer may take all of it.
const PHASE: f64 = 30.0;
const WORST_PHASE: f64 = 15.0;

/// How far the loop stays from the brink over all frequencies.
fn peak_sensitivity(margins: &Margins, weaker: &str) -> Check {
    let value = margins.peak_sensitivity;
    Check::new(
        "peak_sensitivity",
        // The smaller the better.
        verdict(1.0 / value, 1.0 / PEAK, 1.0 / WORST_PEAK),
        (value, PEAK),
        format!(
            "at {:.1} Hz the loop makes a disturbance this many times larger; below {PEAK} the margins are \
             6 dB and 29 degrees at least, above {WORST_PEAK} they are no more than a machine differs from \
             its description, and it is refused: higher cutoffs, {weaker}, or other observer settings",
            margins.peak_sensitivity_hz
        ),
    )
}

/// How much phase the loop may lose where its gain is one.
fn phase_margin(value: f64, weaker: &str) -> Check {
    Check::new(
        "phase_margin",
        verdict(value, PHASE, WORST_PHASE),
        (value, PHASE),
        format!(
            "degrees that the loop may lose where its gain is one; below {WORST_PHASE} a little more delay or \
             a softer spring takes all of them, and it is refused: higher cutoffs, {weaker} or a shorter \
             control.sample_time"
        ),
    )
}

/// The checks of a stable loop's margins, the worse of both.
pub(in crate::design) fn of_margins(
    design: &Design,
    margins: &LoopMargins,
) -> impl Iterator<Item = Check> + use<> {
    let LoopMargins { following, held } = margins;
    // What is no number is the worst.
    let worst = if held.peak_sensitivity <= following.peak_sensitivity {
        following
    } else {
        held
    };
    let phases = [following, held].map(|margins| margins.phase_margin_deg);
    let phase = phases.into_iter().flatten().reduce(f64::min);
    let weaker = weaker(design);
    let phase = phase.map(|phase| phase_margin(phase, weaker));
    [Some(peak_sensitivity(worst, weaker)), phase]
        .into_iter()
        .flatten()
}
