//! A chain in the coordinates of its undamped modes, each measured by what the current can do to it.
//!
//! ```text
//! p_j = sum_i V_ij sqrt(m_i / M) x_i     V: eigenvectors of M^-1/2 K M^-1/2, the rigid motion first
//! p''_j + (D p')_j + omega_j^2 p_j = V_0j k_f / sqrt(m_0 M) i
//! ```
//!
//! `p_0` is the centre of mass. Stiff springs and large distances stand in one matrix here without losing each
//! other, as they would in the positions of the masses.

use crate::chain::Chain;
use crate::error::NoSolution;
use crate::linear::Result;
use nalgebra::{DMatrix, DVector, RowDVector};

/// The modes of a chain.
pub(super) struct Modal {
    /// `V_ij sqrt(m_i / M)`, a row for each mode.
    from_masses: DMatrix<f64>,
    /// Its inverse.
    to_masses: DMatrix<f64>,
    /// `omega_j^2`, 1/s²; zero for the rigid motion.
    square: DVector<f64>,
    /// `D`, 1/s.
    damping: DMatrix<f64>,
    /// Acceleration of each mode at the current limit, m/s².
    acceleration: DVector<f64>,
}

impl Modal {
    /// * `current_limit`: A
    pub(super) fn new(chain: &Chain, current_limit: f64) -> Result<Self> {
        let n = chain.mass.len();
        let total: f64 = chain.mass.iter().sum();
        let assemble = |springs: &[f64]| {
            let mut matrix = DMatrix::<f64>::zeros(n, n);
            for (i, value) in springs.iter().enumerate() {
                matrix[(i, i)] += value / chain.mass[i];
                matrix[(i + 1, i + 1)] += value / chain.mass[i + 1];
                let across = value / (chain.mass[i] * chain.mass[i + 1]).sqrt();
                matrix[(i, i + 1)] -= across;
                matrix[(i + 1, i)] -= across;
            }
            matrix
        };
        let mut friction = assemble(&chain.damping);
        friction[(0, 0)] += chain.viscous / chain.mass[0];
        for (mass, viscous) in (1..n).zip(&chain.ground) {
            friction[(mass, mass)] += viscous / chain.mass[mass];
        }
        let stiffness = assemble(&chain.stiffness);
        let eigen = nalgebra::SymmetricEigen::try_new(stiffness, f64::EPSILON, 10_000)
            .ok_or_else(|| NoSolution("an eigenvalue iteration did not converge".into()))?;
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        // The rigid motion is known exactly.
        let vectors = DMatrix::from_fn(n, n, |mass, mode| match mode {
            0 => (chain.mass[mass] / total).sqrt(),
            _ => eigen.eigenvectors[(mass, order[mode])],
        });
        let share = |mass: usize| (chain.mass[mass] / total).sqrt();
        Ok(Self {
            from_masses: DMatrix::from_fn(n, n, |mode, mass| vectors[(mass, mode)] * share(mass)),
            to_masses: DMatrix::from_fn(n, n, |mass, mode| vectors[(mass, mode)] / share(mass)),
            square: DVector::from_fn(n, |mode, _| match mode {
                0 => 0.0,
                _ => eigen.eigenvalues[order[mode]].max(0.0),
            }),
            damping: vectors.transpose() * friction * &vectors,
            acceleration: DVector::from_fn(n, |mode, _| {
                vectors[(0, mode)] * chain.force_constant * current_limit
                    / (chain.mass[0] * total).sqrt()
            }),
        })
    }

    /// Period of the slowest mode, s; zero where there is none.
    pub(super) fn slowest_period(&self) -> f64 {
        let square = self.square.iter().skip(1).find(|square| **square > 0.0);
        square.map_or(0.0, |square| std::f64::consts::TAU / square.sqrt())
    }

    /// Acceleration of the whole chain at the current limit, m/s².
    pub(super) fn rigid_acceleration(&self) -> f64 {
        self.acceleration[0]
    }

    /// Modal state, positions then velocities, of `x_a v_a x_1 v_1 …`.
    pub(super) fn state(&self, state: &DVector<f64>) -> DVector<f64> {
        let n = self.square.len();
        let part = |first: usize| DVector::from_fn(n, |mass, _| state[2 * mass + first]);
        let (position, velocity) = (&self.from_masses * part(0), &self.from_masses * part(1));
        DVector::from_iterator(2 * n, position.iter().chain(velocity.iter()).copied())
    }

    /// Row that takes the position of a mass from a modal state.
    pub(super) fn position(&self, mass: usize) -> RowDVector<f64> {
        let n = self.square.len();
        let mut row = RowDVector::zeros(2 * n);
        row.columns_mut(0, n).copy_from(&self.to_masses.row(mass));
        row
    }

    /// What the current does to each state in a time, s, in which the chain can be taken from rest to rest:
    /// the scale of that state.
    pub(super) fn scale(&self, time: f64) -> DVector<f64> {
        let n = self.square.len();
        let rates = self.square.map(|square| square + time.powi(-2));
        // A mode that the motor does not move (a node) is small, not nothing.
        let least = 1e-9 * self.acceleration.amax();
        DVector::from_fn(2 * n, |row, _| {
            let amplitude = self.acceleration[row % n].abs().max(least) / rates[row % n];
            amplitude * if row < n { 1.0 } else { rates[row % n].sqrt() }
        })
    }

    /// `A` and `B` of `z' = A z + B i / limit` in states over their scale.
    pub(super) fn scaled(&self, scale: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.square.len();
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        let mut b = DVector::zeros(2 * n);
        for mode in 0..n {
            a[(mode, n + mode)] = scale[n + mode] / scale[mode];
            a[(n + mode, mode)] = -self.square[mode] * scale[mode] / scale[n + mode];
            for other in 0..n {
                a[(n + mode, n + other)] =
                    -self.damping[(mode, other)] * scale[n + other] / scale[n + mode];
            }
            b[n + mode] = self.acceleration[mode] / scale[n + mode];
        }
        (a, b)
    }
}
