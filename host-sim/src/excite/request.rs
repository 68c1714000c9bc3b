//! What is asked for of an excitation, and what follows from the drive where nothing is: band, period,
//! lines, current.

use super::{LEAST_PEAK, LONGEST_TABLE};
use crate::chain::Mode;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::machine::chain_of;
use crate::output::significant;

/// Period where none is asked for, s.
const PERIOD: f64 = 2.048;
/// Periods of the slowest line that it must hold.
const SLOWEST: f64 = 4.0;
/// Band where none is asked for, in terms of the slowest and the fastest mode.
const BELOW_MODES: f64 = 0.2;
const AT_MODES: f64 = 0.8;
const ABOVE_MODES: f64 = 1.5;
/// Highest frequency times the control period: 80 % of what sampling can show.
const HIGHEST: f64 = 0.4;
/// Peak current where none is asked for, as a share of the limit.
const SHARE: f64 = 0.25;
/// Steps of a continuous output from zero to its limit.
const CONTINUOUS: f64 = 2000.0;

/// Which signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Signal {
    /// Every odd multiple of 1 / period in the band, with equal current.
    #[default]
    Multisine,
    /// A linear sweep through the band and back, twice per period, the second time upside down.
    Chirp,
}

impl Signal {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Signal::Multisine => "multisine",
            Signal::Chirp => "chirp",
        }
    }
}

/// What is asked for; what is not follows from the drive.
#[derive(Clone, Copy, Debug)]
pub struct ExcitationRequest {
    /// Which signal.
    pub signal: Signal,
    /// Peak current, A.
    pub current: Option<f64>,
    /// Farthest the actuator may get from where it begins, m.
    pub travel: Option<f64>,
    /// Lower end of the band, Hz.
    pub from: Option<f64>,
    /// Upper end of the band, Hz.
    pub to: Option<f64>,
    /// Period, s.
    pub period: Option<f64>,
    /// How often it is played.
    pub repetitions: u16,
}

impl Default for ExcitationRequest {
    fn default() -> Self {
        Self {
            signal: Signal::default(),
            current: None,
            travel: None,
            from: None,
            to: None,
            period: None,
            repetitions: 4,
        }
    }
}

/// Both ends of the band, Hz.
pub(super) fn band(drive: &Drive, request: &ExcitationRequest) -> Result<[f64; 2]> {
    let modes = chain_of(&drive.actuator, &drive.loads, 0.0).modes();
    let highest = HIGHEST / drive.control.sample_time;
    let of_mode = |mode: Option<&Mode>| mode.map_or(highest, |m| m.frequency_hz);
    // Lower than any mode, but not lower than a table can hold.
    let slowest = of_mode(modes.first());
    let lowest = SLOWEST / (LONGEST_TABLE as f64 * drive.control.sample_time) * (1.0 + 1e-9);
    if request.from.is_none() && lowest > AT_MODES * slowest {
        return Err(Error::Usage(format!(
            "the slowest mode of {slowest:.3} Hz is too slow to be excited within {LONGEST_TABLE} control \
             periods of {} s: `from` and `period` say what is wanted instead",
            drive.control.sample_time
        )));
    }
    let from = request.from.unwrap_or(lowest.max(BELOW_MODES * slowest));
    let to = request
        .to
        .unwrap_or((ABOVE_MODES * of_mode(modes.last())).min(highest));
    if !(from > 0.0 && from.is_finite()) {
        return Err(Error::parameter("from", from, "must be above 0 Hz"));
    }
    // Half a line of rounding at the most.
    if !(to > 0.0 && to <= highest * (1.0 + 1e-9)) {
        let rule = format!("must be above 0 and at most 0.4 / sample_time = {highest} Hz");
        return Err(Error::parameter("to", to, rule));
    }
    if from >= to {
        return Err(Error::Usage(format!(
            "the band from {from:.3} to {to:.3} Hz is empty: `from` must be below `to`"
        )));
    }
    Ok([from, to])
}

/// Control periods in half a period.
pub(super) fn half(
    request: &ExcitationRequest,
    [from, _]: [f64; 2],
    sample_time: f64,
) -> Result<usize> {
    let longest = LONGEST_TABLE as f64;
    if let Some(period) = request.period {
        let samples = period / sample_time;
        if period * from >= 1.0 - 1e-9 && samples < longest + 1.0 {
            return Ok((0.5 * samples).round() as usize);
        }
        let rule = format!(
            "must be from one period of the lower end of the band, {} s, to {LONGEST_TABLE} control \
             periods, {} s",
            significant(1.0 / from, 4),
            significant(longest * sample_time, 4)
        );
        return Err(Error::parameter("period", period, rule));
    }
    let needed = SLOWEST / (from * sample_time);
    if needed > longest {
        let rule = format!(
            "must be {} Hz at least, {SLOWEST} of its periods must fit into {LONGEST_TABLE} control \
             periods where no `period` is given",
            significant(SLOWEST / (longest * sample_time), 4)
        );
        return Err(Error::parameter("from", from, rule));
    }
    let usual = (0.5 * PERIOD / sample_time).round().min(0.5 * longest);
    Ok(usual.max((0.5 * needed).ceil()) as usize)
}

/// Odd multiples of 1 / period in the band.
pub(super) fn lines(
    request: &ExcitationRequest,
    [from, to]: [f64; 2],
    half: usize,
    sample_time: f64,
) -> Result<Vec<usize>> {
    let period = 2.0 * half as f64 * sample_time;
    // What lies on an end of the band, lies in it.
    let first = (from * period - 1e-6).ceil().max(1.0) as usize;
    let last = (to * period + 1e-6).floor() as usize;
    let lines: Vec<usize> = (first | 1..=last).step_by(2).collect();
    if lines.is_empty() {
        let rule = format!(
            "no odd multiple of its inverse lies from {} to {} Hz, make it longer",
            significant(from, 4),
            significant(to, 4)
        );
        let period = request.period.unwrap_or(period);
        return Err(Error::parameter("period", period, rule));
    }
    Ok(lines)
}

/// Peak current, A.
pub(super) fn current(drive: &Drive, request: &ExcitationRequest) -> Result<f64> {
    let limit = drive.actuator.current_limit;
    // A small motor may need more of its limit for the output to have steps enough.
    let least = f64::from(LEAST_PEAK) * drive.actuator.current_resolution;
    let current = request
        .current
        .unwrap_or((SHARE * limit).max(least).min(limit));
    if current > 0.0 && current <= limit {
        Ok(current)
    } else {
        let rule = format!("must be above 0 and at most the current limit of {limit} A");
        Err(Error::parameter("current", current, rule))
    }
}

/// Unit of the table, A: a step of the output, or as many as it takes for an `i16` to hold the
/// peak.
pub(super) fn unit(drive: &Drive, current: f64) -> f64 {
    let resolution = match drive.actuator.current_resolution {
        0.0 => drive.actuator.current_limit / CONTINUOUS,
        resolution => resolution,
    };
    let steps = current / resolution;
    resolution * (steps / f64::from(i16::MAX)).ceil().max(1.0)
}
