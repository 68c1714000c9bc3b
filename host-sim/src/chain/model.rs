//! The chain of masses as a linear model, eqs. (1) and (15): actuator, springs, dampers, loads.
//!
//! State order `x_a v_a x_1 v_1 … x_n v_n` (the paper's A after section IV, with every mass,
//! stiffness and damping its own). Its first two rows are the actuator, eq. (15), its others the load,
//! eq. (16), which [`load`](super::load) takes out. Forces push outwards: spring `j` between mass `j − 1` and
//! mass `j` (the actuator is mass 0) gives `k_j (x_{j−1} − x_j) + c_j (v_{j−1} − v_j)`.

use nalgebra::{DMatrix, DVector, RowDVector};

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
    /// The same of each load, N s/m; none of those without an entry.
    pub ground: Vec<f64>,
    /// Force constant, N/A.
    pub force_constant: f64,
}

impl Chain {
    /// The plant of the paper's Table I with equal springs, N/m, and dampers, N s/m, neither of which
    /// the paper publishes.
    #[must_use]
    pub fn of_table_1(stiffness: f64, damping: f64) -> Self {
        Self {
            mass: vec![0.059, 0.019, 0.019, 0.019],
            stiffness: vec![stiffness; 3],
            damping: vec![damping; 3],
            viscous: 0.0,
            ground: Vec::new(),
            force_constant: 6.43,
        }
    }

    /// The same without friction against the ground: what plans are made for, beside which friction is fed
    /// forward.
    #[must_use]
    pub fn without_ground(&self) -> Self {
        Self {
            viscous: 0.0,
            ground: Vec::new(),
            ..self.clone()
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

    /// System matrix `A` of the free chain, the matrix of section IV: rows of the actuator, eq. (15), then
    /// of the load, eq. (16).
    #[must_use]
    pub fn a(&self) -> DMatrix<f64> {
        let mut a = DMatrix::zeros(self.states(), self.states());
        for element in 0..self.mass.len() {
            a[(2 * element, 2 * element + 1)] = 1.0;
        }
        a[(1, 1)] = -self.viscous / self.mass[0];
        for (mass, viscous) in (1..self.mass.len()).zip(&self.ground) {
            a[(2 * mass + 1, 2 * mass + 1)] = -viscous / self.mass[mass];
        }
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

    /// Input `B` of the motor current, per A: `B_a` of eq. (15), nothing on the load.
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
}

/// The mass that the paper controls, the second; the first where there is no other.
#[must_use]
pub fn controlled_mass(loads: usize) -> usize {
    loads.min(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's matrix of section IV, entry by entry, for equal springs and dampers.
    #[test]
    fn system_matrix_is_the_papers() {
        let chain = Chain::of_table_1(300.0, 0.1);
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
