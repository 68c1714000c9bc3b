//! Tuning: the least of a criterion over a box, the same search with the same budget for every law.
//!
//! A fifth of the budget is spread over the box at random, the starts that are known among it; from the
//! best of these, [`RUNS`] runs of CMA-ES (covariance matrix adaptation: Hansen, The CMA evolution
//! strategy, 2016) share the rest. What is random comes from a fixed seed, and candidates are judged side
//! by side and ranked in their order, so that the result does not depend on the number of threads.
//!
//! What is judged is smooth where the settling time alone jumps:
//!
//! ```text
//! J = max over plants of  mean over b of t_b + h,    b = 1, 1.4, 2, 2.8 %
//! ```
//!
//! with the time `t_b` after which the controlled mass stays within ±b of its motion, read between the
//! samples; what does not settle counts twice the run and more the farther it is off. What still moves
//! at the end by `m`, more than the tolerance `m_0` of rest, adds `h = ln(m / m_0)` tenths of the run. All times
//! are in control periods: nothing here knows a second.

use crate::simulate::ending::{EndingMeter, Motion};
use crate::simulate::metrics::{Frame, HELD, Seen, controlled};
use fcmaes_core::{Cmaes, CmaesParams, Fitness};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

const BANDS: [f64; 4] = [0.01, 0.014, 0.02, 0.028];

/// Runs of CMA-ES, and the share of the budget that is spread at random before.
const RUNS: usize = 3;
const SPREAD: f64 = 0.2;
/// First step of a run, over the width of the box.
const STEP: f64 = 0.12;
/// Candidates judged side by side.
const GENERATION: usize = 14;
const SEED: u64 = 1;
/// How far apart two runs start, over the width of the box in the variable where they differ most.
const APART: f64 = 0.2;

/// What is searched in, one entry per variable.
#[derive(Clone, Debug)]
pub(super) struct Space {
    /// Lower and upper ends.
    pub(super) ends: Vec<(f64, f64)>,
    /// Points that are known to be good elsewhere.
    pub(super) starts: Vec<Vec<f64>>,
}

/// What counts as moving at the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Moving {
    /// Whatever is not at rest.
    Any,
    /// What goes on and gets nowhere: where friction holds the actuator, a load that rings only takes its time.
    Lasting,
}

/// Criterion of one run, taken while it passes.
pub(super) struct Criterion {
    frame: Frame,
    moving: Moving,
    samples: usize,
    controlled: usize,
    /// From start to target, m.
    span: f64,
    bands: [InBand; BANDS.len()],
    /// Number of the first sample of those that would have to be held, and the sum of distances from there on, over
    /// the span.
    end: usize,
    off: f64,
    ending: EndingMeter,
}

/// The last sample outside a band: its number, the distance there and at the next one, over the span.
#[derive(Clone, Copy, Default)]
struct InBand {
    last: Option<usize>,
    before: f64,
    after: f64,
}

impl Criterion {
    pub(super) fn new(frame: Frame, moving: Moving) -> Self {
        Self {
            frame,
            moving,
            samples: 0,
            controlled: 0,
            span: frame.target,
            bands: [InBand::default(); BANDS.len()],
            end: frame.periods - held(&frame).min(frame.periods),
            off: 0.0,
            ending: EndingMeter::new(&frame),
        }
    }

    /// The next sample.
    pub(super) fn look(&mut self, seen: &Seen<'_>) {
        let truth = seen.truth;
        if self.samples == 0 {
            self.controlled = controlled(truth.len());
            self.span = self.frame.target - truth[self.controlled];
        }
        let position = truth[self.controlled];
        let error = (position - self.frame.target) / self.span;
        for (found, band) in self.bands.iter_mut().zip(BANDS) {
            // Written so that what is no number is outside.
            let inside = error.abs() <= band;
            if !inside {
                (found.last, found.before) = (Some(self.samples), error);
            } else if found.last.is_some_and(|last| last + 1 == self.samples) {
                found.after = error;
            }
        }
        if self.samples >= self.end {
            self.off += error.abs();
        }
        self.ending.see(seen.time, [truth[0], position]);
        self.samples += 1;
    }

    /// The time after which the controlled mass stays within a band, read between the samples, in control periods;
    /// what does not settle counts twice the run and more the farther it is off over the end of the run that would
    /// have to be held.
    fn time(&self, found: &InBand, band: f64) -> f64 {
        let Some(last) = found.last else {
            return 0.0;
        };
        if last >= self.end {
            let off = self.off / held(&self.frame) as f64;
            return self.frame.periods as f64 * (2.0 + off.min(1.0));
        }
        let (before, after) = (found.before, found.after);
        last as f64 + (before.abs() - band) / (before - after).abs()
    }

    /// The criterion of a run that has passed, control periods.
    pub(super) fn periods(&self) -> f64 {
        let times = self.bands.iter().zip(BANDS);
        let sum: f64 = times.map(|(found, band)| self.time(found, band)).sum();
        let end = self.ending.ending();
        let left = if self.moving == Moving::Any || end.state == Motion::Hunting {
            (end.largest() / end.tolerance).max(1.0).ln()
        } else {
            0.0
        };
        sum / BANDS.len() as f64 + 0.1 * self.frame.periods as f64 * left
    }
}

/// Samples at the end of a run that would have to be held.
fn held(frame: &Frame) -> usize {
    (HELD * frame.periods as f64).ceil() as usize
}

/// The point of a box with the least cost found, and that cost.
///
/// * `budget`: evaluations, to within a generation
/// * `progress`: told of the evaluations made
pub(super) fn search(
    space: &Space,
    budget: usize,
    cost: &(dyn Fn(&[f64]) -> f64 + Sync),
    progress: &dyn Fn(usize),
) -> (Vec<f64>, f64) {
    let judge = |points: &[Vec<f64>]| -> Vec<f64> {
        let costs = points.par_iter().map(|point| cost(point));
        costs.collect()
    };
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let clamped = space.starts.iter().map(|start| {
        let inside = start.iter().zip(&space.ends);
        inside
            .map(|(x, (low, high))| x.clamp(*low, *high))
            .collect()
    });
    let mut points: Vec<Vec<f64>> = clamped.collect();
    let spread = (SPREAD * budget as f64) as usize;
    while points.len() < spread.max(RUNS) {
        let ends = space.ends.iter();
        points.push(
            ends.map(|(low, high)| random.random_range(*low..=*high))
                .collect(),
        );
    }
    progress(0);
    let costs = judge(&points);
    let mut made = points.len();
    let mut ranked: Vec<(f64, Vec<f64>)> = costs.into_iter().zip(points).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best = ranked[0].clone();
    let (low, high): (Vec<f64>, Vec<f64>) = space.ends.iter().copied().unzip();
    let mut starts: Vec<&Vec<f64>> = Vec::new();
    for (_, point) in &ranked {
        if starts.len() < RUNS && starts.iter().all(|other| apart(space, point, other)) {
            starts.push(point);
        }
    }
    let runs = starts.len();
    for (run, start) in starts.into_iter().enumerate() {
        let mut fitness = Fitness::bounded(low.len(), 1, &low, &high);
        fitness.set_normalize(true);
        let until = made + budget.saturating_sub(made) / (runs - run);
        let parameters = CmaesParams {
            popsize: GENERATION as i32,
            max_evaluations: (until - made) as u64,
            seed: SEED + run as u64,
            ..CmaesParams::default()
        };
        // Normalised: the box is two wide.
        let mut search = Cmaes::new(fitness, start, &[2.0 * STEP], &parameters);
        while made < until && search.stop() == 0 {
            progress(made);
            let points = search.ask();
            let costs = judge(&points);
            made += points.len();
            search.tell(&costs);
            for (cost, point) in costs.into_iter().zip(points) {
                if cost < best.0 {
                    best = (cost, point);
                }
            }
        }
    }
    (best.1, best.0)
}

/// Whether two points are far enough from each other for a run from each.
fn apart(space: &Space, a: &[f64], b: &[f64]) -> bool {
    let each = space.ends.iter().zip(a.iter().zip(b));
    let mut each = each.map(|((low, high), (a, b))| (a - b).abs() / (high - low));
    each.any(|distance| distance > APART)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Run;
    use crate::simulate::ending::Ending;
    use crate::simulate::metrics::formula;
    use proptest::prelude::*;

    /// The criterion from a run that was kept, as the head of this file has it.
    fn by_definition(run: &Run, moving: Moving) -> f64 {
        let (n, target) = (run.samples.len(), run.scenario.target);
        let span = target - run.samples[0].truth[4];
        let error = |k: usize| (run.samples[k].truth[4] - target) / span;
        let to_be_held = (0.1 * n as f64).ceil() as usize;
        let time = |band: f64| {
            let mut outside = (0..n).filter(|k| error(*k).abs() > band);
            match outside.next_back() {
                None => 0.0,
                Some(last) if last >= n - to_be_held => {
                    let off: f64 = (n - to_be_held..n).map(|k| error(k).abs()).sum();
                    n as f64 * (2.0 + (off / to_be_held as f64).min(1.0))
                }
                Some(last) => {
                    let (before, after) = (error(last), error(last + 1));
                    last as f64 + (before.abs() - band) / (before - after).abs()
                }
            }
        };
        let times: f64 = [0.01, 0.014, 0.02, 0.028].map(time).iter().sum();
        let end = Ending::new(run);
        let counts = moving == Moving::Any || end.state == Motion::Hunting;
        let motion = (end.motion[0].max(end.motion[1]) / end.tolerance).max(1.0);
        times / 4.0
            + if counts {
                0.1 * n as f64 * motion.ln()
            } else {
                0.0
            }
    }

    proptest! {
        /// While the run passes: the same number.
        #[test]
        fn the_criterion_is_that_of_the_run(run in formula::runs()) {
            for moving in [Moving::Any, Moving::Lasting] {
                let mut criterion = Criterion::new(Frame::of(&run), moving);
                for sample in &run.samples {
                    criterion.look(&sample.into());
                }
                prop_assert_eq!(criterion.periods(), by_definition(&run, moving));
            }
        }
    }

    /// Rosenbrock's valley has its bottom at (1, 1); that of Rastrigin lies among many others.
    #[test]
    fn finds_the_bottom_of_a_valley_and_of_an_egg_box() {
        let valley = |p: &[f64]| (1.0 - p[0]).powi(2) + 100.0 * (p[1] - p[0] * p[0]).powi(2);
        let box_of = |end: f64| Space {
            ends: vec![(-end, 1.1 * end); 2],
            starts: vec![vec![-1.0, 1.0]],
        };
        let (found, _) = search(&box_of(2.0), 2000, &valley, &|_| ());
        assert!(
            (found[0] - 1.0).abs() < 1e-2 && (found[1] - 1.0).abs() < 1e-2,
            "{found:?}"
        );
        let egg_box = |p: &[f64]| -> f64 {
            let terms = p
                .iter()
                .map(|x| 10.0 + x * x - 10.0 * (std::f64::consts::TAU * x).cos());
            terms.sum()
        };
        let (found, cost) = search(&box_of(2.0), 1000, &egg_box, &|_| ());
        // One of the five deepest of some twenty, at the worst.
        assert!(cost < 1.01, "{found:?}");
    }

    /// As many threads as there are, or one: the same point.
    #[test]
    fn threads_do_not_change_what_is_found() {
        let valley = |p: &[f64]| (1.0 - p[0]).powi(2) + 100.0 * (p[1] - p[0] * p[0]).powi(2);
        let space = Space {
            ends: vec![(-2.0, 2.0); 2],
            starts: Vec::new(),
        };
        let found = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| search(&space, 200, &valley, &|_| ()))
        };
        assert_eq!(found(1), found(3));
    }
}
