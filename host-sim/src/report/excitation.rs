//! An excitation: what it does in a few lines, as JSON and as a plot, and every control period as CSV.

use super::plot::{Panel, Series, panels};
use super::time;
use crate::drive::Drive;
use crate::error::Result;
use crate::excite::ExcitationPlan;
use crate::output::significant;
use serde_json::json;
use std::fmt::Write;

/// Share of the greatest amplitude up to which a line of the spectrum is not there.
const PLAYED: f64 = 0.01;

/// One row per control period of all repetitions; the current is held from the row's time to the
/// next.
#[must_use]
pub fn csv(plan: &ExcitationPlan) -> String {
    let mut text = String::from("time[s],current[A]\n");
    for (k, current) in plan.currents().enumerate() {
        // Whole microseconds, as everywhere.
        let time = time(k as f64 * plan.sample_time);
        let _ = writeln!(text, "{time},{current}");
    }
    text
}

/// Signal, duration, current, and what is predicted.
#[must_use]
pub fn summary(plan: &ExcitationPlan, drive: &Drive) -> String {
    let [from, to] = plan.band();
    let milli = drive.kind.units().milli_position;
    let prediction = &plan.prediction;
    format!(
        "signal              {}, {} lines from {from:.3} to {to:.3} Hz\n\
         duration            {} x {:.3} s = {:.3} s, {} control periods each\n\
         current             {} A peak, {} A rms\n\
         predicted travel    {} {milli} ({:.0} counts), amplifier off beyond {} {milli}\n\
         predicted speed     {} {milli}/s at most\n\
         predicted stretch   {} {milli} at most, of spring {}\n",
        plan.signal.name(),
        plan.lines.len(),
        plan.repetitions,
        plan.period(),
        plan.duration(),
        plan.table.len(),
        significant(plan.peak(), 3),
        significant(plan.rms(), 3),
        significant(1e3 * prediction.travel, 5),
        prediction.travel / drive.encoder.resolution,
        significant(1e3 * plan.travel, 5),
        significant(1e3 * prediction.speed, 3),
        significant(1e3 * prediction.stretch, 5),
        prediction.spring,
    )
}

/// The same and more for JSON, SI units.
#[must_use]
pub fn json(plan: &ExcitationPlan, drive: &Drive) -> serde_json::Value {
    let prediction = &plan.prediction;
    json!({
        "kind": drive.kind,
        "signal": plan.signal.name(),
        "sample_time": plan.sample_time,
        "band_hz": plan.band(),
        "lines": plan.lines.len(),
        "period": plan.period(),
        "repetitions": plan.repetitions,
        "duration": plan.duration(),
        "peak_current": plan.peak(),
        "rms_current": plan.rms(),
        "travel_allowed": plan.travel,
        "predicted": {
            "travel": prediction.travel,
            "travel_with_friction": prediction.with_friction,
            "speed": prediction.speed,
            "stretch": prediction.stretch,
            "stretched_spring": prediction.spring,
        },
    })
}

/// Current, its spectrum, and the motion that is predicted, as SVG.
///
/// # Errors
/// [`Error::Simulation`](crate::error::Error::Simulation) when the predicted motion is not finite,
/// [`Error::Report`](crate::error::Error::Report) when the drawing cannot be made.
pub fn plot(plan: &ExcitationPlan, drive: &Drive) -> Result<String> {
    let units = drive.kind.units();
    let over = "time [s]";
    let at = |k: usize| k as f64 * plan.sample_time;
    let once = plan.currents().take(plan.table.len()).enumerate();
    let once = once.map(|(k, current)| (at(k), f64::from(current)));
    let limit = drive.actuator.current_limit;
    let mut current = Series::bounds("limit", &[-limit, limit], (0.0, plan.period()));
    current.push(Series::line("current", 1, once.collect()));

    let amplitudes = plan.amplitudes().into_iter().enumerate().skip(1);
    let spectrum: Vec<(f64, f64)> = amplitudes
        .map(|(line, amplitude)| (line as f64 / plan.period(), amplitude))
        .collect();
    // Lines that are not played are no lines.
    let greatest = spectrum.iter().map(|line| line.1).fold(0.0, f64::max);
    let least = PLAYED * greatest;
    let spectrum: Vec<(f64, f64)> = spectrum.into_iter().filter(|l| l.1 > least).collect();
    let spectrum = vec![Series::dots("lines", 2, spectrum)];

    let motion = plan.motion(drive)?.into_iter().enumerate();
    let motion = motion.map(|(k, position)| (at(k), 1e3 * position));
    let travel = 1e3 * plan.travel;
    let mut way = Series::bounds(
        "amplifier off beyond",
        &[-travel, travel],
        (0.0, plan.duration()),
    );
    way.push(Series::line("actuator", 3, motion.collect()));
    let position = format!("position [{}]", units.milli_position);
    panels(
        &format!("excitation: {}", plan.signal.name()),
        &[
            Panel {
                caption: "current, one period of it",
                axes: (over, "current [A]"),
                series: current,
                ..Panel::default()
            },
            Panel {
                caption: "its spectrum",
                axes: ("frequency [Hz]", "amplitude [A]"),
                series: spectrum,
                heights: (greatest > 0.0).then_some((0.0, 1.1 * greatest)),
                ..Panel::default()
            },
            Panel {
                caption: "motion as the drive file predicts it, with its friction",
                axes: (over, &position),
                series: way,
                ..Panel::default()
            },
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excite::ExcitationRequest;

    #[test]
    fn the_csv_holds_every_entry() {
        let drive = Drive::default_drive();
        let plan = ExcitationPlan::new(&drive, &ExcitationRequest::default()).unwrap();
        let csv = csv(&plan);
        let rows: Vec<&str> = csv.lines().collect();
        assert_eq!((rows.len(), rows[0]), (1 + 4 * 2048, "time[s],current[A]"));
        for (k, row) in rows[1..].iter().enumerate() {
            let (time, current) = row.split_once(',').unwrap();
            let steps = current.parse::<f64>().unwrap() / 1e-3;
            assert!((time.parse::<f64>().unwrap() - k as f64 * 1e-3).abs() < 1e-9);
            assert!((steps - f64::from(plan.table[k % 2048])).abs() < 1e-3);
        }
    }
}
