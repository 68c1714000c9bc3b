//! What most likely was the matter where a motion is none that a machine makes.

use super::plausible::span;
use crate::machine::motion::PARTS;

/// Counts per period below which missing rows do not show.
const SLOW: f64 = 4.0;

/// What most likely makes a motion jump in interval `k`, in words.
///
/// * `counts`: as they were read; `steps`: counts per interval, unwrapped; `parts`: lengths of these
pub(super) fn cause(counts: &[f64], steps: &[f64], parts: &[u32], k: usize) -> String {
    let length = |k: usize| f64::from(parts[k]) / f64::from(PARTS);
    let speed = |k: usize| steps[k] / length(k);
    let before = k.checked_sub(1).map_or(0.0, speed);
    let jump = steps[k] - before * length(k);
    if let Some(next) = steps.get(k + 1) {
        let back = next - before * length(k + 1);
        if (jump + back).abs() < 0.25 * jump.abs() {
            return "one wrong reading, as electrical noise makes it; check wiring and shielding, or take the \
                    row out"
                .into();
        }
    }
    let span = span(counts);
    // Where the counter wraps its steps are small.
    let restarts = counts
        .windows(2)
        .zip(steps)
        .filter(|(pair, step)| (pair[1] - pair[0]).abs() > 0.75 * span && step.abs() > 0.1 * span);
    if restarts.count() > 1 {
        return format!(
            "it seems to start again every {:.0} counts or so, which is no counter of 2 to 32 bits: unwrap the \
             column first",
            span + 1.0
        );
    }
    let periods = steps[k] / before;
    let whole = (1.5..50.0).contains(&periods) && (periods - periods.round()).abs() < 0.1;
    if whole && before.abs() > SLOW {
        return format!(
            "{:.0} rows seem to be missing here without their time",
            periods.round() - 1.0
        );
    }
    "counts were lost or the counter was set, electrical noise, or the counter has another width than \
     encoder.counter_bits"
        .into()
}
