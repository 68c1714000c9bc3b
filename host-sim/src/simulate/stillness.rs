//! Whether a drive comes to rest: encoder, friction and gains together, tried.
//!
//! Rounding by the encoder, friction and a loop with little margin can keep an actuator hunting within the
//! band for ever, and no margin of the linear loop shows it. So a planned move is simulated on the drive's own
//! machine, with the friction that the drive file states, without any and with twice as much.

use super::ending::Extent;
use super::scenario::Scenario;
use super::{Instant, Law, Time, control, follow};
use crate::design::Design;
use crate::design::checks::{Check, Verdict};
use crate::drive::PlantFile;
use crate::error::{Error, Result};

/// What friction is taken for, times the stated one.
const FRICTION: [f64; 3] = [0.0, 1.0, 2.0];
/// From how long after the move's planned end the actuator is to be still, s, and how long that is watched.
const AFTER: f64 = 1.0;
const WATCHED: f64 = 0.5;
/// Most control periods that are simulated.
const LONGEST: f64 = 100_000.0;
/// A count each way.
const COUNTS: f64 = 2.0;

/// Motion of the actuator a second after a planned move, peak to peak, in counts: the largest.
///
/// # Errors
/// [`Error::Design`] when there are no plans.
pub fn stillness(design: &Design) -> Result<Check> {
    let scenario = Scenario::PLANNED;
    let (period, resolution) = (
        design.drive.control.sample_time,
        design.drive.encoder.resolution,
    );
    let periods = design.plans()?.duration(scenario.target, period);
    let from = (periods * period + AFTER).min(LONGEST * period);
    let stated = PlantFile::from(&design.drive);
    let mut largest = 0.0_f64;
    for times in FRICTION {
        let mut plant = stated.clone();
        plant.friction = stated.friction.times(times);
        let time = Time::new(period, from + WATCHED);
        let mut motion = Extent::default();
        let look = |instant: &Instant<'_>| {
            let seen = instant.seen();
            if seen.time >= from {
                motion.see(seen.truth[0]);
            }
        };
        let run = control(design, &plant, &scenario, Law::Core)
            .and_then(|mut core| follow(core.as_mut(), (&plant, 0), &scenario, time, look));
        match run {
            Ok(None) => largest = largest.max(motion.peak_to_peak() / resolution),
            // A drive that stopped itself is at rest by another rule; or it does not start.
            Ok(Some(_)) | Err(Error::Simulation(_)) => {}
            Err(other) => return Err(other),
        }
        if !stated.friction.dry().any() {
            break;
        }
    }
    let verdict = if largest <= COUNTS {
        Verdict::Pass
    } else {
        Verdict::Warn
    };
    Ok(Check::new(
        "stillness",
        verdict,
        (largest, COUNTS),
        format!(
            "encoder counts, peak to peak, that the actuator still moves {AFTER} s after a planned move, simulated \
             with the stated friction, none and twice as much: above a count each way it hunts; a finer \
             encoder, more margin of the loop (a larger cost.current), or a larger move.settling_tolerance"
        ),
    ))
}
