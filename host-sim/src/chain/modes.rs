//! The flexible modes of a chain.

use super::Chain;
use nalgebra::DMatrix;

/// One flexible mode of the free chain.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Mode {
    /// Undamped frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio; 1 and above: no oscillation.
    pub damping_ratio: f64,
    /// Amplitude of each mass, actuator first; the largest is 1.
    pub shape: Vec<f64>,
}

impl Chain {
    /// The flexible modes, slowest first. The rigid motion is left out.
    ///
    /// From the eigenvectors of the undamped chain and the damping along each of them; exact
    /// where the damping is proportional to the stiffness, as good as the damping is light
    /// elsewhere.
    #[must_use]
    pub fn modes(&self) -> Vec<Mode> {
        let n = self.mass.len();
        let assemble = |springs: &[f64]| {
            let mut matrix = DMatrix::<f64>::zeros(n, n);
            for (i, value) in springs.iter().enumerate() {
                let value = *value;
                matrix[(i, i)] += value / self.mass[i];
                matrix[(i + 1, i + 1)] += value / self.mass[i + 1];
                let across = value / (self.mass[i] * self.mass[i + 1]).sqrt();
                matrix[(i, i + 1)] -= across;
                matrix[(i + 1, i)] -= across;
            }
            matrix
        };
        let mut damping = assemble(&self.damping);
        for (mass, viscous) in (1..n).zip(&self.ground) {
            damping[(mass, mass)] += viscous / self.mass[mass];
        }
        let eigen = assemble(&self.stiffness).symmetric_eigen();
        let mut modes: Vec<Mode> = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
            .map(|(square, vector)| {
                let omega = square.max(0.0).sqrt();
                let along = (vector.transpose() * &damping * vector).x;
                let amplitudes = vector.iter().zip(&self.mass);
                let shape: Vec<f64> = amplitudes.map(|(v, mass)| v / mass.sqrt()).collect();
                let largest = shape.iter().copied().fold(0.0, |largest: f64, amplitude| {
                    if amplitude.abs() > largest.abs() {
                        amplitude
                    } else {
                        largest
                    }
                });
                Mode {
                    frequency_hz: omega / std::f64::consts::TAU,
                    damping_ratio: along / (2.0 * omega),
                    shape: shape.iter().map(|amplitude| amplitude / largest).collect(),
                }
            })
            .collect();
        modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        // The slowest is the rigid motion.
        modes.remove(0);
        modes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Modes of the reference rig as `arso_core::theory`, (1), has them: 11.9, 25.9, 36.3 Hz, 1.2 to 3.8 %.
    /// Two equal masses on one spring: ω² = 2 k / m, in closed form.
    #[test]
    fn modes_of_known_chains() {
        let modes = Chain::of_table_1(300.0, 0.1).modes();
        let expected = [11.9, 25.9, 36.3];
        for (mode, expected) in modes.iter().zip(expected) {
            assert!((mode.frequency_hz - expected).abs() < 0.05, "{mode:?}");
            assert!((0.012..0.0385).contains(&mode.damping_ratio), "{mode:?}");
        }

        let pair = Chain {
            mass: vec![0.5, 0.5],
            stiffness: vec![100.0],
            damping: vec![0.2],
            viscous: 0.0,
            ground: Vec::new(),
            force_constant: 1.0,
        };
        let mode = &pair.modes()[0];
        // Equal masses swing against each other.
        assert!((mode.shape[0] + mode.shape[1]).abs() < 1e-12);
        assert!((mode.shape[0].abs() - 1.0).abs() < 1e-12);
        let omega = 400.0_f64.sqrt();
        assert!((mode.frequency_hz * std::f64::consts::TAU - omega).abs() < 1e-9);
        assert!((mode.damping_ratio - 0.8 / (2.0 * omega)).abs() < 1e-12);
    }
}
