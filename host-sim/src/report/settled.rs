//! When a run settled, or why it did not, in the words of a table.

use crate::machine::Units;
use crate::simulate::ending::Motion;
use crate::simulate::metrics::Metrics;

/// The settling time in ms, or the word for what happens instead, with its figure.
pub(super) fn settled(metrics: &Metrics, units: &Units) -> String {
    if let Some(fault) = metrics.fault {
        return format!("fault {fault}");
    }
    let unit = units.micro_position;
    let motion = 1e6 * metrics.end.largest();
    match (metrics.end.state, metrics.settling_time) {
        (Motion::Hunting, _) => format!("hunting {motion:.0} {unit}"),
        (Motion::Moving, _) => format!("moving {motion:.0} {unit}"),
        (Motion::Rest, Some(time)) => format!("{:.0}", 1e3 * time),
        (Motion::Rest, None) => "not settled".into(),
    }
}

/// The time until all stays within the settling tolerance, ms.
pub(super) fn within_tolerance(metrics: &Metrics) -> String {
    match (metrics.fault, metrics.within_tolerance_from) {
        (None, Some(time)) => format!("{:.0}", 1e3 * time),
        _ => "-".into(),
    }
}
