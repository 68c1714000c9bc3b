//! The chain of masses as a linear model: actuator, springs, dampers, loads.
//!
//! State order `x_a v_a x_1 v_1 … x_n v_n` (the paper's A after section IV, with every mass,
//! stiffness and damping its own). Forces push outwards: spring `j` between mass `j − 1` and
//! mass `j` (the actuator is mass 0) gives `k_j (x_{j−1} − x_j) + c_j (v_{j−1} − v_j)`.

use crate::drive::{Actuator, Load};
use crate::error::{Error, Result};
use nalgebra::{Complex, DMatrix, DVector, RowDVector};

/// Masses, springs and dampers of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// Mass of the actuator, then of each load, kg.
    pub mass: Vec<f64>,
    /// Stiffness of each spring, from the actuator outwards, N/m.
    pub stiffness: Vec<f64>,
    /// Damping beside each spring, N s/m.
    pub damping: Vec<f64>,
    /// Viscous friction of the actuator against the ground, N s/m.
    pub viscous: f64,
    /// Force constant, N/A.
    pub force_constant: f64,
}

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
    /// The chain as actually known: nominal values plus identified deviations.
    #[must_use]
    pub fn new(actuator: &Actuator, loads: &[Load], viscous: f64) -> Self {
        let masses = std::iter::once(actuator.actual_mass());
        Self {
            mass: masses.chain(loads.iter().map(|load| load.mass)).collect(),
            stiffness: loads.iter().map(|load| load.stiffness).collect(),
            damping: loads.iter().map(|load| load.damping).collect(),
            viscous,
            force_constant: actuator.actual_force_constant(),
        }
    }

    /// Number of load masses.
    #[must_use]
    pub fn loads(&self) -> usize {
        self.stiffness.len()
    }

    /// Number of states, two per mass.
    #[must_use]
    pub fn states(&self) -> usize {
        2 * self.mass.len()
    }

    /// System matrix `A` of the free chain.
    #[must_use]
    pub fn a(&self) -> DMatrix<f64> {
        let mut a = DMatrix::zeros(self.states(), self.states());
        for element in 0..self.mass.len() {
            a[(2 * element, 2 * element + 1)] = 1.0;
        }
        a[(1, 1)] = -self.viscous / self.mass[0];
        for (spring, (k, c)) in self.stiffness.iter().zip(&self.damping).enumerate() {
            let (inner, outer) = (2 * spring, 2 * spring + 2);
            for (element, sign) in [(inner, -1.0), (outer, 1.0)] {
                let scale = sign / self.mass[element / 2];
                a[(element + 1, inner)] += scale * k;
                a[(element + 1, inner + 1)] += scale * c;
                a[(element + 1, outer)] -= scale * k;
                a[(element + 1, outer + 1)] -= scale * c;
            }
        }
        a
    }

    /// Input `B` of the motor current, per A.
    #[must_use]
    pub fn b(&self) -> DVector<f64> {
        self.force_input(0) * self.force_constant
    }

    /// Input of a force on one mass, per N.
    #[must_use]
    pub fn force_input(&self, mass: usize) -> DVector<f64> {
        let mut b = DVector::zeros(self.states());
        b[2 * mass + 1] = 1.0 / self.mass[mass];
        b
    }

    /// Output row of the reaction force, `C_f = [k c −k −c 0 …]`, N.
    #[must_use]
    pub fn reaction_force(&self) -> RowDVector<f64> {
        let mut c = RowDVector::zeros(self.states());
        let (k, d) = (self.stiffness[0], self.damping[0]);
        for (column, value) in [k, d, -k, -d].into_iter().enumerate() {
            c[column] = value;
        }
        c
    }

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
        let damping = assemble(&self.damping);
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

/// Eigenvalues of a square matrix.
///
/// # Errors
/// [`Error::Design`] when the iteration does not converge.
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>> {
    // Metres and newtons in one matrix are decades apart; the iteration wants rows like columns.
    let mut balanced = matrix.clone();
    nalgebra::linalg::balancing::balance_parlett_reinsch(&mut balanced);
    let n = matrix.nrows();
    // Entries count as zero against their neighbours on the diagonal: as sharply as rounding allows, or
    // else less so, or else, for eigenvalues of zero with too few eigenvectors (pure delays), with all
    // eigenvalues moved away from zero.
    let size = balanced.amax();
    let attempts = [(0.0, 1.0), (0.0, 16.0), (size, 16.0), (size, 256.0)];
    let schur = attempts.into_iter().find_map(|(shift, roundings)| {
        let moved = &balanced + DMatrix::identity(n, n) * shift;
        let schur = nalgebra::Schur::try_new(moved, roundings * f64::EPSILON, 1000)?;
        Some((schur, shift))
    });
    let (schur, shift) =
        schur.ok_or_else(|| Error::Design("an eigenvalue iteration did not converge".into()))?;
    // Read off the blocks on the diagonal here: the crate's own reading takes the root of a negative
    // number where rounding makes a real pair of what stands in one block.
    let (_, t) = schur.unpack();
    let mut eigenvalues = Vec::with_capacity(n);
    let mut i = 0;
    while i < n {
        if i + 1 == n || t[(i + 1, i)] == 0.0 {
            eigenvalues.push(Complex::from(t[(i, i)]));
            i += 1;
            continue;
        }
        let mean = 0.5 * (t[(i, i)] + t[(i + 1, i + 1)]);
        let half = 0.5 * (t[(i, i)] - t[(i + 1, i + 1)]);
        let root = Complex::from(half * half + t[(i, i + 1)] * t[(i + 1, i)]).sqrt();
        eigenvalues.extend([root + mean, -root + mean]);
        i += 2;
    }
    for value in &mut eigenvalues {
        *value -= shift;
    }
    if eigenvalues.iter().all(|value| value.is_finite()) {
        Ok(eigenvalues)
    } else {
        Err(Error::Design("an eigenvalue is not finite".into()))
    }
}

/// Smallest distance between two of the eigenvalues, relative to the largest of them.
#[must_use]
pub fn separation(eigenvalues: &[Complex<f64>]) -> f64 {
    let largest = eigenvalues
        .iter()
        .map(|pole| pole.norm())
        .fold(0.0, f64::max);
    let pairs = eigenvalues.iter().enumerate();
    let distances = pairs.flat_map(|(i, a)| eigenvalues[..i].iter().map(move |b| (a - b).norm()));
    distances.fold(f64::INFINITY, f64::min) / largest
}

/// Largest magnitude of the eigenvalues.
///
/// # Errors
/// As [`eigenvalues`].
pub fn spectral_radius(matrix: &DMatrix<f64>) -> Result<f64> {
    let poles = eigenvalues(matrix)?;
    Ok(poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    /// Modes of the reference rig as THEORY states them: 11.9, 25.9, 36.3 Hz, 1.2 to 3.8 %.
    /// Two equal masses on one spring: ω² = 2 k / m, in closed form.
    #[test]
    fn modes_of_known_chains() {
        let drive = Drive::default_drive();
        let modes = Chain::new(&drive.actuator, &drive.loads, 0.0).modes();
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

    /// A double pole: rounding may make a real pair in one block of it, which must not become a root of
    /// something negative. Two lags of the same rate in a row, at many rates.
    #[test]
    fn double_eigenvalues_are_found() {
        for k in 1..2000 {
            let rate = f64::from(k) * 0.037;
            #[rustfmt::skip]
            let lags = DMatrix::from_row_slice(3, 3, &[
                -rate, 0.0, rate,
                rate, -rate, 0.0,
                0.0, 0.0, 0.0,
            ]);
            for value in eigenvalues(&lags).unwrap() {
                let distance = value.norm().min((value + rate).norm());
                assert!(distance < 1e-6 * rate, "{rate}: {value}");
            }
        }
    }

    /// The paper's matrix of section IV, entry by entry, for equal springs and dampers.
    #[test]
    fn system_matrix_is_the_papers() {
        let drive = Drive::default_drive();
        let chain = Chain::new(&drive.actuator, &drive.loads, 0.0);
        let (ma, m, k, c) = (0.059, 0.019, 300.0, 0.1);
        #[rustfmt::skip]
        let expected = DMatrix::from_row_slice(8, 8, &[
            0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
            -k / ma, -c / ma, k / ma, c / ma, 0.0, 0.0, 0.0, 0.0,
            0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0,
            k / m, c / m, -2.0 * k / m, -2.0 * c / m, k / m, c / m, 0.0, 0.0,
            0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0,
            0.0, 0.0, k / m, c / m, -2.0 * k / m, -2.0 * c / m, k / m, c / m,
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0,
            0.0, 0.0, 0.0, 0.0, k / m, c / m, -k / m, -c / m,
        ]);
        assert!((chain.a() - expected).amax() < 1e-9);
        assert!((chain.b()[1] - 6.43 / ma).abs() < 1e-9);
    }
}
