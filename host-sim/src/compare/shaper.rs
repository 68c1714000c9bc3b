//! Input shapers: the reference in two or three parts, each half a period of the vibration later, so
//! that what one part excites the next takes away.
//!
//! With `K = exp(−ζ π / √(1 − ζ²))` and the half period `π / ω_d` (Singer and Seering, J. Dyn. Sys.
//! Meas. Control 112, 1990; EI with a tolerated vibration of 5 %: Singhose, Seering and Singer,
//! J. Mech. Design 116, 1994; MZV, three parts in three quarters of the time of ZVD: the firmware Klipper,
//! there with `K' = exp(−¾ ζ π / √(1 − ζ²))` and parts 3/8 of a period apart):
//!
//! ```text
//! ZV   1, K                              ZVD  1, 2 K, K²
//! EI   (1 + V)/4, (1 − V)/2 K, (1 + V)/4 K²
//! MZV  1 − 1/√2, (√2 − 1) K', (1 − 1/√2) K'²         each over their sum
//! ```

use std::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2};

/// Vibration that EI tolerates at the frequency it is made for.
const TOLERATED: f64 = 0.05;

/// Which shaper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shaper {
    /// One part: nothing shaped.
    None,
    /// Zero vibration.
    Zv,
    /// Zero vibration and derivative.
    Zvd,
    /// Extra insensitive.
    Ei,
    /// Modified zero vibration.
    Mzv,
}

impl Shaper {
    /// The parts: share of the whole, and when, s.
    ///
    /// * `frequency`: undamped, rad/s
    /// * `damping`: ratio, below 1
    #[must_use]
    pub fn parts(self, frequency: f64, damping: f64) -> Vec<(f64, f64)> {
        let damped = (1.0 - damping * damping).sqrt();
        // Between two parts, over half a period.
        let apart = if self == Shaper::Mzv { 0.75 } else { 1.0 };
        let k = (-apart * damping * PI / damped).exp();
        let shares = match self {
            Shaper::None => vec![1.0],
            Shaper::Zv => vec![1.0, k],
            Shaper::Zvd => vec![1.0, 2.0 * k, k * k],
            Shaper::Ei => {
                let (outer, inner) = ((1.0 + TOLERATED) / 4.0, (1.0 - TOLERATED) / 2.0);
                vec![outer, inner * k, outer * k * k]
            }
            Shaper::Mzv => {
                let (outer, inner) = (1.0 - FRAC_1_SQRT_2, SQRT_2 - 1.0);
                vec![outer, inner * k, outer * k * k]
            }
        };
        let sum: f64 = shares.iter().sum();
        let step = apart * PI / (frequency * damped);
        let parts = shares.iter().enumerate();
        parts
            .map(|(i, share)| (share / sum, i as f64 * step))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left of a vibration of frequency `w` after all parts, over that of one part: the length
    /// of the sum of the parts as phasors.
    fn left(shaper: Shaper, made_for: f64, w: f64, damping: f64) -> f64 {
        let damped = w * (1.0 - damping * damping).sqrt();
        let (re, im) =
            shaper
                .parts(made_for, damping)
                .iter()
                .fold((0.0, 0.0), |(re, im), (share, time)| {
                    let grown = share * (damping * w * time).exp();
                    (
                        re + grown * (damped * time).cos(),
                        im + grown * (damped * time).sin(),
                    )
                });
        let end = shaper.parts(made_for, damping).last().unwrap().1;
        f64::hypot(re, im) * (-damping * w * end).exp()
    }

    #[test]
    fn zv_zvd_and_mzv_leave_nothing_and_ei_five_per_cent() {
        for damping in [0.0, 0.02, 0.2] {
            assert!(left(Shaper::Zv, 30.0, 30.0, damping) < 1e-12);
            assert!(left(Shaper::Zvd, 30.0, 30.0, damping) < 1e-12);
            assert!(left(Shaper::Mzv, 30.0, 30.0, damping) < 1e-12);
        }
        assert!((left(Shaper::Ei, 30.0, 30.0, 0.0) - TOLERATED).abs() < 1e-12);
        // MZV takes three quarters of a period.
        let last = Shaper::Mzv.parts(30.0, 0.0).last().unwrap().1;
        assert!((last - 0.75 * std::f64::consts::TAU / 30.0).abs() < 1e-12);
        // ZVD is flat where ZV is not; EI leaves the tolerated 5 % over the widest band.
        let off = |shaper| left(shaper, 30.0, 30.0 * 1.1, 0.0);
        assert!(off(Shaper::Zvd) < 0.2 * off(Shaper::Zv));
        assert!(off(Shaper::Ei) < TOLERATED);
    }
}
