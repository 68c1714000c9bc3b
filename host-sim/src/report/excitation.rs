//! An excitation: what it does in a few lines, and every control period as CSV.

use super::time;
use crate::drive::Drive;
use crate::excite::ExcitationPlan;
use crate::output::significant;
use std::fmt::Write;

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
