//! The Hamiltonian of the optimal control problem over a time that ends: eqs. (8) to (12) and (14), the
//! gain over the time that is left.
//!
//! State and costate obey the Hamiltonian flow of (8), whose lower right block must read `−Aᵀ`
//! (printed: `−A`); over a time `h`, `Ψ = e^{M h}` of (9). With `p = H x` at the end, (10), the costate is
//! `p = P x` with the `P` of (11), and (12) makes the gain (14) of it:
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
//! which is the same equation, and pieces are joined two by two by the doubling of [`DoublingTriple`],
//! in which nothing grows. As the horizon grows, `K` tends to a constant gain. Continuous time: the
//! gains that the sampled drive holds differ by what sampling costs.

use super::Chain;
use crate::error::NoSolution;
use crate::linear::Result;
use crate::linear::dare::DoublingTriple;
use crate::linear::eigen::spectral_radius;
use nalgebra::{DMatrix, DVector, RowDVector};

/// `K` with a given time to go, for each of the times.
///
/// * `q`: diagonal of `Q`, in the order of the states; `r`: weight of the current
/// * `terminal`: weight `H` of the state at the end, read as `½ xᵀ H x`
/// * `times`: times to go, s, rising
///
/// # Errors
/// [`NoSolution`] when a step cannot be solved.
pub fn gains(
    chain: &Chain,
    (q, r): (&[f64], f64),
    terminal: &DMatrix<f64>,
    times: &[f64],
) -> Result<Vec<RowDVector<f64>>> {
    let (a, b) = (chain.a(), chain.b());
    let flow = hamiltonian(&a, &b, q, r);
    let singular = || NoSolution("a step of the finite-horizon solution is singular".into());
    // Pieces in which nothing grows by more than e: neither the chain nor, where the weights are large
    // against that of the current, the flow, whose fastest part is then a pole of the loop.
    let longest = 1.0 / fastest(&a).max(spectral_radius(&flow)?).max(1e-9);
    // (10): at the end P is H.
    let mut riccati = terminal.clone();
    let mut reached = 0.0;
    let mut result = Vec::with_capacity(times.len());
    for time in times {
        let left = time - reached;
        if left > 0.0 {
            let doublings = (left / longest).log2().ceil().max(0.0) as i32;
            // (9): the transition of state and costate over a piece.
            let psi = (&flow * (left / 2_f64.powi(doublings))).exp();
            let mut interval = piece(&psi).ok_or_else(singular)?;
            for _ in 0..doublings {
                interval = interval.doubled().ok_or_else(singular)?.0;
            }
            // (11): P at the beginning from P at the end.
            riccati = interval.before(&riccati).ok_or_else(singular)?;
        }
        reached = *time;
        // (12) and (14).
        let gain = b.transpose() * &riccati / r;
        if !gain.iter().all(|value| value.is_finite()) {
            let why = "the weights lie too far apart for the finite-horizon gain, eq. (14)";
            return Err(NoSolution(why.into()));
        }
        result.push(gain);
    }
    Ok(result)
}

/// The matrix of (8): how state and costate move together.
fn hamiltonian(a: &DMatrix<f64>, b: &DVector<f64>, q: &[f64], r: f64) -> DMatrix<f64> {
    let n = b.len();
    let weights = DMatrix::from_diagonal(&DVector::from_column_slice(q));
    let mut flow = DMatrix::zeros(2 * n, 2 * n);
    flow.view_mut((0, 0), (n, n)).copy_from(a);
    flow.view_mut((0, n), (n, n))
        .copy_from(&(b * b.transpose() / -r));
    flow.view_mut((n, 0), (n, n)).copy_from(&-weights);
    flow.view_mut((n, n), (n, n)).copy_from(&-a.transpose());
    flow
}

/// What the time of `Ψ` does to `P`, (11) with every inverse that of `Ψ_22`.
fn piece(psi: &DMatrix<f64>) -> Option<DoublingTriple> {
    let n = psi.nrows() / 2;
    let block = |row, column| psi.view((row * n, column * n), (n, n)).into_owned();
    let inverse = block(1, 1).try_inverse()?;
    Some(DoublingTriple {
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

    /// `Q`: positions 225, velocities 0.2.
    const WEIGHTS: [f64; 8] = [225.0, 0.2, 225.0, 0.2, 225.0, 0.2, 225.0, 0.2];

    /// Independent: the Riccati differential equation
    /// `−dP/dt = Aᵀ P + P A − P B R⁻¹ Bᵀ P + Q`, integrated backwards by Runge-Kutta.
    #[test]
    fn agrees_with_the_riccati_differential_equation() {
        let chain = Chain::of_table_1(300.0, 0.1);
        let (a, b) = (chain.a(), chain.b());
        let q = DMatrix::from_diagonal(&DVector::from_column_slice(&WEIGHTS));
        let terminal = DMatrix::from_diagonal(&DVector::from_fn(8, |i, _| 1.0 + i as f64));
        let rate = |p: &DMatrix<f64>| {
            let gain = b.transpose() * p;
            a.transpose() * p + p * &a - gain.transpose() * gain + &q
        };
        let times = [0.0, 0.01, 0.05, 0.15, 0.4];
        let found = gains(&chain, (&WEIGHTS, 1.0), &terminal, &times).unwrap();
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
        let chain = Chain::of_table_1(300.0, 0.1);
        let zero = DMatrix::zeros(8, 8);
        let long = gains(&chain, (&WEIGHTS, 1.0), &zero, &[0.0, 5.0]).unwrap();
        assert_eq!(long[0].amax(), 0.0);
        let sum: f64 = long[1].iter().step_by(2).sum();
        assert!((sum - 30.0).abs() < 1e-8, "{sum}");
        let heavy = DMatrix::identity(8, 8) * 100.0;
        let other = gains(&chain, (&WEIGHTS, 1.0), &heavy, &[5.0]).unwrap();
        assert!((&other[0] - &long[1]).amax() < 1e-8);
    }

    /// The same constant gain with weights sixteen decades apart, where the flow is thousands of times
    /// faster than the chain.
    #[test]
    fn heavy_weights_have_a_gain_as_well() {
        let mut chain = Chain::of_table_1(300.0, 0.1);
        chain.mass[1] = 0.136_066;
        let mut weights = WEIGHTS;
        for (mass, velocity) in [1e8, 6.5e-8, 24.15, 0.0155].into_iter().enumerate() {
            weights[2 * mass + 1] = velocity;
        }
        let zero = DMatrix::zeros(8, 8);
        // Until the slowest part, 3.4e2 s, has settled.
        let times = [0.01, 0.3, 2e4];
        let found = gains(&chain, (&weights, 1.0), &zero, &times).unwrap();
        assert!(found.iter().all(|gain| gain.iter().all(|k| k.is_finite())));
        let sum: f64 = found[2].iter().step_by(2).sum();
        assert!((sum / 30.0 - 1.0).abs() < 1e-3, "{sum}");
        assert!((found[2][1] / 1e4 - 1.0).abs() < 1e-3, "{}", found[2][1]);
    }
}
