//! One period of a signal: its shape, where it begins, and its rounding to whole steps.

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

/// Sum of cosines of equal amplitude with Schroeder's phases, `−π n (n − 1) / lines` for the
/// `n`-th of them: the frequency then passes through the band once per period, like a sweep, and
/// the peak stays near that of a single sine instead of growing with the number of lines.
///
/// * `lines`: periods of each cosine in the whole, below half of `samples`
pub(super) fn multisine(samples: usize, lines: RangeInclusive<usize>) -> Vec<f64> {
    // Every cosine is made of the same values, taken at its own pace.
    let value = |k: usize| (TAU * k as f64 / samples as f64).sin_cos();
    let circle: Vec<(f64, f64)> = (0..samples).map(value).collect();
    let count = lines.clone().count() as f64;
    let mut signal = vec![0.0; samples];
    for (n, line) in lines.enumerate() {
        let n = (n + 1) as f64;
        let (sin, cos) = (-PI * n * (n - 1.0) / count).sin_cos();
        let mut at = 0;
        for sum in &mut signal {
            let (s, c) = circle[at];
            *sum += c * cos - s * sin;
            at = (at + line) % samples;
        }
    }
    signal
}

/// A sine whose frequency rises linearly from one end of the band to the other in the first half of
/// the period and falls back in the second.
///
/// With the frequency symmetric about the middle of the period and a whole number of cycles in it
/// (the band is scaled by that little), the sine is odd about the middle: periodic, and its mean is
/// zero.
///
/// * `band`: cycles per period
pub(super) fn chirp(samples: usize, [from, to]: [f64; 2]) -> Vec<f64> {
    let mean = 0.5 * (from + to);
    let cycles = mean.round().max(1.0);
    let scale = cycles / mean;
    let phase = |u: f64| scale * (from * u + (to - from) * u * u);
    let sample = |k: usize| {
        let u = k as f64 / samples as f64;
        let phase = if u <= 0.5 {
            phase(u)
        } else {
            cycles - phase(1.0 - u)
        };
        (TAU * phase).sin()
    };
    (0..samples).map(sample).collect()
}

/// The signal, shifted cyclically so that a free machine at rest does not drift away under it.
///
/// The chain as a whole has nothing to hold it: `M dv/dt = k_f i`. With `i_l` held over period `l`
/// and `S_j = i_0 + … + i_{j−1}`, a machine that begins at rest with entry `s` has
///
/// ```text
/// v_j = (k_f T / M) (S_j − S_s)         mean over a period = (k_f T / M) (mean S − S_s)
/// ```
///
/// The velocity is periodic because the signal has no mean, but nothing makes its own mean zero: the
/// machine advances by that mean times the period in each repetition, and a sine that begins at its
/// zero crossing is the worst there is. So it begins with an entry at which `S` passes its mean, as
/// near to it as entries are; what is left is taken away by [`in_steps`]. `S` passes its mean many
/// times; of all these entries it is the one from which the rigid path reaches least far.
pub(super) fn begun_at_standstill(mut signal: Vec<f64>) -> Vec<f64> {
    let samples = signal.len();
    let mut sum = 0.0;
    let before = signal.iter().map(|current| {
        let before = sum;
        sum += current;
        before
    });
    let sums: Vec<f64> = before.collect();
    let mean = sums.iter().sum::<f64>() / samples as f64;
    let velocity: Vec<f64> = sums.iter().map(|sum| sum - mean).collect();
    let mut position = 0.0;
    let after = |k: usize| (k + 1) % samples;
    let path: Vec<f64> = (0..samples)
        .map(|k| {
            let here = position;
            // Exact: the acceleration is constant over a period.
            position += 0.5 * (velocity[k] + velocity[after(k)]);
            here
        })
        .collect();
    let least = path.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = path.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let travel = |k: &usize| (greatest - path[*k]).max(path[*k] - least);
    let start = (0..samples)
        .filter(|k| velocity[*k] * velocity[after(*k)] <= 0.0)
        .map(|k| {
            if velocity[k].abs() <= velocity[after(k)].abs() {
                k
            } else {
                after(k)
            }
        })
        .min_by(|a, b| travel(a).total_cmp(&travel(b)));
    signal.rotate_left(start.unwrap_or(0));
    signal
}

/// The signal in whole steps with the largest at `peak`: no mean, and no drift at all.
///
/// Each rounding error is carried into the next entry, so that the running sum, which is the
/// machine's velocity, is never off by more than half a step, and the sum of all is exactly zero.
/// Then single steps are moved, one entry raised and a later one lowered or the reverse, until the
/// mean of the running sum is exactly zero too: the rigid motion then ends every repetition where it
/// began it, however many there are.
///
/// * `signal`: without mean, not all zero
/// * `peak`: positive
pub(super) fn in_steps(signal: &[f64], peak: i16) -> Vec<i16> {
    let largest = signal
        .iter()
        .fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let scale = f64::from(peak) / largest;
    let mut error = 0.0;
    let round = |x: &f64| {
        let wanted = x * scale + error;
        // Halves towards zero: from at most `peak` and half a step to at most `peak`.
        let rounded = (wanted.abs() - 0.5).ceil().max(0.0).copysign(wanted);
        error = wanted - rounded;
        rounded as i16
    };
    let mut steps: Vec<i16> = signal.iter().map(round).collect();
    remove_drift(&mut steps, peak);
    steps
}

/// Moves single steps until the running sums add up to zero.
///
/// One step more at entry `a` and one less at `a + d` raise the `d` running sums between them by one.
fn remove_drift(steps: &mut [i16], peak: i16) {
    let mut sum = 0;
    let sums = steps.iter().map(|step| {
        let before = sum;
        sum += i64::from(*step);
        before
    });
    let mut drift: i64 = sums.sum();
    let half = steps.len() / 2;
    let fits =
        |step: i16, change: i16| (i32::from(step) + i32::from(change)).abs() <= i32::from(peak);
    while drift != 0 {
        let before = drift;
        for early in 0..steps.len() - half {
            let distance = drift.unsigned_abs().min(half as u64) as usize;
            let late = early + distance;
            let change = -drift.signum() as i16;
            if distance > 0 && fits(steps[early], change) && fits(steps[late], -change) {
                steps[early] += change;
                steps[late] -= change;
                drift += i64::from(change) * distance as i64;
            }
        }
        if drift == before {
            // No entry can be moved: all are at the peak.
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Position of a rigid machine, in units of `k_f T² / M` steps, at the end of every period:
    /// integrated by Newton's law, period by period, from rest.
    fn rigid(steps: &[i16], repetitions: usize) -> Vec<f64> {
        let (mut position, mut velocity) = (0.0, 0.0);
        let mut path = Vec::new();
        for _ in 0..repetitions {
            for step in steps {
                let acceleration = f64::from(*step);
                position += velocity + 0.5 * acceleration;
                velocity += acceleration;
                path.push(position);
            }
        }
        path
    }

    /// Every cosine by its own formula, at a few places.
    #[test]
    fn the_multisine_is_its_formula() {
        let signal = multisine(100, 3..=7);
        for k in [0, 1, 17, 50, 99] {
            let cosines = (1..=5).map(|n| {
                let n = f64::from(n);
                let phase = -PI * n * (n - 1.0) / 5.0;
                (TAU * (n + 2.0) * k as f64 / 100.0 + phase).cos()
            });
            assert!((signal[k] - cosines.sum::<f64>()).abs() < 1e-12);
        }
    }

    /// Schroeder's phases keep the crest factor below 2; phases of zero would make it √(2 lines).
    #[test]
    fn the_multisine_has_a_low_peak() {
        for (samples, lines) in [(2048, 5..=111), (2048, 5..=20), (20_000, 10..=4000)] {
            let signal = multisine(samples, lines.clone());
            let peak = signal.iter().fold(0.0, |p: f64, x| p.max(x.abs()));
            let rms = (0.5 * lines.count() as f64).sqrt();
            assert!(peak / rms < 2.0, "{samples}: {}", peak / rms);
        }
    }

    /// The zero crossings of the sweep are as far apart as the frequency there says, up and down alike,
    /// and there are as many as the mean frequency has cycles.
    #[test]
    fn the_chirp_sweeps_up_and_down() {
        let (samples, band) = (20_000, [20.0, 100.0]);
        let signal = chirp(samples, band);
        let crossings: Vec<usize> = (1..samples)
            .filter(|k| signal[k - 1] < 0.0 && signal[*k] >= 0.0)
            .collect();
        assert_eq!(crossings.len(), 59);
        for pair in crossings.windows(2) {
            let middle = 0.5 * (pair[0] + pair[1]) as f64 / samples as f64;
            let up = 1.0 - (2.0 * middle - 1.0).abs();
            let frequency = band[0] + (band[1] - band[0]) * up;
            let measured = samples as f64 / (pair[1] - pair[0]) as f64;
            assert!(
                (measured / frequency - 1.0).abs() < 0.05,
                "{measured} {frequency}"
            );
        }
        let sum: f64 = signal.iter().sum();
        assert!(sum.abs() < 1e-9);
    }

    /// A sine stands still at its extremes alone, and its path leads from one to the other. Beside a
    /// sine nine times as large and three times as fast the machine also turns half way.
    #[test]
    fn it_begins_where_the_machine_stands_still_and_the_way_is_short() {
        let sine = |cycles: f64, k: usize| (TAU * cycles * k as f64 / 1000.0).sin();
        let begun = begun_at_standstill((0..1000).map(|k| sine(1.0, k)).collect());
        assert!(begun[0].abs() > 0.999, "{}", begun[0]);

        let both = (0..1000).map(|k| sine(1.0, k) + 9.0 * sine(3.0, k));
        let steps = in_steps(&begun_at_standstill(both.collect()), 1000);
        let path = rigid(&steps, 1);
        let least = path.iter().copied().fold(0.0, f64::min);
        let greatest = path.iter().copied().fold(0.0, f64::max);
        assert!(greatest.max(-least) < 0.8 * (greatest - least));
    }

    /// After any number of repetitions the machine is exactly where it began, at rest.
    #[test]
    fn nothing_drifts() {
        for (signal, peak) in [
            (multisine(2048, 5..=111), 1000),
            (multisine(2048, 1..=1), 2000),
            (multisine(50, 1..=20), 30_000),
            (multisine(2047, 5..=7), 10),
            (chirp(2048, [5.3, 111.2]), 1000),
            (chirp(2000, [1.0, 1.4]), 1000),
        ] {
            let steps = in_steps(&begun_at_standstill(signal), peak);
            let path = rigid(&steps, 1000);
            let ends: Vec<f64> = path.chunks(steps.len()).map(|c| c[c.len() - 1]).collect();
            assert!(ends.iter().all(|end| *end == 0.0), "{:?}", &ends[..3]);
            let once = path[..steps.len()]
                .iter()
                .fold(0.0, |f: f64, x| f.max(x.abs()));
            let ever = path.iter().fold(0.0, |f: f64, x| f.max(x.abs()));
            assert_eq!(once, ever);
        }
    }

    proptest! {
        /// Whatever the signal: within the peak, no mean, no drift, never a step beside the signal
        /// but for the entries that were moved.
        #[test]
        fn rounding_keeps_the_sums(
            raw in prop::collection::vec(-1.0..1.0_f64, 8..300),
            peak in 20_i16..2000,
        ) {
            let mean = raw.iter().sum::<f64>() / raw.len() as f64;
            let signal: Vec<f64> = raw.iter().map(|x| x - mean).collect();
            let signal = begun_at_standstill(signal);
            let steps = in_steps(&signal, peak);
            prop_assert!(steps.iter().all(|step| step.abs() <= peak));
            prop_assert_eq!(steps.iter().map(|step| i64::from(*step)).sum::<i64>(), 0);
            let end = *rigid(&steps, 3).last().unwrap();
            prop_assert_eq!(end, 0.0);
        }
    }
}
