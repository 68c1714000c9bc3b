//! Margins of the loop, broken at the current command.
//!
//! The sampled loop from the command through plant, encoder, force observers, state observer and
//! regulator back to the command, evaluated at `z = e^{jωT}`. The observers are fed with the
//! command that the drive gives, as in the drive; what is varied is the current that flows in
//! answer to it.

use super::Design;
use super::drive_loop::DriveLoop;
use crate::error::{Error, Result};
use nalgebra::{Complex, DMatrix, DVector};
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
/// Decades below half the sample rate, at the least, and below the slowest pole of the regulator.
const DECADES: f64 = 5.0;
const BELOW: f64 = 2.0;

type C = Complex<f64>;

impl Margins {
    /// Of the drive's own loop, observers included.
    ///
    /// # Errors
    /// [`Error::Design`] when the response cannot be computed.
    pub fn of_drive(design: &Design) -> Result<Self> {
        let drive = DriveLoop::new(design);
        Self::of(design, |z, plant| {
            drive.response(z).map(|response| response * plant[0])
        })
    }

    /// Of feedback of the true state with the same gain: the bound.
    ///
    /// # Errors
    /// As [`Margins::of_drive`].
    pub fn of_full_state(design: &Design) -> Result<Self> {
        let gain = design.regulator.map(C::from);
        Self::of(design, |_, plant| Some(-(&gain * plant).x))
    }

    /// `command`: command in answer to the plant's state, so that `L = −command`.
    fn of(design: &Design, command: impl Fn(C, &DVector<C>) -> Option<C>) -> Result<Self> {
        let period = design.drive.control.sample_time;
        let nyquist = std::f64::consts::PI / period;
        let failed = || Error::Design("the loop's frequency response cannot be computed".into());
        let (ad, bd) = (design.ad.map(C::from), design.bd.map(C::from));
        let response = |omega: f64| -> Option<C> {
            let z = C::from_polar(1.0, omega * period);
            let matrix = DMatrix::identity(bd.len(), bd.len()) * z - &ad;
            let state = matrix.lu().solve(&bd)?;
            command(z, &state).map(|command| -command)
        };
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
        let slowest = design.regulator_decay()?;
        let decades = DECADES.max((nyquist / slowest).log10() + BELOW);
        let points = (GRID * decades).ceil() as usize;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;
    use crate::model::spectral_radius;

    fn design() -> Design {
        Design::new(&Drive::default_drive()).unwrap()
    }

    /// THEORY section 4: feedback of the full state has 24 dB and 6.3 ms. Independent of the frequency
    /// response: with six samples of delay in the loop its poles are inside the unit circle, with
    /// seven they are not, and the margin of 6.4 ms is between.
    #[test]
    fn full_state_margins_are_as_computed_elsewhere() {
        let margins = Margins::of_full_state(&design()).unwrap();
        println!("{margins:?}");
        assert!((margins.gain_margin_db.unwrap() - 24.0).abs() < 0.5);
        assert!((margins.delay_margin.unwrap() - 6.3e-3).abs() < 0.2e-3);
        let design = design();
        for (delay, stable) in [(6, true), (7, false)] {
            let n = design.ad.nrows();
            let mut closed = DMatrix::zeros(n + delay, n + delay);
            closed.view_mut((0, 0), (n, n)).copy_from(&design.ad);
            closed.view_mut((0, n), (n, 1)).copy_from(&design.bd);
            for i in 1..delay {
                closed[(n + i - 1, n + i)] = 1.0;
            }
            closed
                .view_mut((n + delay - 1, 0), (1, n))
                .copy_from(&-&design.regulator);
            assert_eq!(spectral_radius(&closed).unwrap() < 1.0, stable, "{delay}");
        }
    }

    /// Independent of the frequency response: at the gain margin the closed loop's largest pole is
    /// on the unit circle.
    #[test]
    fn the_loop_is_on_the_brink_at_its_gain_margin() {
        let design = design();
        let margin = Margins::of_full_state(&design)
            .unwrap()
            .gain_margin_db
            .unwrap();
        for (factor, stable) in [(0.99, true), (1.01, false)] {
            let gain = factor * 10_f64.powf(margin / 20.0);
            let closed = &design.ad - &design.bd * &design.regulator * gain;
            assert_eq!(spectral_radius(&closed).unwrap() < 1.0, stable);
        }
    }

    /// The drive itself in simulation: its motor's force scaled to just below the gain margin the
    /// loop settles, just above it does not.
    #[test]
    fn the_simulated_drive_agrees_with_its_gain_margin() {
        use crate::drive::PlantFile;
        use crate::scenario::Scenario;
        use crate::simulate::{Law, simulate};
        let design = design();
        let margins = Margins::of_drive(&design).unwrap();
        println!("{margins:?}");
        let margin = margins.gain_margin_db.unwrap();
        let swing = |factor: f64| {
            let mut plant = PlantFile::from(&design.drive);
            plant.actuator.force_constant *= factor * 10_f64.powf(margin / 20.0);
            let scenario = Scenario::named("fig4").unwrap();
            let run = simulate(&design, &plant, scenario, Law::Core, 3.0).unwrap();
            let end = run.samples[2500..].iter().map(|sample| sample.truth[0]);
            let (low, high) = end.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        let (below, above) = (swing(0.93), swing(1.07));
        println!("{below:e} {above:e}");
        assert!(below < 100e-6, "{below}");
        assert!(above > 1e-3, "{above}");
    }
}
