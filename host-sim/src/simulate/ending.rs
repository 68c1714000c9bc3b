//! How a run ends: where actuator and controlled mass stand, and whether they stand at all.
//!
//! A settling time says when a mass was last outside its band. A mass that hunts within the band for ever, or
//! whose actuator does, has one all the same; so what is left at the end is looked at by itself.

use super::{Run, Sample};
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
    ///
    /// * `controlled`: element of the state that is the controlled mass's position
    #[must_use]
    pub fn new(run: &Run, controlled: usize) -> Self {
        let samples = &run.samples;
        let last = samples.last().map_or(0.0, |sample| sample.time);
        let from = last - SHARE * last;
        let end = &samples[samples.partition_point(|sample| sample.time < from)..];
        let target = run.scenario.target;
        let tolerance = STILL.max(STILL_COUNTS * run.resolution);
        let elements = [0, controlled];
        let motion = elements.map(|element| peak_to_peak(end, element));
        Self {
            from: end.first().map_or(0.0, |sample| sample.time),
            offset: elements.map(|element| mean(end, element) - target),
            motion,
            tolerance,
            state: if motion[0] > tolerance && lasts(end) {
                Motion::Hunting
            } else if motion.iter().any(|motion| *motion > tolerance) {
                Motion::Moving
            } else {
                Motion::Rest
            },
        }
    }

    /// The larger of the motions, m.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.motion[0].max(self.motion[1])
    }
}

/// Whether the actuator's motion goes on and gets nowhere. A load that rings while the actuator stands still
/// only takes its time.
fn lasts(end: &[Sample]) -> bool {
    let (before, after) = end.split_at(end.len() / 2);
    let drift = (mean(after, 0) - mean(before, 0)).abs();
    let lasting = peak_to_peak(after, 0) >= LASTING * peak_to_peak(before, 0);
    lasting && drift <= DRIFT * peak_to_peak(end, 0)
}

/// Distance between the ends of the motion of one element of the state, m.
pub(crate) fn peak_to_peak(samples: &[Sample], element: usize) -> f64 {
    let positions = samples.iter().map(|sample| sample.truth[element]);
    let (low, high) = positions.fold((f64::MAX, f64::MIN), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    (high - low).max(0.0)
}

fn mean(samples: &[Sample], element: usize) -> f64 {
    let sum: f64 = samples.iter().map(|sample| sample.truth[element]).sum();
    sum / samples.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Kind;
    use crate::simulate::Law;
    use crate::simulate::scenario::Scenario;
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
        Ending::new(&run, 2)
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
