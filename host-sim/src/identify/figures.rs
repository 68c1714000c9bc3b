//! What control needs of a machine, whether or not its single masses and springs are known: how it
//! accelerates as one, where its motion resonates, and where the actuator stands still while the loads
//! swing.

use super::confidence::{Covariance, Rival};
use super::{Machine, Parameters};
use crate::chain::load::on_moving_actuator;
use crate::linear::eigen::eigenvalues;
use nalgebra::DVector;
use std::f64::consts::TAU;

/// Width of the differences by which figures follow the coordinates.
const WIDTH: f64 = 1e-4;

/// One figure of the whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What it is.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Unit of both.
    pub unit: Unit,
}

/// Relative standard deviation up to which a figure counts as known: frequencies, and dampings.
const KNOWN: (f64, f64) = (0.01, 1.0 / 3.0);

impl Figure {
    /// Whether the record determines it.
    #[must_use]
    pub fn known(&self) -> bool {
        let limit = match self.unit {
            Unit::One => KNOWN.1,
            _ => KNOWN.0,
        };
        self.std <= limit * self.value
    }
}

/// Unit of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// m/s² per A.
    AccelerationPerAmpere,
    /// Hz.
    Hertz,
    /// 1.
    One,
}

/// Acceleration of the whole per ampere, then frequency and damping ratio of each mode, then the
/// frequencies of the loads on a held actuator.
fn values(machine: &Machine) -> Vec<(String, f64, Unit)> {
    let chain = machine.chain();
    let total: f64 = chain.mass.iter().sum();
    let mut result = vec![(
        "acceleration".to_owned(),
        chain.force_constant / total,
        Unit::AccelerationPerAmpere,
    )];
    for (number, mode) in (1..).zip(chain.modes()) {
        result.push((format!("mode {number}"), mode.frequency_hz, Unit::Hertz));
        result.push((
            format!("mode {number} damping"),
            mode.damping_ratio,
            Unit::One,
        ));
    }
    if chain.loads() > 0 {
        let (held, _) = on_moving_actuator(chain);
        let mut rates: Vec<f64> = eigenvalues(&held)
            .unwrap_or_default()
            .iter()
            .filter(|pole| pole.im > 0.0)
            .map(|pole| pole.norm() / TAU)
            .collect();
        rates.sort_by(f64::total_cmp);
        for (number, rate) in (1..).zip(rates) {
            result.push((format!("antiresonance {number}"), rate, Unit::Hertz));
        }
    }
    result
}

/// The figures of a machine at the end of a search, with what is known of them.
pub(super) fn figures(
    parameters: &Parameters,
    coordinates: &[f64],
    covariance: &Covariance,
    rivals: &[Rival],
) -> Vec<Figure> {
    let count = parameters.free().count();
    let at = |x: &[f64]| values(&parameters.machine(&x[..count]));
    let found = at(coordinates);
    let others: Vec<_> = rivals
        .iter()
        .map(|rival| (at(&rival.coordinates), rival.likelihood))
        .collect();
    let slopes: Vec<Vec<f64>> = (0..count)
        .map(|i| {
            let moved = |by: f64| {
                let mut x = coordinates.to_vec();
                x[i] += by;
                at(&x)
            };
            let (above, below) = (moved(WIDTH), moved(-WIDTH));
            (0..found.len())
                .map(|figure| match (above.get(figure), below.get(figure)) {
                    (Some(above), Some(below)) => (above.1 - below.1) / (2.0 * WIDTH),
                    _ => 0.0,
                })
                .collect()
        })
        .collect();
    found
        .into_iter()
        .enumerate()
        .map(|(figure, (name, value, unit))| {
            let slope = DVector::from_fn(coordinates.len(), |i, _| {
                slopes.get(i).map_or(0.0, |slope| slope[figure])
            });
            let distances = others.iter().filter_map(|(other, likelihood)| {
                Some(((other.get(figure)?.1 - value).abs(), *likelihood))
            });
            Figure {
                name,
                value,
                std: covariance.deviation(&slope, distances),
                unit,
            }
        })
        .collect()
}
