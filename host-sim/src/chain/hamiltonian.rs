//! Finite-horizon solution, eqs. (7) to (14): the gain over the time that is left.
//!
//! State and costate obey the Hamiltonian flow of (8), whose lower right block must read `−Aᵀ`
//! (printed: `−A`); over a time `h`, `Ψ = e^{M h}` and
//!
//! ```text
//! P(t) = (H Ψ_12 − Ψ_22)⁻¹ (Ψ_21 − H Ψ_11)         K(t) = R⁻¹ Bᵀ P(t)
//! ```
//!
//! with `P` at the end of that time in the place of `H`. One exponential over a long horizon loses
//! all figures, because the flow grows as fast in one direction as it decays in the other. So the
//! exponential is that of a short piece, written as what the piece does to `P`,
//!
//! ```text
//! P(t) = h + aᵀ P(t+h) (I + g P(t+h))⁻¹ a     aᵀ = Ψ_22⁻¹,  g = −Ψ_12 Ψ_22⁻¹,  h = −Ψ_22⁻¹ Ψ_21
//! ```
//!
//! which is the same equation, and pieces are joined two by two by the doubling of `riccati.rs`, in
//! which nothing grows. As the horizon grows, `K` tends to a constant gain. Continuous time: the
//! gains that the sampled drive holds differ by what sampling costs.

use super::riccati::Stretch;
use crate::drive::Cost;
use crate::error::{Error, Result};
use crate::model::Chain;
use nalgebra::{DMatrix, DVector, RowDVector};

/// `K` with a given time to go, for each of the times.
///
/// * `terminal`: weight `H` of the state at the end, read as `½ xᵀ H x`
/// * `times`: times to go, s, rising
///
/// # Errors
/// [`Error::Design`] when a step cannot be solved.
pub fn gains(
    chain: &Chain,
    cost: &Cost,
    terminal: &DMatrix<f64>,
    times: &[f64],
) -> Result<Vec<RowDVector<f64>>> {
    let n = chain.states();
    let (a, b) = (chain.a(), chain.b());
    let weights = DMatrix::from_diagonal(&DVector::from_vec(cost.state_weights()));
    let mut flow = DMatrix::zeros(2 * n, 2 * n);
    flow.view_mut((0, 0), (n, n)).copy_from(&a);
    flow.view_mut((0, n), (n, n))
        .copy_from(&(&b * b.transpose() / -cost.current));
    flow.view_mut((n, 0), (n, n)).copy_from(&-weights);
    flow.view_mut((n, n), (n, n)).copy_from(&-a.transpose());

    let singular = || Error::Design("a step of the finite-horizon solution is singular".into());
    // Pieces in which nothing grows by more than e.
    let longest = 1.0 / fastest(&a).max(1e-9);
    let mut riccati = terminal.clone();
    let mut reached = 0.0;
    let mut result = Vec::with_capacity(times.len());
    for time in times {
        let left = time - reached;
        if left > 0.0 {
            let doublings = (left / longest).log2().ceil().max(0.0) as i32;
            let psi = (&flow * (left / 2_f64.powi(doublings))).exp();
            let mut stretch = piece(&psi).ok_or_else(singular)?;
            for _ in 0..doublings {
                stretch = stretch.doubled().ok_or_else(singular)?.0;
            }
            riccati = stretch.before(&riccati).ok_or_else(singular)?;
        }
        reached = *time;
        result.push(b.transpose() * &riccati / cost.current);
    }
    Ok(result)
}

/// What the time of `Ψ` does to `P`.
fn piece(psi: &DMatrix<f64>) -> Option<Stretch> {
    let n = psi.nrows() / 2;
    let block = |row, column| psi.view((row * n, column * n), (n, n)).into_owned();
    let inverse = block(1, 1).try_inverse()?;
    Some(Stretch {
        a: inverse.transpose(),
        g: block(0, 1) * &inverse * -1.0,
        h: &inverse * block(1, 0) * -1.0,
    })
}

/// How fast anything in a chain moves, 1/s: the root of the largest row sum of `|A²|`, within a
/// factor of two the frequency of its fastest mode, though stiffness and unity stand in one matrix.
fn fastest(a: &DMatrix<f64>) -> f64 {
    let square = a * a;
    let sums = square
        .row_iter()
        .map(|row| row.iter().map(|x| x.abs()).sum::<f64>());
    sums.fold(0.0, f64::max).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    /// Independent: the Riccati differential equation
    /// `−dP/dt = Aᵀ P + P A − P B R⁻¹ Bᵀ P + Q`, integrated backwards by Runge-Kutta.
    #[test]
    fn agrees_with_the_riccati_differential_equation() {
        let drive = Drive::default_drive();
        let chain = Chain::new(&drive.actuator, &drive.loads, 0.0);
        let (a, b) = (chain.a(), chain.b());
        let mut weights = DVector::zeros(8);
        for mass in 0..4 {
            weights[2 * mass] = 225.0;
            weights[2 * mass + 1] = 0.2;
        }
        let q = DMatrix::from_diagonal(&weights);
        let terminal = DMatrix::from_diagonal(&DVector::from_fn(8, |i, _| 1.0 + i as f64));
        let rate = |p: &DMatrix<f64>| {
            let gain = b.transpose() * p;
            a.transpose() * p + p * &a - gain.transpose() * gain + &q
        };
        let times = [0.0, 0.01, 0.05, 0.15, 0.4];
        let found = gains(&chain, &drive.cost, &terminal, &times).unwrap();
        let (mut p, mut reached) = (terminal.clone(), 0.0);
        for (time, gain) in times.iter().zip(&found) {
            let steps = 4000;
            let h = (time - reached) / f64::from(steps);
            for _ in 0..steps {
                let k1 = rate(&p);
                let k2 = rate(&(&p + &k1 * (h / 2.0)));
                let k3 = rate(&(&p + &k2 * (h / 2.0)));
                let k4 = rate(&(&p + &k3 * h));
                p += (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
            }
            reached = *time;
            let expected = b.transpose() * &p;
            let error = (gain - &expected).amax() / expected.amax();
            assert!(error < 1e-7, "{time}: {error:e}");
        }
    }

    /// The constant gain of the continuous problem: (sum of position gains)² = sum of q / R, and
    /// the gain no longer depends on the terminal weight.
    #[test]
    fn tends_to_the_constant_gain() {
        let drive = Drive::default_drive();
        let chain = Chain::new(&drive.actuator, &drive.loads, 0.0);
        let zero = DMatrix::zeros(8, 8);
        let long = gains(&chain, &drive.cost, &zero, &[0.0, 5.0]).unwrap();
        assert_eq!(long[0].amax(), 0.0);
        let sum: f64 = long[1].iter().step_by(2).sum();
        assert!((sum - 30.0).abs() < 1e-8, "{sum}");
        let heavy = DMatrix::identity(8, 8) * 100.0;
        let other = gains(&chain, &drive.cost, &heavy, &[5.0]).unwrap();
        assert!((&other[0] - &long[1]).amax() < 1e-8);
    }
}
