//! What one move is judged by.

use crate::drive::PlantFile;
use crate::error::Result;
use crate::simulate::ending::{Extent, Motion};
use crate::simulate::metrics::{Frame, Meter, Seen, Stay, both_within, controlled};
use crate::simulate::scenario::Scenario;
use crate::simulate::{Control, Instant, Time, follow, require_no_fault};

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
    /// Makes a run and judges it while it passes.
    ///
    /// * `plant`: what is there, and the control periods by which the current comes late
    /// * `tolerance`: m
    /// * `still_after`: s
    ///
    /// # Errors
    /// [`Error::Fault`](crate::error::Error::Fault) when the drive stopped itself,
    /// [`Error::Simulation`](crate::error::Error::Simulation) when the motion or a command is no longer finite.
    pub(in super::super) fn measure(
        control: &mut dyn Control,
        plant: (&PlantFile, usize),
        scenario: &Scenario,
        time: Time,
        (tolerance, still_after): (f64, f64),
    ) -> Result<Self> {
        let frame = Frame::on(plant.0, scenario, time);
        let mut meter = FigureMeter::new(frame, tolerance, still_after);
        let look = |instant: &Instant<'_>| meter.look(&instant.seen());
        let fault = follow(control, plant, scenario, time, look)?;
        require_no_fault(scenario.name, fault)?;
        Ok(meter.figures())
    }
}

/// Figures of one move, taken while it passes.
struct FigureMeter {
    meter: Meter,
    in_tolerance: Stay,
    target: f64,
    tolerance: f64,
    resolution: f64,
    still_after: f64,
    /// Of the controlled mass from [`RESIDUAL_FROM`] on, and of that what comes after the last sample outside the band.
    late: Extent,
    in_band: Extent,
    /// Ends of the actuator's motion when it has to be still, counts.
    counts: (i64, i64),
}

impl FigureMeter {
    /// For a run.
    ///
    /// * `tolerance`: m
    /// * `still_after`: s
    fn new(frame: Frame, tolerance: f64, still_after: f64) -> Self {
        Self {
            meter: Meter::new(frame),
            in_tolerance: Stay::default(),
            target: frame.target,
            tolerance,
            resolution: frame.resolution,
            still_after,
            late: Extent::default(),
            in_band: Extent::default(),
            counts: (i64::MAX, i64::MIN),
        }
    }

    /// The next sample.
    fn look(&mut self, seen: &Seen<'_>) {
        let truth = seen.truth;
        self.meter.look(seen);
        let there = both_within(truth, self.target, self.tolerance);
        self.in_tolerance.see(seen.time, there);
        if !self.meter.in_band() {
            self.in_band = Extent::default();
        }
        if seen.time >= RESIDUAL_FROM {
            let position = truth[controlled(truth.len())];
            self.late.see(position);
            if self.meter.in_band() {
                self.in_band.see(position);
            }
        }
        if seen.time >= self.still_after {
            let count = (truth[0] / self.resolution).round() as i64;
            let (least, most) = self.counts;
            self.counts = (least.min(count), most.max(count));
        }
    }

    /// The figures, of a run that has passed without a fault.
    fn figures(&self) -> Figures {
        let metrics = self.meter.metrics(None);
        // In the last part of the run it may well leave again.
        let within = self.in_tolerance.from();
        let residual = match metrics.within_band_from {
            Some(_) => self.in_band,
            None => self.late,
        };
        let (least, most) = self.counts;
        Figures {
            settled: metrics.settling_time,
            within_band: metrics.within_band_from,
            within_tolerance: within.filter(|time| *time <= self.still_after),
            residual: residual.peak_to_peak(),
            offset: metrics.end.offset[0].abs().max(metrics.end.offset[1].abs()),
            peak_current: metrics.peak_current,
            still: most.saturating_sub(least) <= STILL,
            hunting: metrics.end.state == Motion::Hunting,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::metrics::{Metrics, formula};
    use proptest::prelude::*;

    proptest! {
        /// While the run passes: what its samples say.
        #[test]
        fn figures_are_those_of_the_run(run in formula::runs(), still_after in 0.0..1.0_f64) {
            let mut meter = FigureMeter::new(Frame::of(&run), 80e-6, still_after);
            run.samples.iter().for_each(|sample| meter.look(&sample.into()));
            let figures = meter.figures();
            let off = |k: usize, element: usize| (run.samples[k].truth[element] - 0.03).abs();
            let from = |time: f64| run.samples.iter().filter(move |sample| sample.time >= time);
            let swing = |time: f64, element: usize| {
                let each = || from(time).map(|sample| sample.truth[element]);
                (each().fold(f64::MIN, f64::max) - each().fold(f64::MAX, f64::min)).max(0.0)
            };
            let mut outside = (0..run.samples.len()).filter(|k| off(*k, 0).max(off(*k, 4)) > 80e-6);
            let there = outside.next_back().map_or(0, |last| last + 1);
            let there = run.samples.get(there).map(|sample| sample.time);
            let metrics = Metrics::new(&run);
            let in_band = metrics.within_band_from;
            let counts: Vec<f64> =
                from(still_after).map(|sample| (sample.truth[0] / 1e-6).round()).collect();
            let still = counts.iter().all(|a| counts.iter().all(|b| (a - b).abs() <= 2.0));
            prop_assert_eq!(figures, Figures {
                settled: metrics.settling_time,
                within_band: in_band,
                within_tolerance: there.filter(|time| *time <= still_after),
                residual: swing(in_band.unwrap_or(0.0).max(0.5), 4),
                offset: metrics.end.offset[0].abs().max(metrics.end.offset[1].abs()),
                peak_current: 0.0,
                still,
                hunting: metrics.end.state == Motion::Hunting,
            });
        }
    }
}
