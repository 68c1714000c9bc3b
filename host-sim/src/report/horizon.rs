//! How the gain over the time to go, eq. (14), tends to the constant one: a plot.

use super::plot::{Series, panels};
use crate::design::Design;
use crate::design::judgement::convergence;
use crate::error::Result;

/// How long, in periods of the slowest mode, and in how many points.
const PERIODS: f64 = 4.0;
const POINTS: u32 = 160;

/// Position gains, velocity gains and the distance from the constant gain, as SVG.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when a gain cannot be computed,
/// [`Error::Simulation`](crate::error::Error::Simulation) when the drawing cannot be made.
pub fn plot(design: &Design) -> Result<String> {
    let times: Vec<f64> = (0..=POINTS)
        .map(|k| PERIODS * f64::from(k) / f64::from(POINTS))
        .collect();
    let gains = convergence(design, &times)?;
    let series = |element: usize| -> Vec<Series> {
        (0..=design.loads())
            .map(|mass| {
                let points = gains
                    .iter()
                    .map(|gain| (gain.time_to_go, gain.k[2 * mass + element]));
                let name = if mass == 0 {
                    "actuator".into()
                } else {
                    format!("load {mass}")
                };
                (name, points.collect())
            })
            .collect()
    };
    let distance = gains
        .iter()
        .map(|gain| (gain.time_to_go, gain.distance.max(1e-16).log10()));
    let units = design.drive.kind.units();
    panels(
        "gain of eq. (14) over the time to go",
        "time to go [s]",
        &[
            (
                "position gains",
                &format!("K [{}]", units.position_gain),
                series(0),
            ),
            (
                "velocity gains",
                &format!("K [{}]", units.velocity_gain),
                series(1),
            ),
            (
                "distance from the constant gain",
                "log10",
                vec![("relative".into(), distance.collect())],
            ),
        ],
    )
}
