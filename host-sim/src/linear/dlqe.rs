//! Steady-state Kalman gain, by duality with the regulator.

use super::{Result, dare, zoh};
use nalgebra::{DMatrix, DVector, RowDVector};

/// Gain `L` of the correction `x += L (y − c x)` that follows each step of the transition.
///
/// * `a`: continuous, n x n, along which the process noise spreads within a period
/// * `transition`: the same over one period
/// * `density`: of the process noise, continuous, n x n
/// * `measurement`: variance of the noise of one sample of `y`
///
/// # Errors
/// [`NoSolution`](crate::error::NoSolution) when the Riccati equation has none.
pub fn dlqe(
    a: &DMatrix<f64>,
    transition: &DMatrix<f64>,
    output: &RowDVector<f64>,
    density: &DMatrix<f64>,
    measurement: f64,
    period: f64,
) -> Result<DVector<f64>> {
    let process = zoh::cost_integral(&a.transpose(), density, period);
    let solution = dare::solve(
        &transition.transpose(),
        &output.transpose(),
        &process,
        &DVector::zeros(a.nrows()),
        measurement,
    )?;
    // X is the covariance before the correction.
    let covariance = &solution.x * output.transpose();
    let innovation = (output * &covariance).x + measurement;
    Ok(covariance / innovation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scalar random walk seen in noise: with `p` before the correction, `p² = q T (p + r)` and
    /// `L = p / (p + r)`.
    #[test]
    fn a_random_walk_in_closed_form() {
        let one = |x: f64| DMatrix::from_element(1, 1, x);
        let (q, r, period) = (0.7_f64, 2.0_f64, 0.1_f64);
        let output = RowDVector::from_element(1, 1.0);
        let gain = dlqe(&one(0.0), &one(1.0), &output, &one(q), r, period).unwrap();
        let step = q * period;
        let p = 0.5 * (step + (step * step + 4.0 * step * r).sqrt());
        assert!((gain[0] - p / (p + r)).abs() < 1e-12, "{gain}");
    }
}
