//! The conditions that the paper sets: a gain that solves its equation, distinct eigenvalues, and a load
//! whose motion shows in the reaction force (section III).

use super::{Check, Design, Verdict, verdict};
use crate::design::observer::Model;
use crate::error::Result;
use crate::linear::eigen::eigenvalues;
use nalgebra::{Complex, DMatrix, DVector, RowDVector};

/// Whether the gain solves its Riccati equation; a gain that is stated has none to solve.
pub(super) fn riccati_residual(design: &Design) -> Option<Check> {
    let (value, limit) = (design.riccati_residual?, 1e-9);
    Some(Check::new(
        "riccati_residual",
        // The smaller the better.
        verdict(limit / value, 1.0, 1e-3),
        (value, limit),
        "residual of the regulator's Riccati equation relative to its solution; weights \
                 that lie fewer decades apart make it smaller",
    ))
}

/// The condition of section III, on the matrix that the chosen observer is built on.
pub(super) fn distinct_eigenvalues(design: &Design) -> Result<Check> {
    let chain = &design.chain;
    let limit = 1e-6;
    let variant = design.observer_variant();
    let (value, advice) = variant.distinct_eigenvalues(chain)?;
    let verdict = if variant.rigid_motion() {
        Verdict::Warn
    } else {
        verdict(value, limit, 1e-12)
    };
    Ok(Check::new(
        "distinct_eigenvalues",
        verdict,
        (value, limit),
        advice,
    ))
}

/// Popov-Belevitch-Hautus test: smallest singular value of `[λ − A; c]` over the eigenvalues of the
/// observer's model, positions in units of the first spring's stretch and time in units of the
/// slowest mode, so that the figure means the same for every drive.
pub(super) fn observability(design: &Design) -> Result<Check> {
    let chain = &design.chain;
    let omega = design
        .modes()
        .first()
        .map_or(1.0, |mode| std::f64::consts::TAU * mode.frequency_hz);
    let stiffness = chain.stiffness[0];
    let variant = design.observer_variant();
    let Model { a, c, forces } = variant.model(&design.drive, chain);
    let n = a.nrows();
    let unit = DVector::from_fn(n, |i, _| match i {
        i if i >= n - forces => stiffness,
        i if i % 2 == 1 => omega,
        _ => 1.0,
    });
    let scaled = DMatrix::from_fn(n, n, |i, j| a[(i, j)] * unit[j] / unit[i] / omega);
    let c = RowDVector::from_fn(n, |_, j| c[j] * unit[j] / stiffness);
    let (mut value, mut worst) = (f64::INFINITY, Complex::new(0.0, 0.0));
    for pole in eigenvalues(&scaled)? {
        let mut pbh = DMatrix::<Complex<f64>>::zeros(n + 1, n);
        for i in 0..n {
            for j in 0..n {
                let diagonal = if i == j { pole } else { Complex::new(0.0, 0.0) };
                pbh[(i, j)] = diagonal - scaled[(i, j)];
            }
            pbh[(n, i)] = c[i].into();
        }
        let smallest = pbh.singular_values().min();
        if smallest < value {
            (value, worst) = (smallest, pole);
        }
    }
    let limit = 1e-3;
    let hz = worst.norm() * omega / std::f64::consts::TAU;
    let rigid = if variant.rigid_motion() {
        "; the rigid motion is not observable at all"
    } else {
        ""
    };
    Ok(Check::new(
        "observability",
        verdict(value, limit, 1e-9),
        (value, limit),
        format!(
            "the motion at {hz:.2} Hz is the hardest to see in the reaction force{rigid}; a stiffer \
             first spring or a less weakly coupled load shows more of it"
        ),
    ))
}
