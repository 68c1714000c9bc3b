//! Excitation: the current that the drive plays in open loop, so that the machine can be identified.
//!
//! ```text
//! request -> band, period -> signal (half a period, shape alone) -> table (whole steps of the output)
//!                                                                   ^                  |
//!                                          less current, if need be +--- prediction <--+
//! ```
//!
//! The table is what `arso_core::excitation` plays, entry by entry, a number of times: a periodic
//! current, so that after the first repetitions the motion is periodic too and its spectrum has no
//! leakage. A prediction with the nominal model says how far the actuator will get before anything
//! moves. `excitation_file` writes it for the firmware.

mod excitation_file;
mod prediction;
mod request;
mod signal;

use crate::design::checks::quarter_of_range;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::machine::encoder::LEAST_COUNTS;
use crate::output::significant;
use arso_core::Current;
use arso_core::limits::Limits;
use request::{band, current, half, lines, unit};

pub use excitation_file::excitation_file;
pub use prediction::Prediction;
pub use request::{ExcitationRequest, Signal};

/// Longest table, in control periods: 40 kB of the drive's flash.
pub const LONGEST_TABLE: usize = 20_000;
/// Longest excitation, in control periods, all repetitions together.
pub const LONGEST_EXCITATION: usize = 1_000_000;

/// Steps that the peak current must have, or rounding distorts the signal.
const LEAST_PEAK: i16 = 10;
/// Travel allowed where none is given, and the least that must be allowed, in terms of the one
/// predicted: the machine is not yet known.
const TRAVEL: f64 = 4.0;
const LEAST_TRAVEL: f64 = 2.0;

/// An excitation of a drive, complete.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationPlan {
    /// Which signal.
    pub signal: Signal,
    /// Control period it is made for, s.
    pub sample_time: f64,
    /// Odd multiples of 1 / period that lie in the band.
    pub lines: Vec<usize>,
    /// One period of the current, in steps of `unit`.
    pub table: Vec<i16>,
    /// A per step.
    pub unit: f64,
    /// How often it is played.
    pub repetitions: u16,
    /// Farthest the actuator may get from where it begins, m.
    pub travel: f64,
    /// What the nominal model makes of it.
    pub prediction: Prediction,
    /// Peak current that was wanted, A, where the travel does not allow it.
    pub reduced_from: Option<f64>,
    limits: Limits,
}

impl ExcitationPlan {
    /// Forms the excitation of a drive.
    ///
    /// # Errors
    /// [`Error::Parameter`] or [`Error::Usage`], one sentence on what is asked for and cannot be done.
    pub fn new(drive: &Drive, request: &ExcitationRequest) -> Result<Self> {
        let sample_time = drive.control.sample_time;
        let band = band(drive, request)?;
        let half = half(request, band, sample_time)?;
        let lines = lines(request, band, half, sample_time)?;
        let length = 2 * half * usize::from(request.repetitions);
        if length > LONGEST_EXCITATION {
            let rule = format!(
                "makes {length} control periods, at most {LONGEST_EXCITATION} can be played"
            );
            return Err(Error::parameter("repetitions", request.repetitions, rule));
        }
        let current = current(drive, request)?;
        let unit = unit(drive, current);
        if let Some(travel) = request.travel
            && !(1e-9..=1e9).contains(&travel)
        {
            let rule = format!("must be from 1e-9 to 1e9 {}", drive.kind.units().position);
            return Err(Error::parameter("travel", travel, rule));
        }

        let shape = match request.signal {
            Signal::Multisine => signal::multisine(half, &lines),
            Signal::Chirp => signal::chirp(half, band.map(|end| end * sample_time * half as f64)),
        };
        let shape = signal::begun_at_standstill(&shape);
        // A few rounding errors wide: 1 A is 1000 steps of 1 mA. The unit keeps it within an i16.
        let mut peak = (current / unit * (1.0 + 1e-9)).floor() as i16;
        if peak < LEAST_PEAK {
            let rule =
                format!("must be {LEAST_PEAK} steps of the current output of {unit} A at least");
            return Err(match request.current {
                Some(current) => Error::parameter("current", current, rule),
                None => Error::Usage(format!("the current limit of {current} A: {rule}")),
            });
        }
        let mut plan = Self {
            signal: request.signal,
            sample_time,
            lines,
            table: signal::in_steps(&shape, peak),
            unit,
            repetitions: request.repetitions,
            travel: 0.0,
            prediction: Prediction::default(),
            reduced_from: None,
            limits: Limits {
                current_limit: drive.actuator.current_limit as f32,
                current_resolution: drive.actuator.current_resolution as f32,
            },
        };
        plan.prediction = Prediction::new(drive, &plan)?;
        plan.travel = request.travel.unwrap_or(TRAVEL * plan.prediction.travel);
        while LEAST_TRAVEL * plan.prediction.travel > plan.travel {
            // The model is linear; rounding may cost another step.
            let fits = plan.travel / (LEAST_TRAVEL * plan.prediction.travel);
            peak = (peak - 1).min((f64::from(peak) * fits).floor() as i16);
            if peak < LEAST_PEAK {
                let rule = format!(
                    "leaves less than {LEAST_PEAK} steps of the current output; allow more, or raise \
                     `from`"
                );
                return Err(Error::parameter("travel", plan.travel, rule));
            }
            plan.table = signal::in_steps(&shape, peak);
            plan.prediction = Prediction::new(drive, &plan)?;
            plan.reduced_from = Some(current);
        }
        let per_period = plan.prediction.speed * sample_time / drive.encoder.resolution;
        let largest = quarter_of_range(drive.encoder.counter_bits);
        if per_period > largest {
            return Err(Error::Usage(format!(
                "a current of {} A moves the encoder by {per_period:.0} counts in one control period: must be \
                 {largest} at most, a quarter of its counter's range, allow less `current` or less `travel`",
                significant(plan.peak(), 3)
            )));
        }
        // Fewer hide in their own rounding, and what sticks does not move.
        let counts = plan.prediction.with_friction / drive.encoder.resolution;
        if counts < LEAST_COUNTS {
            return Err(Error::Usage(format!(
                "a current of {} A moves the actuator by {counts:.0} counts with the friction of the drive \
                 file: must be {LEAST_COUNTS} at least, allow more `current` or more `travel`",
                significant(plan.peak(), 3)
            )));
        }
        Ok(plan)
    }

    /// Every current of the excitation, A, as the drive applies it: through its limiter and in `f32`.
    pub fn currents(&self) -> impl Iterator<Item = f32> {
        let limiter = self.limits.limiter();
        let once = self.table.iter().map(|steps| {
            let wanted = Current(f32::from(*steps) * self.unit as f32);
            // What is finite is never refused.
            let limited = limiter.step(wanted);
            limited.map_or(0.0, |limited| limited.current.0)
        });
        let once: Vec<f32> = once.collect();
        let length = once.len() * usize::from(self.repetitions);
        once.into_iter().cycle().take(length)
    }

    /// Amplitude of every multiple of 1 / period from 0 on, A.
    #[must_use]
    pub fn amplitudes(&self) -> Vec<f64> {
        let mut planner = realfft::RealFftPlanner::<f64>::new();
        let transform = planner.plan_fft_forward(self.table.len());
        let mut once: Vec<f64> = self.currents().map(f64::from).collect();
        once.truncate(self.table.len());
        let mut spectrum = transform.make_output_vec();
        // Both have the length that the plan asks for.
        let _ = transform.process(&mut once, &mut spectrum);
        let scale = 2.0 / self.table.len() as f64;
        spectrum.iter().map(|line| scale * line.norm()).collect()
    }

    /// Where the actuator is predicted to be at each control period, with the friction of the drive file, m.
    ///
    /// # Errors
    /// When its motion is no longer finite.
    pub fn motion(&self, drive: &Drive) -> Result<Vec<f64>> {
        prediction::motion(drive, self)
    }

    /// Largest current, A.
    #[must_use]
    pub fn peak(&self) -> f64 {
        let largest = self.table.iter().map(|steps| steps.unsigned_abs()).max();
        f64::from(largest.unwrap_or(0)) * self.unit
    }

    /// Root mean square of the current, A.
    #[must_use]
    pub fn rms(&self) -> f64 {
        let squares: f64 = self
            .table
            .iter()
            .map(|steps| f64::from(*steps).powi(2))
            .sum();
        (squares / self.table.len() as f64).sqrt() * self.unit
    }

    /// One period, s.
    #[must_use]
    pub fn period(&self) -> f64 {
        self.table.len() as f64 * self.sample_time
    }

    /// All repetitions, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.period() * f64::from(self.repetitions)
    }

    /// Lowest and highest of the lines, Hz.
    #[must_use]
    pub fn band(&self) -> [f64; 2] {
        let end = |line: Option<&usize>| line.map_or(0.0, |line| *line as f64 / self.period());
        [end(self.lines.first()), end(self.lines.last())]
    }
}

#[cfg(test)]
mod tests;
