//! Optimal constant gain, eqs. (2) to (7), (12) and (13), for a sampled drive.
//!
//! The continuous index (2), `∫ xᵀ Q x + R i² dt`, under a current held over each period; its constant
//! gain `K` is the one that (14) tends to as the final time grows. The input is the current, so `K` is in
//! A/m and A s/m.

use super::weights::PerformanceIndex;
use crate::chain::Chain;
use crate::linear::Result;
use crate::linear::dlqr::{Regulator, dlqr};
use nalgebra::RowDVector;

/// Feedback gain `K`, order `x_a v_a x_1 v_1 …`, and the relative residual of its Riccati equation.
///
/// # Errors
/// [`NoSolution`](crate::error::NoSolution) when the Riccati equation has none.
pub fn regulator(chain: &Chain, index: &PerformanceIndex, sample_time: f64) -> Result<Regulator> {
    let weights = index.state_weights();
    dlqr(&chain.a(), &chain.b(), &weights, index.current, sample_time)
}

/// A gain that is stated mass by mass, actuator first, A/m and A s/m, in the order of the states.
#[must_use]
pub fn of_masses(position: &[f64], velocity: &[f64]) -> RowDVector<f64> {
    let masses = position.iter().zip(velocity);
    let each = masses.flat_map(|(position, velocity)| [*position, *velocity]);
    RowDVector::from_vec(each.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::Design;
    use crate::drive::{Drive, Weights};
    use crate::machine::chain_of;

    /// `arso_core::theory`, (13) and (14): the default drive's gain, and the rigid-mode identity of the continuous case,
    /// (sum of position gains)² = (sum of weights) / R, which sampling approaches as the period
    /// shrinks: 1.85 A/m short at 1 ms, in proportion to it.
    #[test]
    fn gain_of_the_default_drive() {
        let drive = Drive::default_drive();
        let chain = chain_of(&drive.actuator, &drive.loads, 0.0);
        let index = PerformanceIndex::new(&drive.cost, &chain, 1e-3).unwrap();
        let Regulator { gain, residual } = regulator(&chain, &index, 1e-3).unwrap();
        assert!(residual < 1e-12, "{residual:e}");
        // As printed there, to half of the last figure.
        let expected = [
            (59.0, 0.5),
            (1.1, 0.05),
            (-27.0, 0.5),
            (0.06, 0.005),
            (-6.9, 0.05),
            (0.16, 0.005),
            (2.2, 0.05),
            (0.21, 0.005),
        ];
        for (value, (expected, tolerance)) in gain.iter().zip(expected) {
            assert!((value - expected).abs() <= tolerance, "{value} {expected}");
        }
        let fine = regulator(&chain, &index, 1e-6).unwrap().gain;
        let sum: f64 = fine.iter().step_by(2).sum();
        assert!((sum - 30.0).abs() < 2.5e-3, "{sum}");
    }

    /// A very stiff chain is rigid: under a stated gain its slowest poles are those of `s² + 2 ζ ω s + ω² = 0` with
    /// `ω² = Σ k_p k_f / M` and `2 ζ ω = Σ k_v k_f / M`, whatever mass each part of the gain is of.
    #[test]
    fn a_stated_gain_holds_a_rigid_drive_as_its_sums_say() {
        let mut drive = Drive::default_drive();
        drive.control.sample_time = 1e-5;
        drive.control.disturbance_cutoff = 6280.0;
        drive.control.reaction_force_cutoff = 6280.0;
        for load in &mut drive.loads {
            (load.stiffness, load.damping) = (1e6, 10.0);
        }
        drive.cost.weights = Weights::Gain {
            position: vec![20.0, -5.0, 10.0, 5.0],
            velocity: vec![0.5, 0.3, -0.2, 0.2],
        };
        let design = Design::new(&drive).unwrap();
        assert!(design.index.is_none() && design.riccati_residual.is_none());
        let mass = 0.059 + 3.0 * 0.019;
        let (square, twice): (f64, f64) = (30.0 * 6.43 / mass, 0.8 * 6.43 / mass);
        let expected = nalgebra::Complex::new(-0.5 * twice, (square - 0.25 * twice * twice).sqrt());
        let poles = design.regulator_poles().unwrap();
        let nearest = poles
            .iter()
            .map(|pole| (pole.ln() / 1e-5 - expected).norm())
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-3 * expected.norm(), "{nearest} {expected}");
    }
}
