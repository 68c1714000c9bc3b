//! Tuning of the rivals: the best of a grid, then Nelder and Mead from there.
//!
//! What is judged is smooth where the settling time alone jumps: the mean of the settling times to
//! bands of 1, 1.4, 2 and 2.8 %, of the plant where that is longest.

use crate::error::{Error, Result};
use crate::simulate::Run;
use crate::simulate::metrics::settling_time;
use argmin::core::{CostFunction, Executor};
use argmin::solver::neldermead::NelderMead;

const BANDS: [f64; 4] = [0.01, 0.014, 0.02, 0.028];
const ITERATIONS: u64 = 60;
/// How many of the grid's points are improved.
const STARTS: usize = 3;
/// Size of the first simplex in each variable, a logarithm.
const SIMPLEX: f64 = 0.15;

/// Mean settling time of a run over the bands, s; what does not settle counts twice the run.
pub(super) fn criterion(run: &Run, duration: f64) -> f64 {
    let times = BANDS.iter().map(|band| settling_time(run, *band));
    let sum: f64 = times.map(|time| time.unwrap_or(2.0 * duration)).sum();
    sum / BANDS.len() as f64
}

struct Problem<F>(F);

impl<F: Fn(&[f64]) -> f64> CostFunction for Problem<F> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, point: &Vec<f64>) -> std::result::Result<f64, argmin::core::Error> {
        Ok((self.0)(point))
    }
}

/// The point with the least cost: the best of all combinations of `grid`'s values, improved.
///
/// # Errors
/// [`Error::Comparison`] when the search fails.
pub(super) fn search(grid: &[Vec<f64>], cost: impl Fn(&[f64]) -> f64) -> Result<Vec<f64>> {
    let mut points = vec![Vec::new()];
    for values in grid {
        points = points
            .iter()
            .flat_map(|point: &Vec<f64>| {
                values.iter().map(move |value| {
                    let mut point = point.clone();
                    point.push(*value);
                    point
                })
            })
            .collect();
    }
    let mut judged: Vec<(f64, Vec<f64>)> = points
        .into_iter()
        .map(|point| (cost(&point), point))
        .collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0));
    judged.truncate(STARTS);
    let mut best = judged.first().cloned().unwrap_or_default();
    for (_, start) in judged {
        let mut simplex = vec![start.clone()];
        for i in 0..start.len() {
            let mut corner = start.clone();
            corner[i] += SIMPLEX;
            simplex.push(corner);
        }
        let failed = |error| Error::Comparison(format!("a rival cannot be tuned: {error}"));
        let result = Executor::new(Problem(&cost), NelderMead::new(simplex))
            .configure(|state| state.max_iters(ITERATIONS))
            .run()
            .map_err(failed)?;
        if let (true, Some(point)) = (result.state.best_cost < best.0, result.state.best_param) {
            best = (result.state.best_cost, point);
        }
    }
    Ok(best.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley has its bottom at (1, 1).
    #[test]
    fn finds_the_bottom_of_a_valley() {
        let valley = |p: &[f64]| (1.0 - p[0]).powi(2) + 100.0 * (p[1] - p[0] * p[0]).powi(2);
        let grid = [vec![-1.0, 0.0, 0.5, 2.0], vec![-1.0, 0.5, 2.0]];
        let found = search(&grid, valley).unwrap();
        assert!(
            (found[0] - 1.0).abs() < 1e-2 && (found[1] - 1.0).abs() < 1e-2,
            "{found:?}"
        );
    }
}
