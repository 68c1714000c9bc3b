//! The linear filters that the force observers are made of, for one control period at a time.
//!
//! Coefficients apart from memory: a filter is plain data, what it remembers is the caller's. Generic
//! over the number, so that the drive runs them in `f32` and the analysis of its loop in `f64`.
//!
//! ```text
//! Lag         g / (s + g)                     y_k = a y_k−1 + (1 − a) u_k            a = exp(−g T)
//! SecondLag   the lag after a lag             exact for a u held over the period
//! Difference  s                               y_k = (u_k − u_k−1) / T
//! ```
//!
//! A difference through a lag is `s g / (s + g)` of unity low-frequency gain. The usual form, which
//! leaves the gain at `g`, weighs 28 % too low at `g T = 0.63`.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A floating-point number: `f32` on the drive, `f64` in its analysis.
pub trait Real:
    Copy
    + Default
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// One.
    const ONE: Self;

    /// `e^x − 1`, the same bits on every machine.
    #[must_use]
    fn exp_m1(self) -> Self;
}

impl Real for f32 {
    const ONE: Self = 1.0;

    fn exp_m1(self) -> Self {
        libm::expm1f(self)
    }
}

impl Real for f64 {
    const ONE: Self = 1.0;

    fn exp_m1(self) -> Self {
        libm::expm1(self)
    }
}

/// First-order low-pass filter `g / (s + g)`, exact for an input held over the period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag<T> {
    pole: T,
    /// One minus the pole, without its rounding.
    gain: T,
}

impl<T: Real> Lag<T> {
    /// * `cutoff`: `g`, rad/s
    /// * `sample_time`: `T`, s
    #[must_use]
    pub fn new(cutoff: T, sample_time: T) -> Self {
        let gain = -(-cutoff * sample_time).exp_m1();
        Self {
            pole: T::ONE - gain,
            gain,
        }
    }

    /// Pole `exp(−g T)`.
    #[must_use]
    pub fn pole(&self) -> T {
        self.pole
    }

    /// One period. The memory is the output.
    pub fn step(&self, memory: &mut T, input: T) -> T {
        *memory = self.pole * *memory + self.gain * input;
        *memory
    }
}

/// The second of two lags in a row, exact for an input of the first that is held over the period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondLag<T> {
    pole: T,
    /// Response to the first lag's output when the period began, and to the held input.
    first: T,
    input: T,
}

impl<T: Real> SecondLag<T> {
    /// * `first_cutoff`, `cutoff`: of the first and of this one, rad/s
    /// * `sample_time`: s
    #[must_use]
    pub fn new(first_cutoff: T, cutoff: T, sample_time: T) -> Self {
        let lag = Lag::new(cutoff, sample_time);
        // g₂ (a₁ − a₂) / (g₂ − g₁), written so that equal and nearly equal cutoffs lose no figures.
        let difference = (cutoff - first_cutoff) * sample_time;
        let ratio = if difference == T::default() {
            T::ONE
        } else {
            difference.exp_m1() / difference
        };
        let first = cutoff * sample_time * lag.pole * ratio;
        Self {
            pole: lag.pole,
            first,
            input: lag.gain - first,
        }
    }

    /// One period. The memory is the output.
    ///
    /// * `first`: output of the first lag when the period began
    /// * `input`: its input over the period
    pub fn step(&self, memory: &mut T, first: T, input: T) -> T {
        *memory = self.pole * *memory + self.first * first + self.input * input;
        *memory
    }
}

/// Difference over one period, `(u_k − u_k−1) / T`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference<T> {
    rate: T,
}

impl<T: Real> Difference<T> {
    /// * `sample_time`: `T`, s
    #[must_use]
    pub fn new(sample_time: T) -> Self {
        Self {
            rate: T::ONE / sample_time,
        }
    }

    /// A difference that is known already, per second.
    #[must_use]
    pub fn of(&self, difference: T) -> T {
        difference * self.rate
    }

    /// One period. The memory is the input.
    pub fn step(&self, memory: &mut T, input: T) -> T {
        let before = core::mem::replace(memory, input);
        self.of(input - before)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;

    /// Step responses of one lag and of two in closed form, for equal, unequal and nearly equal cutoffs.
    #[test]
    fn step_responses_are_the_continuous_filters() {
        for (g1, g2) in [
            (628.0, 628.0),
            (628.0, 200.0),
            (300.0, 900.0),
            (500.0, 500.001),
        ] {
            let (lag, second) = (Lag::new(g1, 1e-3), SecondLag::new(g1, g2, 1e-3));
            let (mut one, mut two) = (0.0, 0.0);
            for k in 1..=60 {
                second.step(&mut two, one, 1.0);
                lag.step(&mut one, 1.0);
                let t = f64::from(k) * 1e-3;
                assert!((one - (1.0 - (-g1 * t).exp())).abs() < 1e-13);
                let expected = if g1 == g2 {
                    1.0 - (1.0 + g1 * t) * (-g1 * t).exp()
                } else {
                    1.0 - (g2 * (-g1 * t).exp() - g1 * (-g2 * t).exp()) / (g2 - g1)
                };
                // The closed form itself loses figures where the cutoffs are nearly equal.
                assert!((two - expected).abs() < 1e-9, "{g1} {g2}: {two} {expected}");
            }
        }
    }

    proptest! {
        /// Difference and lag commute, and a ramp comes out as its slope.
        #[test]
        fn a_filtered_difference_has_unity_gain(
            cutoff in 1.0_f64..5000.0,
            slope in -10.0_f64..10.0,
        ) {
            let (lag, difference) = (Lag::new(cutoff, 1e-3), Difference::new(1e-3));
            let (mut before, mut out) = (0.0, 0.0);
            for k in 1..20_000 {
                let velocity = difference.step(&mut before, slope * f64::from(k) * 1e-3);
                lag.step(&mut out, velocity);
            }
            prop_assert!((out - slope).abs() < 1e-6);
        }

        /// `f32` is `f64` within its rounding.
        #[test]
        fn both_numbers_give_the_same(
            cutoff in 1.0_f32..5000.0,
            inputs in prop::collection::vec(-1.0_f32..1.0, 1..100),
        ) {
            let (narrow, wide) = (Lag::new(cutoff, 1e-3), Lag::new(f64::from(cutoff), 1e-3));
            let (mut a, mut b) = (0.0, 0.0);
            for input in inputs {
                narrow.step(&mut a, input);
                wide.step(&mut b, f64::from(input));
                // Poles near one remember the rounding of many periods.
                prop_assert!((f64::from(a) - b).abs() < 1e-5);
            }
        }
    }
}
