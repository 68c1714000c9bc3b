//! What a run is judged by.

use super::corridor::Found;
use super::ending::{Ending, EndingMeter, Extent, Motion};
use crate::chain::controlled_mass;
use crate::design::settling_tolerance;
use crate::drive::{MAX_LOADS, PlantFile, SETTLING_BAND};
use crate::simulate::scenario::Scenario;
use crate::simulate::{Run, Sample, Time};
use arso_core::Fault;
use serde::Serialize;

/// Most masses of a chain.
const MASSES: usize = MAX_LOADS + 1;

/// A mass that enters the band in the last part of the run, this share of it, may well leave it again
/// and does not count as settled.
pub const HELD: f64 = 0.1;

/// Residual vibration is measured from this share of the run on, or from the settling time if that is
/// later.
pub const RESIDUAL_FROM: f64 = 5.0 / 12.0;

/// Figures of one run, SI units.
#[derive(Clone, Debug, Serialize)]
pub struct Metrics {
    /// Time after which the controlled mass stays within 2 % of the span, s; none when it does
    /// not settle within the run, or when it or the actuator still moves at its end.
    pub settling_time: Option<f64>,
    /// The same whatever moves at the end, s.
    pub within_band_from: Option<f64>,
    /// How far from the target counts as there, m.
    pub settling_tolerance: f64,
    /// Time after which controlled mass and actuator both stay within that, s; none when they do not within the
    /// run, or not for good.
    pub within_tolerance_from: Option<f64>,
    /// Where actuator and controlled mass are at the end, and how they move there.
    pub end: Ending,
    /// Farthest excursion of the controlled mass beyond the target, % of the span.
    pub overshoot: f64,
    /// Peak-to-peak motion of each mass after settling, actuator first, m.
    pub residual_vibration: Option<Vec<f64>>,
    /// Mean distance of the controlled mass from the target over the same time, m.
    pub offset: Option<f64>,
    /// Largest magnitude of the commanded current, A.
    pub peak_current: f64,
    /// Root mean square of estimate minus truth over the whole run for each mass, actuator
    /// first, m; none without an observer.
    pub estimation_error: Option<Vec<f64>>,
    /// Number of the fault that stopped the drive.
    pub fault: Option<u8>,
    /// When it did, s.
    pub fault_time: Option<f64>,
}

/// What a meter is told of a run before it begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    /// Where it is sent, m.
    pub(crate) target: f64,
    /// What the plant's encoder can tell apart, m.
    pub(crate) resolution: f64,
    /// How far from the target counts as there, m.
    pub(crate) settling_tolerance: f64,
    /// How many control periods it has.
    pub(crate) periods: usize,
    /// Start of the last one, s.
    pub(crate) last: f64,
}

impl Frame {
    /// Of an experiment on a plant under any law; its tolerance is that of a drive which states none.
    pub(crate) fn on(plant: &PlantFile, scenario: &Scenario, time: Time) -> Self {
        let resolution = plant.encoder.resolution;
        Self {
            target: scenario.target,
            resolution,
            settling_tolerance: settling_tolerance(resolution),
            periods: time.periods,
            last: time.last(),
        }
    }

    /// The same, held against another tolerance, m.
    pub(crate) fn with_tolerance(self, settling_tolerance: f64) -> Self {
        Self {
            settling_tolerance,
            ..self
        }
    }

    /// So many periods of it.
    pub(crate) fn of_periods(self, time: Time) -> Self {
        Self {
            periods: time.periods,
            last: time.last(),
            ..self
        }
    }

    /// Of a run that was kept.
    pub(crate) fn of(run: &Run) -> Self {
        Self {
            target: run.scenario.target,
            resolution: run.resolution,
            settling_tolerance: run.settling_tolerance,
            periods: run.samples.len(),
            last: run.samples.last().map_or(0.0, |sample| sample.time),
        }
    }

    /// Whether a run may still leave again what it is inside from a sample on: when that comes in its last part.
    fn holds(&self, from: usize) -> bool {
        (self.periods - from) as f64 >= HELD * self.periods as f64
    }
}

/// One control period, as much of it as figures are made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen<'s> {
    /// Start, s.
    pub(crate) time: f64,
    /// True state `x_a v_a x_1 v_1 …`, m and m/s.
    pub(crate) truth: &'s [f64],
    /// Current commanded, A.
    pub(crate) command: f64,
    /// What the core found.
    pub(crate) found: Option<Found<'s>>,
}

impl<'s> From<&'s Sample> for Seen<'s> {
    fn from(sample: &'s Sample) -> Self {
        Self {
            time: sample.time,
            truth: sample.truth.as_slice(),
            command: sample.command,
            found: sample.record.as_ref().map(Found::of),
        }
    }
}

/// Element of the state that is the controlled mass's position, of a state of so many.
pub(crate) fn controlled(states: usize) -> usize {
    2 * controlled_mass((states / 2).saturating_sub(1))
}

/// From which sample on every one is inside.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stay {
    samples: usize,
    /// Number of that sample, and its time, s.
    since: Option<(usize, f64)>,
}

impl Stay {
    /// One sample.
    #[inline]
    pub(crate) fn see(&mut self, time: f64, inside: bool) {
        if !inside {
            self.since = None;
        } else if self.since.is_none() {
            self.since = Some((self.samples, time));
        }
        self.samples += 1;
    }

    /// The time of that sample, s.
    pub(crate) fn from(&self) -> Option<f64> {
        Some(self.since?.1)
    }

    /// The same; none when it is only so at the end of the run.
    pub(crate) fn held(&self, frame: &Frame) -> Option<f64> {
        let (from, time) = self.since?;
        frame.holds(from).then_some(time)
    }
}

/// Time after which controlled mass and actuator stay within a distance of the target, s; none when they do not
/// within the run, or only at its end.
///
/// * `tolerance`: m
#[must_use]
pub fn within(run: &Run, tolerance: f64) -> Option<f64> {
    let mut stay = Stay::default();
    for sample in &run.samples {
        let inside = both_within(sample.truth.as_slice(), run.scenario.target, tolerance);
        stay.see(sample.time, inside);
    }
    stay.held(&Frame::of(run))
}

/// Whether actuator and controlled mass are within a tolerance of the target, m.
pub(crate) fn both_within(truth: &[f64], target: f64, tolerance: f64) -> bool {
    // Written so that what is no number is outside.
    let inside = |x: f64| (x - target).abs() <= tolerance;
    inside(truth[0]) && inside(truth[controlled(truth.len())])
}

/// Figures of a run, taken while it passes, in a memory of fixed size.
///
/// What is measured from the time on at which the controlled mass is inside its band for good begins anew with
/// every sample outside: nobody has to know that time before.
#[derive(Clone, Debug)]
pub(crate) struct Meter {
    frame: Frame,
    /// Number of the sample from which on vibration may be residual.
    late: usize,
    samples: usize,
    masses: usize,
    /// Element of the controlled mass's position.
    controlled: usize,
    /// From start to target, m, and half width of the band.
    span: f64,
    band: f64,
    in_band: Stay,
    in_tolerance: Stay,
    ending: EndingMeter,
    /// Ends of the controlled mass's way from the target, m.
    way: Extent,
    /// Of each mass in the window of the residual vibration; samples in it, and sum of distances from the target, m.
    residual: [Extent; MASSES],
    window: usize,
    offsets: f64,
    /// A.
    peak_current: f64,
    /// Sums of squares of estimate minus truth, m².
    errors: [f64; MASSES],
    observed: bool,
}

impl Meter {
    /// For a run.
    pub(crate) fn new(frame: Frame) -> Self {
        Self {
            frame,
            late: (RESIDUAL_FROM * frame.periods as f64).round() as usize,
            samples: 0,
            masses: 0,
            controlled: 0,
            span: frame.target,
            band: 0.0,
            in_band: Stay::default(),
            in_tolerance: Stay::default(),
            ending: EndingMeter::new(&frame),
            way: Extent::default(),
            residual: [Extent::default(); MASSES],
            window: 0,
            offsets: 0.0,
            peak_current: 0.0,
            errors: [0.0; MASSES],
            observed: false,
        }
    }

    /// The next sample.
    ///
    /// # Panics
    /// For a chain of more loads than a drive can have.
    #[inline]
    pub(crate) fn look(&mut self, seen: &Seen<'_>) {
        let truth = seen.truth;
        if self.samples == 0 {
            self.masses = truth.len() / 2;
            self.controlled = controlled(truth.len());
            self.span = self.frame.target - truth[self.controlled];
            self.band = SETTLING_BAND * self.span.abs();
        }
        let off = truth[self.controlled] - self.frame.target;
        self.way.see(off);
        // Written so that what is no number is outside.
        let inside = off.abs() <= self.band;
        self.in_band.see(seen.time, inside);
        let tolerance = self.frame.settling_tolerance;
        let there = off.abs() <= tolerance && (truth[0] - self.frame.target).abs() <= tolerance;
        self.in_tolerance.see(seen.time, there);
        self.ending
            .see(seen.time, [truth[0], truth[self.controlled]]);
        if !inside {
            self.clear_window();
        } else if self.samples >= self.late {
            for (extent, position) in self.residual.iter_mut().zip(truth.iter().step_by(2)) {
                extent.see(*position);
            }
            self.window += 1;
            self.offsets += off;
        }
        let current = seen.command.abs();
        if current > self.peak_current {
            self.peak_current = current;
        }
        if let Some(found) = &seen.found {
            self.observed = true;
            let truth = truth.iter().step_by(2);
            for ((sum, estimate), truth) in self.errors.iter_mut().zip(found.positions()).zip(truth)
            {
                *sum += (estimate - truth).powi(2);
            }
        }
        self.samples += 1;
    }

    fn clear_window(&mut self) {
        if self.window > 0 {
            self.residual = [Extent::default(); MASSES];
            (self.window, self.offsets) = (0, 0.0);
        }
    }

    /// Whether the controlled mass is inside its band now.
    pub(crate) fn in_band(&self) -> bool {
        self.in_band.from().is_some()
    }

    /// The figures, of a run that has passed.
    ///
    /// * `fault`: that stopped the drive, and when, s
    pub(crate) fn metrics(&self, fault: Option<(f64, Fault)>) -> Metrics {
        let within_band_from = self.in_band.held(&self.frame);
        let within_tolerance_from = self.in_tolerance.held(&self.frame);
        let window = within_band_from.filter(|_| self.window > 0);
        // Both ends, so that it does not matter to which side the target lies.
        let ends = [self.way.low, self.way.high];
        let beyond = ends.map(|off| {
            if self.samples == 0 {
                0.0
            } else {
                off / self.span
            }
        });
        let samples = self.samples as f64;
        let residual = &self.residual[..self.masses];
        let end = self.ending.ending();
        Metrics {
            settling_time: within_band_from,
            within_band_from,
            settling_tolerance: self.frame.settling_tolerance,
            within_tolerance_from,
            end: end.clone(),
            overshoot: 100.0 * beyond.into_iter().fold(0.0, f64::max),
            residual_vibration: window.map(|_| residual.iter().map(Extent::peak_to_peak).collect()),
            offset: window.map(|_| self.offsets / self.window as f64),
            peak_current: self.peak_current,
            estimation_error: self.observed.then(|| {
                let sums = self.errors[..self.masses].iter();
                sums.map(|sum| (sum / samples).sqrt()).collect()
            }),
            fault: fault.map(|(_, fault)| fault.number()),
            fault_time: fault.map(|(time, _)| time),
        }
        .with_end(&end, within_tolerance_from)
    }
}

impl Metrics {
    /// Judges a run.
    #[must_use]
    pub fn new(run: &Run) -> Self {
        let mut meter = Meter::new(Frame::of(run));
        for sample in &run.samples {
            meter.look(&sample.into());
        }
        meter.metrics(run.fault)
    }

    /// The same run whose motion at the end is known better: settled is what is also at rest there. Where it
    /// stands at the end of the experiment stays what it was.
    ///
    /// * `watched`: from when on all stays within the tolerance, what came after the experiment included, s
    #[must_use]
    pub(super) fn with_end(self, end: &Ending, watched: Option<f64>) -> Self {
        let within = self.within_tolerance_from;
        let rests = end.state == Motion::Rest;
        Self {
            settling_time: self.within_band_from.filter(|_| rests),
            within_tolerance_from: within.filter(|_| within == watched),
            end: Ending {
                offset: self.end.offset,
                ..end.clone()
            },
            ..self
        }
    }
}

/// Runs by a formula, for tests.
#[cfg(test)]
pub(crate) mod formula {
    use super::*;
    use crate::simulate::Law;
    use nalgebra::DVector;
    use proptest::prelude::*;

    /// A run of the paper's first step in periods of 1 ms: actuator and controlled mass of a chain of three loads by
    /// a formula of time, in m and s.
    pub(crate) fn run(periods: usize, motion: impl Fn(f64) -> [f64; 2]) -> Run {
        let samples = (0..periods).map(|k| {
            let time = k as f64 * 1e-3;
            let mut truth = DVector::zeros(8);
            [truth[0], truth[4]] = motion(time);
            Sample {
                time,
                count: 0,
                truth,
                true_reaction_force: 0.0,
                reference: 0.03,
                applied_current: 0.0,
                command: 0.0,
                limited: false,
                record: None,
            }
        });
        Run {
            kind: crate::machine::Kind::Linear,
            resolution: 1e-6,
            settling_tolerance: 50e-6,
            scenario: *Scenario::named("fig3").unwrap(),
            law: Law::FullState,
            samples: samples.collect(),
            fault: None,
        }
    }

    /// Runs whose masses swing around a place beside the target, at rates at which they settle soon, late or not at
    /// all, over a hum that may be rest, hunting, or more than any band.
    pub(crate) fn runs() -> impl Strategy<Value = Run> {
        let hum = prop_oneof![Just(0.0), 1e-6..2e-3_f64];
        let aside = prop_oneof![Just(0.0), -2e-3..2e-3_f64];
        (50..1500_usize, 1.0..60.0_f64, 5.0..100.0_f64, hum, aside).prop_map(
            |(periods, rate, omega, hum, aside)| {
                let swing = move |time: f64, rate: f64| {
                    let left = (-rate * time).exp() * (omega * time).cos();
                    0.03 + (aside - 0.03) * left + aside * (1.0 - left) + hum * (70.0 * time).sin()
                };
                run(periods, |time| [swing(time, 2.0 * rate), swing(time, rate)])
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Law;
    use crate::simulate::scenario::Scenario;
    use nalgebra::DVector;

    /// A decaying oscillation of mass 2 around 30 mm, whose figures follow from its formula.
    #[test]
    fn figures_of_a_known_motion() {
        let x2 = |t: f64| 0.03 * (1.0 - (-20.0 * t).exp() * (100.0 * t).cos());
        let samples = (0..1200).map(|k| {
            let time = f64::from(k) * 1e-3;
            let mut truth = DVector::zeros(8);
            truth[4] = x2(time);
            truth[6] = 1e-5 * (200.0 * time).sin();
            Sample {
                time,
                count: 0,
                truth,
                true_reaction_force: 0.0,
                reference: 0.03,
                applied_current: 0.0,
                command: if k == 7 { -1.5 } else { 0.5 },
                limited: false,
                record: None,
            }
        });
        let run = Run {
            kind: crate::machine::Kind::Linear,
            resolution: 1e-6,
            settling_tolerance: 50e-6,
            scenario: *Scenario::named("fig3").unwrap(),
            law: Law::FullState,
            samples: samples.collect(),
            fault: None,
        };
        let metrics = Metrics::new(&run);
        // Swings peak every π/100 s at e^{−20 t}; the last beyond 2 % ends before t = 0.189 s.
        let last = (0..1200)
            .map(|k| f64::from(k) * 1e-3)
            .rfind(|t| (x2(*t) - 0.03).abs() > 6e-4);
        assert_eq!(
            metrics.settling_time,
            Some(((last.unwrap() + 1e-3) * 1e3).round() / 1e3)
        );
        // First maximum where tan(100 t) = −1/5, t = 29.44 ms.
        let t = (std::f64::consts::PI - 0.2_f64.atan()) / 100.0;
        assert!((metrics.overshoot - 100.0 * (x2(t) / 0.03 - 1.0)).abs() < 0.1);
        let residual = metrics.residual_vibration.unwrap();
        // A run that ends soon after says nothing of how long it stays.
        let settled = last.unwrap();
        for (end, held) in [(1.2 * settled, true), (1.05 * settled, false)] {
            let short = Run {
                samples: run.samples[..(end * 1e3) as usize].to_vec(),
                ..run.clone()
            };
            assert_eq!(Metrics::new(&short).within_band_from.is_some(), held);
        }
        // The actuator stands at the origin all the time: mass 2 alone is not enough.
        assert_eq!(metrics.within_tolerance_from, None);
        assert_eq!(residual[0], 0.0);
        assert!((residual[3] - 2e-5).abs() < 1e-7);
        assert_eq!((metrics.peak_current, metrics.fault), (1.5, None));
        assert!(metrics.estimation_error.is_none());
    }
    /// Actuator and mass 2 tend to 30 mm exponentially, 20/s and 10/s: the slower one is within 50 um after
    /// ln(600)/10 s. The others do not count.
    #[test]
    fn both_masses_have_to_be_within_the_tolerance() {
        let run = |rates: [f64; 2], seconds: f64, tolerance: f64| {
            let periods = (1e3 * seconds) as usize;
            let motion = |time: f64| rates.map(|rate| 0.03 * (1.0 - (-rate * time).exp()));
            let run = Run {
                settling_tolerance: tolerance,
                ..formula::run(periods, motion)
            };
            Metrics::new(&run).within_tolerance_from
        };
        for (rates, tolerance) in [
            ([20.0, 10.0], 50e-6),
            ([10.0, 20.0], 50e-6),
            ([10.0, 10.0], 1e-3),
        ] {
            let expected = (0.03_f64 / tolerance).ln() / 10.0;
            let found = run(rates, 1.2, tolerance).unwrap();
            assert!((0.0..1e-3).contains(&(found - expected)), "{found}");
        }
        // Reached in the last tenth of the run: nobody knows whether it stays.
        assert_eq!(run([20.0, 10.0], 0.66, 50e-6), None);
    }
}
