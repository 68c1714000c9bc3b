//! What one move is judged by.

use crate::error::{Error, Result};
use crate::simulate::Run;
use crate::simulate::ending::Motion;
use crate::simulate::metrics::{Metrics, controlled};

/// From when on the vibration is residual, s, or from the time the band is kept if that is later.
const RESIDUAL_FROM: f64 = 0.5;
/// Counts between the ends of an actuator's motion that is still: one each way.
const STILL: i64 = 2;

/// Figures of one move, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Settling time of the controlled mass to 2 %, s; none when it does not settle, or still moves at the end.
    pub settled: Option<f64>,
    /// The same whatever moves at the end, s.
    pub within_band: Option<f64>,
    /// After which actuator and controlled mass stay within the tolerance, s.
    pub within_tolerance: Option<f64>,
    /// Peak-to-peak motion of the controlled mass after arrival, m.
    pub residual: f64,
    /// Distance of actuator or controlled mass from the target at the end, the larger, m.
    pub offset: f64,
    /// Largest current, A.
    pub peak_current: f64,
    /// Whether the actuator moves by no more than a count each way from a time on.
    pub still: bool,
    /// Whether it goes on moving, by more than what counts as rest.
    pub hunting: bool,
}

impl Figures {
    /// Judges a run.
    ///
    /// * `tolerance`: m
    /// * `still_after`: s
    ///
    /// # Errors
    /// [`Error::Fault`] when the drive stopped itself.
    pub fn new(run: &Run, tolerance: f64, still_after: f64) -> Result<Self> {
        if let Some((time, fault)) = run.fault {
            return Err(Error::Fault {
                experiment: run.scenario.name,
                time,
                number: fault.number(),
                fault: format!("{fault:?}"),
            });
        }
        let metrics = Metrics::new(run);
        let (samples, target) = (&run.samples, run.scenario.target);
        let elements = [0, controlled(run)];
        let outside = samples.iter().rposition(|sample| {
            // Written so that what is no number is outside.
            let within = |element: usize| (sample.truth[element] - target).abs() <= tolerance;
            !elements.into_iter().all(within)
        });
        let within = samples.get(outside.map_or(0, |last| last + 1));
        // In the last part of the run it may well leave again.
        let within = within.filter(|sample| sample.time <= still_after);
        let from = |time: f64| &samples[samples.partition_point(|sample| sample.time < time)..];
        let residual_from = metrics.within_band_from.unwrap_or(0.0).max(RESIDUAL_FROM);
        let positions = from(residual_from).iter().map(|s| s.truth[elements[1]]);
        let (low, high) = positions.fold((f64::MAX, f64::MIN), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        let counts = from(still_after).iter();
        let counts = counts.map(|s| (s.truth[0] / run.resolution).round() as i64);
        let (least, most) = counts.fold((i64::MAX, i64::MIN), |(least, most), count| {
            (least.min(count), most.max(count))
        });
        Ok(Self {
            settled: metrics.settling_time,
            within_band: metrics.within_band_from,
            within_tolerance: within.map(|sample| sample.time),
            residual: (high - low).max(0.0),
            offset: metrics.end.offset[0].abs().max(metrics.end.offset[1].abs()),
            peak_current: metrics.peak_current,
            still: most.saturating_sub(least) <= STILL,
            hunting: metrics.end.state == Motion::Hunting,
        })
    }
}
