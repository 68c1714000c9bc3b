//! Half a period of a signal: its shape, where it begins, and its rounding to whole steps.
//!
//! The second half of a period is the first upside down, `i_{k+N/2} = −i_k`: the signal then consists
//! of odd multiples of 1 / period alone. With every multiple in it, forwards and backwards differ, and
//! Coulomb friction, which takes the same force off in either direction, makes a rectifier of the
//! machine: it creeps, by more than it vibrates, as long as it is excited. What is the same upside down
//! half a period later stays so in any machine whose friction is the same in both directions, and can
//! creep nowhere.

use std::f64::consts::{PI, TAU};

/// Sum of cosines of equal amplitude with Schroeder's phases, `−π n (n − 1) / count` for the
/// `n`-th of them: the frequency then passes through the band once per period, like a sweep, and
/// the peak stays near that of a single sine instead of growing with the number of lines.
///
/// * `half`: entries of half a period
/// * `lines`: cycles of each cosine in a whole period: odd, below `half`
pub(super) fn multisine(half: usize, lines: &[usize]) -> Vec<f64> {
    // Every cosine is made of the same values, taken at its own pace.
    let samples = 2 * half;
    let value = |k: usize| (TAU * k as f64 / samples as f64).sin_cos();
    let circle: Vec<(f64, f64)> = (0..samples).map(value).collect();
    let mut signal = vec![0.0; half];
    for (n, line) in lines.iter().enumerate() {
        let n = (n + 1) as f64;
        let (sin, cos) = (-PI * n * (n - 1.0) / lines.len() as f64).sin_cos();
        let mut at = 0;
        for sum in &mut signal {
            let (s, c) = circle[at];
            *sum += c * cos - s * sin;
            at = (at + line) % samples;
        }
    }
    signal
}

/// A sine whose frequency rises linearly from one end of the band to the other and falls back, in
/// half a period. A whole number and a half of cycles (the band is scaled by that little) leads on to
/// the same upside down.
///
/// * `half`: entries of half a period
/// * `band`: cycles in half a period
pub(super) fn chirp(half: usize, [from, to]: [f64; 2]) -> Vec<f64> {
    let mean = 0.5 * (from + to);
    let cycles = mean.floor() + 0.5;
    let scale = cycles / mean;
    let rising = |u: f64| scale * (from * u + (to - from) * u * u);
    let sample = |k: usize| {
        let u = k as f64 / half as f64;
        let phase = if u <= 0.5 {
            rising(u)
        } else {
            cycles - rising(1.0 - u)
        };
        (TAU * phase).sin()
    };
    (0..half).map(sample).collect()
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
/// near to it as entries are. What is left is less than an entry, and is spread evenly over the half
/// period.
///
/// `S` passes its mean many times; the path leads equally far to either side, so that it is shortest
/// from the entry nearest to its middle.
pub(super) fn begun_at_standstill(signal: &[f64]) -> Vec<f64> {
    let half = signal.len();
    // Entry `half` of velocity and path is entry 0 upside down.
    let integrated = |rate: &dyn Fn(usize) -> f64| {
        let mut sum = 0.0;
        let mut sums: Vec<f64> = (0..=half)
            .map(|k| {
                let before = sum;
                sum += rate(k);
                before
            })
            .collect();
        let middle = 0.5 * sums[half];
        for sum in &mut sums {
            *sum -= middle;
        }
        sums
    };
    let velocity = integrated(&|k| signal[k % half]);
    // Exact: the acceleration is constant from entry to entry.
    let path = integrated(&|k| 0.5 * (velocity[k] + velocity[(k + 1).min(half)]));
    let start = (0..half)
        .filter(|k| velocity[*k] * velocity[k + 1] <= 0.0)
        .map(|k| k + usize::from(velocity[k].abs() > velocity[k + 1].abs()))
        .min_by(|a, b| path[*a].abs().total_cmp(&path[*b].abs()))
        .unwrap_or(0);
    let (before, after) = signal.split_at(start.min(half));
    let mut shifted = after.to_vec();
    shifted.extend(before.iter().map(|current| -current));
    // The sum of half a period is the velocity that the machine would have had to begin with, twice.
    let rest = shifted.iter().sum::<f64>() / half as f64;
    for current in &mut shifted {
        *current -= rest;
    }
    shifted
}

/// A whole period in whole steps, the largest being `peak`.
///
/// Each rounding error is carried into the next entry, so that the running sum, which is the
/// machine's velocity, is never off by more than half a step, and the sum of either half is exactly
/// zero, as the signal's is: a rigid machine ends every repetition where it began it, however many
/// there are.
///
/// * `signal`: half a period, without mean, not all zero
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
    let upside_down: Vec<i16> = steps.iter().map(|step| -step).collect();
    steps.extend(upside_down);
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn odd(from: usize, to: usize) -> Vec<usize> {
        (from..=to).step_by(2).collect()
    }

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

    fn farthest(path: &[f64]) -> f64 {
        path.iter().fold(0.0, |f: f64, x| f.max(x.abs()))
    }

    /// Every cosine by its own formula, at a few places.
    #[test]
    fn the_multisine_is_its_formula() {
        let signal = multisine(50, &odd(3, 11));
        for k in [0, 1, 17, 25, 49] {
            let cosines = (1..=5).map(|n| {
                let n = f64::from(n);
                let phase = -PI * n * (n - 1.0) / 5.0;
                (TAU * (2.0 * n + 1.0) * k as f64 / 100.0 + phase).cos()
            });
            assert!((signal[k] - cosines.sum::<f64>()).abs() < 1e-12);
        }
    }

    /// Schroeder's phases keep the crest factor below 2; phases of zero would make it √(2 lines).
    #[test]
    fn the_multisine_has_a_low_peak() {
        for (half, from, to) in [(1024, 5, 111), (1024, 5, 21), (10_000, 11, 3999)] {
            let lines = odd(from, to);
            let peak = farthest(&multisine(half, &lines));
            let rms = (0.5 * lines.len() as f64).sqrt();
            assert!(peak / rms < 2.0, "{half}: {}", peak / rms);
        }
    }

    /// The zero crossings of the sweep are as far apart as the frequency there says, up and down alike,
    /// there are as many as the mean frequency has cycles, and the next half goes on from there.
    #[test]
    fn the_chirp_sweeps_up_and_down() {
        let (half, band) = (20_000, [20.0, 100.0]);
        let signal = chirp(half, band);
        let crossings: Vec<usize> = (1..half)
            .filter(|k| signal[k - 1] < 0.0 && signal[*k] >= 0.0)
            .collect();
        assert_eq!(crossings.len(), 60);
        for pair in crossings.windows(2) {
            let middle = 0.5 * (pair[0] + pair[1]) as f64 / half as f64;
            let up = 1.0 - (2.0 * middle - 1.0).abs();
            let frequency = band[0] + (band[1] - band[0]) * up;
            let measured = half as f64 / (pair[1] - pair[0]) as f64;
            assert!(
                (measured / frequency - 1.0).abs() < 0.05,
                "{measured} {frequency}"
            );
        }
        let (rising, falling) = (signal[1] - signal[0], -signal[0] - signal[half - 1]);
        assert!(rising > 0.0 && (falling / -rising - 1.0).abs() < 0.01);
    }

    /// A sine stands still at its extremes alone, and its path leads from one to the other. Beside a
    /// sine nine times as large and three times as fast the machine also turns half way.
    #[test]
    fn it_begins_where_the_machine_stands_still_and_the_way_is_short() {
        let sine = |cycles: f64, k: usize| (TAU * cycles * k as f64 / 1000.0).sin();
        let one: Vec<f64> = (0..500).map(|k| sine(1.0, k)).collect();
        // But for an entry's share in what is left.
        assert!(begun_at_standstill(&one)[0].abs() > 0.99);

        let both: Vec<f64> = (0..500)
            .map(|k| sine(1.0, k) + 9.0 * sine(3.0, k))
            .collect();
        let path = rigid(&in_steps(&begun_at_standstill(&both), 1000), 1);
        let least = path.iter().copied().fold(0.0, f64::min);
        let greatest = path.iter().copied().fold(0.0, f64::max);
        assert!(farthest(&path) < 0.8 * (greatest - least));
    }

    /// After any number of repetitions the machine is exactly where it began, at rest.
    #[test]
    fn nothing_drifts() {
        for (signal, peak) in [
            (multisine(1024, &odd(5, 111)), 1000),
            (multisine(1024, &[1]), 2000),
            (multisine(25, &odd(1, 19)), 32_767),
            (multisine(1023, &odd(5, 7)), 10),
            (chirp(1024, [5.3, 111.2]), 1000),
            (chirp(1000, [0.5, 0.7]), 1000),
        ] {
            let steps = in_steps(&begun_at_standstill(&signal), peak);
            let path = rigid(&steps, 1000);
            let ends: Vec<f64> = path.chunks(steps.len()).map(|c| c[c.len() - 1]).collect();
            assert!(ends.iter().all(|end| *end == 0.0), "{:?}", &ends[..3]);
            assert_eq!(farthest(&path[..steps.len()]), farthest(&path));
        }
    }

    proptest! {
        /// Whatever the signal: within the peak and near the signal, without mean, without drift, the
        /// same upside down.
        #[test]
        fn rounding_keeps_the_sums(
            raw in prop::collection::vec(-1.0..1.0_f64, 8..300),
            peak in 10_i16..=i16::MAX,
        ) {
            let signal = begun_at_standstill(&raw);
            let steps = in_steps(&signal, peak);
            prop_assert_eq!(steps.len(), 2 * raw.len());
            prop_assert_eq!(steps.iter().map(|step| step.abs()).max(), Some(peak));
            prop_assert_eq!(*rigid(&steps, 3).last().unwrap(), 0.0);
            let (first, second) = steps.split_at(raw.len());
            let scale = f64::from(peak) / farthest(&signal);
            for ((a, b), x) in first.iter().zip(second).zip(&signal) {
                prop_assert_eq!(*a, -*b);
                prop_assert!((f64::from(*a) - scale * x).abs() <= 1.0 + 1e-9);
            }
        }
    }
}
