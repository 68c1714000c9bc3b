//! How a run ends: where actuator and controlled mass stand, and whether they stand at all.
//!
//! A settling time says when a mass was last outside its band. A mass that hunts within the band for ever, or
//! whose actuator does, has one all the same; so what is left at the end is looked at by itself.

use super::Run;
use super::metrics::{Frame, controlled};
use serde::Serialize;

/// The last part of a run that is looked at, as a share of it.
const SHARE: f64 = 0.2;

/// What may move at the end of a run and still counts as at rest, peak to peak: 50 um (urad), a third of the
/// narrowest band of the experiments, or two encoder counts where those are more. Within two counts the
/// drive cannot know that anything moves; within five a coarse encoder hides hunting of 6 % of a step.
const STILL: f64 = 50e-6;
const STILL_COUNTS: f64 = 2.0;

/// Motion that has not become less than this share of itself from one half of the end to the other goes on.
const LASTING: f64 = 0.7;
/// Motion of which more than this share is a change of its mean goes somewhere.
const DRIFT: f64 = 0.4;

/// What is left of the motion at the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// None, within the tolerance.
    Rest,
    /// It becomes less, or goes somewhere.
    Moving,
    /// That of the actuator goes on and gets nowhere.
    Hunting,
}

/// The end of a run, SI units; lists: actuator, controlled mass.
#[derive(Clone, Debug, Serialize)]
pub struct Ending {
    /// Where the last part begins in which the motion is looked at, s.
    pub from: f64,
    /// Mean distance from the target at the end of the experiment, m.
    pub offset: [f64; 2],
    /// Peak-to-peak motion at the end of what was watched, m.
    pub motion: [f64; 2],
    /// What of that counts as rest, m.
    pub tolerance: f64,
    /// What kind of motion it is.
    pub state: Motion,
}

impl Ending {
    /// Looks at the end of a run.
    #[must_use]
    pub fn new(run: &Run) -> Self {
        let mut meter = EndingMeter::new(&Frame::of(run));
        for sample in &run.samples {
            let truth = &sample.truth;
            meter.see(sample.time, [truth[0], truth[controlled(truth.len())]]);
        }
        meter.ending()
    }

    /// The larger of the motions, m.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.motion[0].max(self.motion[1])
    }
}

/// Looks at the end of a run while it passes, in a memory of fixed size.
#[derive(Clone, Debug)]
pub(crate) struct EndingMeter {
    target: f64,
    tolerance: f64,
    /// Number of samples of the run, and how many have passed.
    of: usize,
    passed: usize,
    /// From when on the end is looked at, s, and its first sample: number and time.
    from: f64,
    first: Option<(usize, f64)>,
    /// Actuator and controlled mass over the whole end, and the actuator over either half of it.
    both: [Stretch; 2],
    halves: [Stretch; 2],
}

impl EndingMeter {
    /// For a run.
    pub(crate) fn new(frame: &Frame) -> Self {
        Self {
            target: frame.target,
            tolerance: STILL.max(STILL_COUNTS * frame.resolution),
            of: frame.periods,
            passed: 0,
            from: frame.last - SHARE * frame.last,
            first: None,
            both: [Stretch::default(); 2],
            halves: [Stretch::default(); 2],
        }
    }

    /// The next sample: its time, s, and where actuator and controlled mass are, m.
    #[inline]
    pub(crate) fn see(&mut self, time: f64, positions: [f64; 2]) {
        if time >= self.from {
            let first = self.first.get_or_insert((self.passed, time)).0;
            for (stretch, position) in self.both.iter_mut().zip(positions) {
                stretch.see(position);
            }
            let half = (self.of - first) / 2;
            let half = usize::from(self.passed - first >= half);
            self.halves[half].see(positions[0]);
        }
        self.passed += 1;
    }

    /// The end of a run that has passed.
    pub(crate) fn ending(&self) -> Ending {
        let motion = self.both.map(|stretch| stretch.extent.peak_to_peak());
        Ending {
            from: self.first.map_or(0.0, |(_, time)| time),
            offset: self.both.map(|stretch| stretch.mean() - self.target),
            motion,
            tolerance: self.tolerance,
            state: if motion[0] > self.tolerance && self.lasts() {
                Motion::Hunting
            } else if motion.iter().any(|motion| *motion > self.tolerance) {
                Motion::Moving
            } else {
                Motion::Rest
            },
        }
    }

    /// Whether the actuator's motion goes on and gets nowhere. A load that rings while the actuator stands still
    /// only takes its time.
    fn lasts(&self) -> bool {
        let [before, after] = &self.halves;
        let drift = (after.mean() - before.mean()).abs();
        let lasting = after.extent.peak_to_peak() >= LASTING * before.extent.peak_to_peak();
        lasting && drift <= DRIFT * self.both[0].extent.peak_to_peak()
    }
}

/// The ends of a motion, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Default for Extent {
    fn default() -> Self {
        Self {
            low: f64::MAX,
            high: f64::MIN,
        }
    }
}

impl Extent {
    /// One more position, m; what is no number is none.
    #[inline]
    pub(crate) fn see(&mut self, x: f64) {
        // A comparison where `f64::min` would take two.
        self.low = if x < self.low { x } else { self.low };
        self.high = if x > self.high { x } else { self.high };
    }

    /// The distance between them, m; 0 of no motion.
    pub(crate) fn peak_to_peak(&self) -> f64 {
        (self.high - self.low).max(0.0)
    }
}

/// Distance between the ends of the motion of one element of the state, m.
#[cfg(test)]
pub(crate) fn peak_to_peak(samples: &[super::Sample], element: usize) -> f64 {
    let mut extent = Extent::default();
    for sample in samples {
        extent.see(sample.truth[element]);
    }
    extent.peak_to_peak()
}

/// A motion over some samples: its ends and its mean.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    extent: Extent,
    sum: f64,
    samples: usize,
}

impl Stretch {
    #[inline]
    fn see(&mut self, x: f64) {
        self.extent.see(x);
        self.sum += x;
        self.samples += 1;
    }

    fn mean(&self) -> f64 {
        self.sum / self.samples.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Kind;
    use crate::simulate::scenario::Scenario;
    use crate::simulate::{Law, Sample};
    use nalgebra::DVector;

    /// Runs of 1.2 s in which the load moves by a formula around 30 mm, and so does the actuator, or it stands
    /// 0.1 mm before, with an encoder of a resolution.
    fn ending(stands: bool, resolution: f64, load: impl Fn(f64) -> f64) -> Ending {
        let samples = (0..1200).map(|k| {
            let time = f64::from(k) * 1e-3;
            Sample {
                time,
                count: 0,
                truth: DVector::from_row_slice(&[
                    if stands { 0.0299 } else { 0.03 + load(time) },
                    0.0,
                    0.03 + load(time),
                    0.0,
                ]),
                true_reaction_force: 0.0,
                reference: 0.03,
                applied_current: 0.0,
                command: 0.0,
                limited: false,
                record: None,
            }
        });
        let run = Run {
            kind: Kind::Linear,
            resolution,
            settling_tolerance: 50e-6,
            scenario: *Scenario::named("fig3").unwrap(),
            law: Law::Core,
            samples: samples.collect(),
            fault: None,
        };
        Ending::new(&run)
    }

    #[test]
    fn each_way_to_end_has_its_word() {
        let hunting = |t: f64| 100e-6 * (60.0 * t).sin();
        let ringing = |t: f64| 0.01 * (-4.0 * t).exp() * (75.0 * t).sin();
        let drift = |t: f64| 1e-3 * t;
        let resting = |t: f64| 20e-6 * (60.0 * t).sin();
        for (name, stands, resolution, state, motion, load) in [
            (
                "hunting",
                false,
                1e-6,
                Motion::Hunting,
                200e-6,
                &hunting as &dyn Fn(f64) -> f64,
            ),
            (
                "the load alone",
                true,
                1e-6,
                Motion::Moving,
                200e-6,
                &hunting,
            ),
            ("ringing", false, 1e-6, Motion::Moving, 400e-6, &ringing),
            ("drift", false, 1e-6, Motion::Moving, 239e-6, &drift),
            ("resting", false, 1e-6, Motion::Rest, 40e-6, &resting),
            // Two counts of a coarse encoder.
            ("unseen", false, 101e-6, Motion::Rest, 200e-6, &hunting),
        ] {
            let end = ending(stands, resolution, load);
            assert_eq!(end.state, state, "{name}: {end:?}");
            assert!(
                (end.motion[1] / motion - 1.0).abs() < 0.2,
                "{name}: {end:?}"
            );
            assert!((end.from - 0.96).abs() < 2e-3, "{name}: {end:?}");
        }
        assert!((ending(false, 1e-6, drift).offset[1] - 1.08e-3).abs() < 2e-6);
        let stands = ending(true, 1e-6, drift);
        assert!((stands.offset[0] + 1e-4).abs() < 1e-12 && stands.motion[0] == 0.0);
    }
}
