//! Margins of a sampled loop from its frequency response.

use super::Result;
use crate::error::NoSolution;
use nalgebra::Complex;
use serde::Serialize;

/// How far the loop is from instability.
#[derive(Clone, Debug, Serialize)]
pub struct Margins {
    /// How much the loop gain can grow, dB; none when growth alone never destabilises.
    pub gain_margin_db: Option<f64>,
    /// How much it can shrink, dB, negative; none when shrinking alone never destabilises.
    pub gain_reduction_db: Option<f64>,
    /// Degrees; none when the gain never crosses one.
    pub phase_margin_deg: Option<f64>,
    /// Additional delay that destabilises, s.
    pub delay_margin: Option<f64>,
    /// Largest magnitude of the sensitivity `1 / (1 + L)`.
    pub peak_sensitivity: f64,
    /// Where that is, Hz.
    pub peak_sensitivity_hz: f64,
}

/// Frequencies looked at in each decade: logarithmic, fine enough for the peaks of damping ratios of
/// 0.1 %.
const GRID: f64 = 8000.0;
/// The same for a first look, which misses what vibrates with less than a few per cent.
const COARSE: f64 = 150.0;
/// Decades below half the sample rate, at the least, and below the slowest pole of the regulator.
const DECADES: f64 = 5.0;
const BELOW: f64 = 2.0;

type C = Complex<f64>;

impl Margins {
    /// Of a loop `L` with negative feedback around it, `1 + L`.
    ///
    /// * `response`: `L` over the angular frequency, rad/s; none where it cannot be computed
    /// * `nyquist`: half the sample rate, rad/s
    /// * `slowest`: how slow what matters in the loop may be, rad/s
    ///
    /// # Errors
    /// [`NoSolution`] when the response cannot be computed.
    pub fn new(response: impl Fn(f64) -> Option<C>, nyquist: f64, slowest: f64) -> Result<Self> {
        Self::on_grid(GRID, response, nyquist, slowest)
    }

    /// A first look, fifty times as fast as [`new`](Self::new): sharp peaks may be missed, so that margins may be
    /// less than it says.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn coarse(response: impl Fn(f64) -> Option<C>, nyquist: f64, slowest: f64) -> Result<Self> {
        Self::on_grid(COARSE, response, nyquist, slowest)
    }

    fn on_grid(
        grid: f64,
        response: impl Fn(f64) -> Option<C>,
        nyquist: f64,
        slowest: f64,
    ) -> Result<Self> {
        // What is no number is nowhere near the brink, and would hide one.
        let response = |omega: f64| response(omega).filter(|l| l.is_finite());
        let failed = || NoSolution("the loop's frequency response cannot be computed".into());
        let mut margins = Self {
            gain_margin_db: None,
            gain_reduction_db: None,
            phase_margin_deg: None,
            delay_margin: None,
            peak_sensitivity: 0.0,
            peak_sensitivity_hz: 0.0,
        };
        let mut peak = 0;
        let mut last: Option<(f64, C)> = None;
        let decades = DECADES.max((nyquist / slowest).log10() + BELOW);
        let points = (grid * decades).ceil() as usize;
        let frequency = |k: usize| {
            let exponent = decades * (k as f64 / (points - 1) as f64 - 1.0);
            nyquist * 10_f64.powf(exponent)
        };
        for k in 0..points {
            let omega = frequency(k);
            let l = response(omega).ok_or_else(failed)?;
            let sensitivity = 1.0 / (1.0 + l).norm();
            if sensitivity > margins.peak_sensitivity {
                margins.peak_sensitivity = sensitivity;
                peak = k;
            }
            if let Some(before) = last {
                margins
                    .cross(before, (omega, l), &response)
                    .ok_or_else(failed)?;
            }
            last = Some((omega, l));
        }
        let around = (
            frequency(peak.saturating_sub(1)),
            frequency((peak + 1).min(points - 1)),
        );
        let (omega, distance) =
            least(around, |omega| response(omega).map(|l| (1.0 + l).norm())).ok_or_else(failed)?;
        margins.peak_sensitivity = margins.peak_sensitivity.max(1.0 / distance);
        margins.peak_sensitivity_hz = omega / std::f64::consts::TAU;
        // At half the sample rate the response is real.
        if let Some((_, l)) = last
            && l.re < 0.0
        {
            margins.gain_limit(l.norm());
        }
        Ok(margins)
    }

    /// Between two neighbouring frequencies: where the loop crosses the negative real axis, and
    /// where its magnitude crosses one.
    fn cross(
        &mut self,
        (omega_0, a): (f64, C),
        (omega_1, b): (f64, C),
        response: &impl Fn(f64) -> Option<C>,
    ) -> Option<()> {
        let between = (omega_0, omega_1);
        if a.re < 0.0 && b.re < 0.0 && a.im.signum() != b.im.signum() {
            let omega = root(between, |omega| response(omega).map(|l| l.im))?;
            self.gain_limit(response(omega)?.norm());
        }
        if (a.norm() < 1.0) != (b.norm() < 1.0) {
            let omega = root(between, |omega| response(omega).map(|l| l.norm().ln()))?;
            // Phase above −180°, in (−180°, 180°].
            let phase = (-response(omega)?).arg();
            let margin = phase.abs().to_degrees();
            self.phase_margin_deg = Some(self.phase_margin_deg.map_or(margin, |m| m.min(margin)));
            let lag = if phase < 0.0 {
                phase + std::f64::consts::TAU
            } else {
                phase
            };
            let delay = lag / omega;
            self.delay_margin = Some(self.delay_margin.map_or(delay, |d| d.min(delay)));
        }
        Some(())
    }

    fn gain_limit(&mut self, magnitude: f64) {
        let margin = -20.0 * magnitude.log10();
        if margin > 0.0 {
            let least = self.gain_margin_db.map_or(margin, |m| m.min(margin));
            self.gain_margin_db = Some(least);
        } else {
            let least = self.gain_reduction_db.map_or(margin, |m| m.max(margin));
            self.gain_reduction_db = Some(least);
        }
    }
}

/// Where a function changes its sign, by bisection to the last figure.
fn root((mut low, mut high): (f64, f64), function: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let rising = function(high)? > function(low)?;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if (function(middle)? > 0.0) == rising {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(0.5 * (low + high))
}

/// Where a function with one valley is least, and its value there, by thirds.
fn least(
    (mut low, mut high): (f64, f64),
    function: impl Fn(f64) -> Option<f64>,
) -> Option<(f64, f64)> {
    for _ in 0..60 {
        let third = (high - low) / 3.0;
        if function(low + third)? < function(high - third)? {
            high -= third;
        } else {
            low += third;
        }
    }
    let middle = 0.5 * (low + high);
    Some((middle, function(middle)?))
}
