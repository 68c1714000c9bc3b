//! Notch filter: takes a narrow band out of a command.
//!
//! ```text
//!           s² + 2 ζ_z ω s + ω²
//! N(s)  =  ---------------------
//!           s² + 2 ζ_p ω s + ω²
//! ```
//!
//! bilinear with its centre kept where it is (prewarped); gain 1 at rest, `ζ_z / ζ_p` at the centre.

/// A notch.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Centre `ω`, rad/s; below half the sampling.
    pub centre: f64,
    /// Damping ratio of its zeros, `ζ_z`.
    pub depth: f64,
    /// Damping ratio of its poles, `ζ_p`.
    pub width: f64,
}

/// Coefficients and memory, transposed direct form II: `y = b_0 x + m_0`.
#[derive(Clone, Debug)]
pub(super) struct Notch {
    b: [f64; 3],
    a: [f64; 2],
    memory: [f64; 2],
}

/// Largest centre, over the sampling's half.
const HIGHEST: f64 = 0.95;

impl Notch {
    /// * `period`: s
    pub(super) fn new(settings: &Settings, period: f64) -> Self {
        let half = 0.5 * settings.centre * period;
        let w = half.min(HIGHEST * std::f64::consts::FRAC_PI_2).tan();
        let part = |damping: f64| [1.0, 2.0 * damping * w, w * w];
        let discrete = |[s2, s1, s0]: [f64; 3]| [s2 + s1 + s0, 2.0 * (s0 - s2), s2 - s1 + s0];
        let (zeros, poles) = (
            discrete(part(settings.depth)),
            discrete(part(settings.width)),
        );
        Self {
            b: zeros.map(|value| value / poles[0]),
            a: [poles[1] / poles[0], poles[2] / poles[0]],
            memory: [0.0; 2],
        }
    }

    /// One sample.
    pub(super) fn step(&mut self, x: f64) -> f64 {
        let y = self.b[0] * x + self.memory[0];
        self.memory = [
            self.b[1] * x - self.a[0] * y + self.memory[1],
            self.b[2] * x - self.a[1] * y,
        ];
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude that is left of a sine after a long time.
    fn left(omega: f64) -> f64 {
        let settings = Settings {
            centre: 100.0,
            depth: 0.05,
            width: 0.5,
        };
        let mut notch = Notch::new(&settings, 1e-3);
        let output = (0..4000).map(|k| notch.step((omega * f64::from(k) * 1e-3).sin()));
        output
            .skip(2000)
            .fold(0.0, |most, y| f64::max(most, y.abs()))
    }

    #[test]
    fn takes_out_its_centre_and_leaves_the_rest() {
        assert!((left(100.0) - 0.1).abs() < 2e-3, "{}", left(100.0));
        assert!((left(8.0) - 1.0).abs() < 1e-2 && (left(2000.0) - 1.0).abs() < 1e-2);
        // At rest it is one.
        let settings = Settings {
            centre: 100.0,
            depth: 0.05,
            width: 0.5,
        };
        let mut notch = Notch::new(&settings, 1e-3);
        let last = (0..1000).map(|_| notch.step(1.0)).last().unwrap();
        assert!((last - 1.0).abs() < 1e-9);
    }
}
