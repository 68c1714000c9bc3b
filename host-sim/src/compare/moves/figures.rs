//! What one move is judged by.

use crate::error::Result;
use crate::simulate::Run;
use crate::simulate::ending::{Motion, peak_to_peak};
use crate::simulate::metrics::{Metrics, controlled, within_from};

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
    /// [`Error::Fault`](crate::error::Error::Fault) when the drive stopped itself.
    pub fn new(run: &Run, tolerance: f64, still_after: f64) -> Result<Self> {
        run.require_no_fault()?;
        let metrics = Metrics::new(run);
        let samples = &run.samples;
        // In the last part of the run it may well leave again.
        let within = within_from(run, tolerance).filter(|time| *time <= still_after);
        let from = |time: f64| &samples[samples.partition_point(|sample| sample.time < time)..];
        let residual_from = metrics.within_band_from.unwrap_or(0.0).max(RESIDUAL_FROM);
        let counts = from(still_after).iter();
        let counts = counts.map(|s| (s.truth[0] / run.resolution).round() as i64);
        let (least, most) = counts.fold((i64::MAX, i64::MIN), |(least, most), count| {
            (least.min(count), most.max(count))
        });
        Ok(Self {
            settled: metrics.settling_time,
            within_band: metrics.within_band_from,
            within_tolerance: within,
            residual: peak_to_peak(from(residual_from), controlled(run)),
            offset: metrics.end.offset[0].abs().max(metrics.end.offset[1].abs()),
            peak_current: metrics.peak_current,
            still: most.saturating_sub(least) <= STILL,
            hunting: metrics.end.state == Motion::Hunting,
        })
    }
}
