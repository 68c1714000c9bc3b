//! How the gain over the time to go, eq. (14), tends to a constant one: a plot. Continuous time, as the
//! equation is: the gain of the sampled drive is somewhat smaller.

use super::plot::{Panel, Series, panels};
use crate::design::Design;
use crate::design::assessment::convergence;
use crate::error::Result;

/// How long, in periods of the slowest mode, and in how many points.
const PERIODS: f64 = 4.0;
const POINTS: u32 = 160;

/// Position gains, velocity gains and the distance from the constant gain, as SVG.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when a gain cannot be computed,
/// [`Error::Report`](crate::error::Error::Report) when the drawing cannot be made.
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
                Series::line(name, mass, points.collect())
            })
            .collect()
    };
    let distance = gains
        .iter()
        .map(|gain| (gain.time_to_go, gain.distance.max(1e-16).log10()));
    let units = design.drive.kind.units();
    let over = "time to go [s]";
    panels(
        "gain of eq. (14), continuous time",
        &[
            Panel {
                caption: "position gains",
                axes: (over, &format!("K [{}]", units.position_gain)),
                series: series(0),
                ..Panel::default()
            },
            Panel {
                caption: "velocity gains",
                axes: (over, &format!("K [{}]", units.velocity_gain)),
                series: series(1),
                ..Panel::default()
            },
            Panel {
                caption: "distance from the gain they tend to",
                axes: (over, "log10"),
                series: vec![Series::line("relative", 1, distance.collect())],
                ..Panel::default()
            },
        ],
    )
}
