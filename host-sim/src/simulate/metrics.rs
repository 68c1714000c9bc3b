//! What a run is judged by.

use super::corridor::estimate;
use super::ending::{Ending, Motion, peak_to_peak};
use crate::chain::controlled_mass;
use crate::drive::SETTLING_BAND;
use crate::simulate::{Run, Sample};
use serde::Serialize;

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

/// Element of the state that is the controlled mass's position.
pub(crate) fn controlled(run: &Run) -> usize {
    motion(run).0
}

/// Column of the controlled mass's position, its target and the span of its motion, m.
fn motion(run: &Run) -> (usize, f64, f64) {
    let masses = run
        .samples
        .first()
        .map_or(0, |sample| sample.truth.len() / 2);
    let controlled = 2 * controlled_mass(masses.saturating_sub(1));
    let target = run.scenario.target;
    let start = run
        .samples
        .first()
        .map_or(0.0, |sample| sample.truth[controlled]);
    (controlled, target, target - start)
}

/// Time after which the controlled mass stays within a band around its target, s; none when it does
/// not settle within the run, or only at its end.
///
/// * `band`: half width over the span of the motion
#[must_use]
pub fn settling_time(run: &Run, band: f64) -> Option<f64> {
    let (controlled, target, span) = motion(run);
    // Written so that what is no number is outside.
    let inside = |x: f64| (x - target).abs() <= band * span.abs();
    held_from(run, |sample| inside(sample.truth[controlled]))
}

/// Time after which controlled mass and actuator stay within a distance of the target, s; none when they do not
/// within the run, or only at its end.
///
/// * `tolerance`: m
#[must_use]
pub fn within(run: &Run, tolerance: f64) -> Option<f64> {
    held_from(run, both_within(run, tolerance))
}

/// The same, whether or not that is only so at the end of the run.
pub(crate) fn within_from(run: &Run, tolerance: f64) -> Option<f64> {
    let from = stays_from(&run.samples, both_within(run, tolerance));
    run.samples.get(from).map(|sample| sample.time)
}

/// Whether actuator and controlled mass are within a tolerance of the target, m.
fn both_within(run: &Run, tolerance: f64) -> impl Fn(&Sample) -> bool {
    let (controlled, target, _) = motion(run);
    // Written so that what is no number is outside.
    let inside = move |x: f64| (x - target).abs() <= tolerance;
    move |sample| inside(sample.truth[0]) && inside(sample.truth[controlled])
}

/// Time from which on every sample is inside, s; none when that is only so at the end of the run.
fn held_from(run: &Run, inside: impl Fn(&Sample) -> bool) -> Option<f64> {
    let samples = &run.samples;
    let settled = stays_from(samples, inside);
    let held = (samples.len() - settled) as f64 >= HELD * samples.len() as f64;
    samples
        .get(settled)
        .filter(|_| held)
        .map(|sample| sample.time)
}

/// Number of the sample from which on every one is inside; of none, how many there are.
fn stays_from(samples: &[Sample], inside: impl Fn(&Sample) -> bool) -> usize {
    let outside = samples.iter().rposition(|sample| !inside(sample));
    outside.map_or(0, |last| last + 1)
}

/// The same between the samples, in control periods; where it does not settle, its mean distance from the
/// target over the end of the run that would have to be held, over the span.
///
/// # Errors
/// That distance.
pub(crate) fn settled_after(run: &Run, band: f64) -> Result<f64, f64> {
    let (controlled, target, span) = motion(run);
    let samples = &run.samples;
    let error = |k: usize| (samples[k].truth[controlled] - target) / span;
    let Some(last) = (0..samples.len()).rev().find(|k| {
        // Written so that what is no number is outside.
        let inside = error(*k).abs() <= band;
        !inside
    }) else {
        return Ok(0.0);
    };
    let held = (HELD * samples.len() as f64).ceil() as usize;
    let end = samples.len() - held.min(samples.len());
    if last >= end {
        let off: f64 = (end..samples.len()).map(|k| error(k).abs()).sum();
        return Err(off / held as f64);
    }
    let (before, after) = (error(last), error(last + 1));
    Ok(last as f64 + (before.abs() - band) / (before - after).abs())
}

impl Metrics {
    /// Judges a run.
    #[must_use]
    pub fn new(run: &Run) -> Self {
        let samples = &run.samples;
        let masses = samples.first().map_or(0, |sample| sample.truth.len() / 2);
        let (controlled, target, span) = motion(run);
        let within_band_from = settling_time(run, SETTLING_BAND);
        let end = Ending::new(run, controlled);
        let beyond = samples
            .iter()
            .map(|s| (s.truth[controlled] - target) / span);

        let window = within_band_from.map(|settled| {
            let late = (RESIDUAL_FROM * samples.len() as f64).round() as usize;
            let from = samples.partition_point(|sample| sample.time < settled);
            &samples[from.max(late)..]
        });
        let window = window.filter(|window| !window.is_empty());
        let residual = |element: usize| peak_to_peak(window.unwrap_or_default(), element);
        let rms = |element: usize| {
            let errors = samples.iter().filter_map(|sample| {
                let record = sample.record.as_ref()?;
                let estimate = estimate(record).nth(element)?;
                Some((estimate - sample.truth[element]).powi(2))
            });
            (errors.sum::<f64>() / samples.len() as f64).sqrt()
        };
        let observed = samples.iter().any(|sample| sample.record.is_some());
        let elements = (0..masses).map(|mass| 2 * mass);
        Self {
            settling_time: within_band_from,
            within_band_from,
            settling_tolerance: run.settling_tolerance,
            within_tolerance_from: within(run, run.settling_tolerance),
            end: end.clone(),
            overshoot: 100.0 * beyond.fold(0.0, f64::max),
            residual_vibration: window.map(|_| elements.clone().map(residual).collect()),
            offset: window.map(|window| {
                let offsets = window.iter().map(|s| s.truth[controlled] - target);
                offsets.sum::<f64>() / window.len() as f64
            }),
            peak_current: samples.iter().map(|s| s.command.abs()).fold(0.0, f64::max),
            estimation_error: observed.then(|| elements.map(rms).collect()),
            fault: run.fault.map(|(_, fault)| fault.number()),
            fault_time: run.fault.map(|(time, _)| time),
        }
        .with_end(&end, within(run, run.settling_tolerance))
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
            assert_eq!(settling_time(&short, SETTLING_BAND).is_some(), held);
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
            let samples = (0..(1e3 * seconds) as usize).map(|k| {
                let time = k as f64 * 1e-3;
                let mut truth = DVector::zeros(8);
                truth[0] = 0.03 * (1.0 - (-rates[0] * time).exp());
                truth[4] = 0.03 * (1.0 - (-rates[1] * time).exp());
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
            let run = Run {
                kind: crate::machine::Kind::Linear,
                resolution: 1e-6,
                settling_tolerance: tolerance,
                scenario: *Scenario::named("fig3").unwrap(),
                law: Law::FullState,
                samples: samples.collect(),
                fault: None,
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
