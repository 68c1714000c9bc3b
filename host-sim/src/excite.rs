//! Excitation: the current that the drive plays in open loop, so that the machine can be identified.
//!
//! ```text
//! wish -> band, period -> signal (half a period, shape alone) -> table (whole steps of the output)
//!                                                                ^                  |
//!                                       less current, if need be +--- prediction <--+
//! ```
//!
//! The table is what `arso_core::excitation` plays, entry by entry, a number of times: a periodic
//! current, so that after the first repetitions the motion is periodic too and its spectrum has no
//! leakage. A prediction with the nominal model says how far the actuator will get before anything
//! moves.

mod prediction;
mod signal;
mod source;

use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::identify::LEAST_COUNTS;
use crate::model::Chain;
use crate::report::significant;
use arso_core::Current;
use arso_core::limits::Limits;

pub use prediction::Prediction;
pub use source::{csv, source};

/// Longest table, in control periods: 40 kB of the drive's flash.
pub const LONGEST_TABLE: usize = 20_000;
/// Longest play, in control periods, all repetitions together.
pub const LONGEST_PLAY: usize = 1_000_000;

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
/// Steps that the peak current must have, or rounding distorts the signal.
const LEAST_PEAK: i16 = 10;
/// Travel allowed where none is given, and the least that must be allowed, in terms of the one
/// predicted: the machine is not yet known.
const TRAVEL: f64 = 4.0;
const LEAST_TRAVEL: f64 = 2.0;

/// Which signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Signal {
    /// Every odd multiple of 1 / period in the band, with equal current.
    #[default]
    Multisine,
    /// A linear sweep through the band and back, twice per period, the second time upside down.
    Chirp,
}

impl Signal {
    /// As the command line names it.
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
pub struct Wish {
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

impl Default for Wish {
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

/// An excitation, complete.
#[derive(Clone, Debug, PartialEq)]
pub struct Play {
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

impl Play {
    /// Forms the excitation of a drive.
    ///
    /// # Errors
    /// [`Error::Usage`], one sentence on what is asked for and cannot be done.
    pub fn new(drive: &Drive, wish: &Wish) -> Result<Self> {
        let sample_time = drive.control.sample_time;
        let band = band(drive, wish)?;
        let half = half(wish, band, sample_time)?;
        let lines = lines(wish, band, half, sample_time)?;
        let length = 2 * half * usize::from(wish.repetitions);
        if length > LONGEST_PLAY {
            return usage(format!(
                "--repeat {}: makes {length} control periods, at most {LONGEST_PLAY} can be played",
                wish.repetitions
            ));
        }
        let current = current(drive, wish)?;
        let unit = unit(drive, current);
        if let Some(travel) = wish.travel
            && !(1e-9..=1e9).contains(&travel)
        {
            return usage(format!(
                "--travel {travel}: must be from 1e-9 to 1e9 {}",
                drive.kind.units().position
            ));
        }

        let shape = match wish.signal {
            Signal::Multisine => signal::multisine(half, &lines),
            Signal::Chirp => signal::chirp(half, band.map(|end| end * sample_time * half as f64)),
        };
        let shape = signal::begun_at_standstill(&shape);
        // A few rounding errors wide: 1 A is 1000 steps of 1 mA. The unit keeps it within an i16.
        let mut peak = (current / unit * (1.0 + 1e-9)).floor() as i16;
        if peak < LEAST_PEAK {
            let given = match wish.current {
                Some(current) => format!("--current {current}"),
                None => format!("the current limit of {current} A"),
            };
            return usage(format!(
                "{given}: must be {LEAST_PEAK} steps of the current output of {unit} A at least"
            ));
        }
        let mut play = Self {
            signal: wish.signal,
            sample_time,
            lines,
            table: signal::in_steps(&shape, peak),
            unit,
            repetitions: wish.repetitions,
            travel: 0.0,
            prediction: Prediction::default(),
            reduced_from: None,
            limits: Limits {
                current_limit: drive.actuator.current_limit as f32,
                current_resolution: drive.actuator.current_resolution as f32,
            },
        };
        play.prediction = Prediction::new(drive, &play)?;
        play.travel = wish.travel.unwrap_or(TRAVEL * play.prediction.travel);
        while LEAST_TRAVEL * play.prediction.travel > play.travel {
            // The model is linear; rounding may cost another step.
            let fits = play.travel / (LEAST_TRAVEL * play.prediction.travel);
            peak = (peak - 1).min((f64::from(peak) * fits).floor() as i16);
            if peak < LEAST_PEAK {
                return usage(format!(
                    "--travel {}: leaves less than {LEAST_PEAK} steps of the current output; \
                     allow more, or raise --from",
                    play.travel
                ));
            }
            play.table = signal::in_steps(&shape, peak);
            play.prediction = Prediction::new(drive, &play)?;
            play.reduced_from = Some(current);
        }
        // Fewer hide in their own rounding, and what sticks does not move.
        let counts = play.prediction.with_friction / drive.encoder.resolution;
        if counts < LEAST_COUNTS {
            return usage(format!(
                "a current of {} A moves the actuator by {counts:.0} counts with the friction of the drive \
                 file: must be {LEAST_COUNTS} at least, allow more --current or more --travel",
                significant(play.peak(), 3)
            ));
        }
        Ok(play)
    }

    /// Every current of the play, A, as the drive applies it: through its limiter and in `f32`.
    pub fn currents(&self) -> impl Iterator<Item = f32> {
        let once = self.table.iter().map(|steps| {
            let wanted = Current(f32::from(*steps) * self.unit as f32);
            // What is finite is never refused.
            let limited = self.limits.step(wanted);
            limited.map_or(0.0, |limited| limited.current.0)
        });
        let once: Vec<f32> = once.collect();
        let length = once.len() * usize::from(self.repetitions);
        once.into_iter().cycle().take(length)
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

fn usage<T>(message: String) -> Result<T> {
    Err(Error::Usage(message))
}

/// Both ends of the band, Hz.
fn band(drive: &Drive, wish: &Wish) -> Result<[f64; 2]> {
    let modes = Chain::new(&drive.actuator, &drive.loads, 0.0).modes();
    let highest = HIGHEST / drive.control.sample_time;
    let of_mode = |mode: Option<&crate::model::Mode>| mode.map_or(highest, |m| m.frequency_hz);
    // Lower than any mode, but not lower than a table can hold.
    let slowest = of_mode(modes.first());
    let lowest = SLOWEST / (LONGEST_TABLE as f64 * drive.control.sample_time) * (1.0 + 1e-9);
    if wish.from.is_none() && lowest > AT_MODES * slowest {
        return usage(format!(
            "the slowest mode of {slowest:.3} Hz is too slow to be excited within {LONGEST_TABLE} control \
             periods of {} s: --from and --period say what is wanted instead",
            drive.control.sample_time
        ));
    }
    let from = wish.from.unwrap_or(lowest.max(BELOW_MODES * slowest));
    let to = wish
        .to
        .unwrap_or((ABOVE_MODES * of_mode(modes.last())).min(highest));
    if !(from > 0.0 && from.is_finite()) {
        return usage(format!("--from {from}: must be above 0 Hz"));
    }
    // Half a line of rounding at the most.
    if !(to > 0.0 && to <= highest * (1.0 + 1e-9)) {
        return usage(format!(
            "--to {to}: must be above 0 and at most 0.4 / sample_time = {highest} Hz"
        ));
    }
    if from >= to {
        return usage(format!(
            "the band from {from:.3} to {to:.3} Hz is empty: --from must be below --to"
        ));
    }
    Ok([from, to])
}

/// Control periods in half a period.
fn half(wish: &Wish, [from, _]: [f64; 2], sample_time: f64) -> Result<usize> {
    let longest = LONGEST_TABLE as f64;
    if let Some(period) = wish.period {
        let samples = period / sample_time;
        if period * from >= 1.0 - 1e-9 && samples < longest + 1.0 {
            return Ok((0.5 * samples).round() as usize);
        }
        return usage(format!(
            "--period {period}: must be from one period of the lower end of the band, {} s, to \
             {LONGEST_TABLE} control periods, {} s",
            significant(1.0 / from, 4),
            significant(longest * sample_time, 4)
        ));
    }
    let needed = SLOWEST / (from * sample_time);
    if needed > longest {
        return usage(format!(
            "--from {from}: must be {} Hz at least, {SLOWEST} of its periods must fit into \
             {LONGEST_TABLE} control periods where no --period is given",
            significant(SLOWEST / (longest * sample_time), 4)
        ));
    }
    let usual = (0.5 * PERIOD / sample_time).round().min(0.5 * longest);
    Ok(usual.max((0.5 * needed).ceil()) as usize)
}

/// Odd multiples of 1 / period in the band.
fn lines(wish: &Wish, [from, to]: [f64; 2], half: usize, sample_time: f64) -> Result<Vec<usize>> {
    let period = 2.0 * half as f64 * sample_time;
    // What lies on an end of the band, lies in it.
    let first = (from * period - 1e-6).ceil().max(1.0) as usize;
    let last = (to * period + 1e-6).floor() as usize;
    let lines: Vec<usize> = (first | 1..=last).step_by(2).collect();
    if lines.is_empty() {
        return usage(format!(
            "--period {}: no odd multiple of its inverse lies from {} to {} Hz, make it longer",
            wish.period.unwrap_or(period),
            significant(from, 4),
            significant(to, 4)
        ));
    }
    Ok(lines)
}

/// Peak current, A.
fn current(drive: &Drive, wish: &Wish) -> Result<f64> {
    let limit = drive.actuator.current_limit;
    // A small motor may need more of its limit for the output to have steps enough.
    let least = f64::from(LEAST_PEAK) * drive.actuator.current_resolution;
    let current = wish
        .current
        .unwrap_or((SHARE * limit).max(least).min(limit));
    if current > 0.0 && current <= limit {
        Ok(current)
    } else {
        usage(format!(
            "--current {current}: must be above 0 and at most the current limit of {limit} A"
        ))
    }
}

/// Unit of the table, A: a step of the output, or as many as it takes for an `i16` to hold the
/// peak.
fn unit(drive: &Drive, current: f64) -> f64 {
    let resolution = match drive.actuator.current_resolution {
        0.0 => drive.actuator.current_limit / CONTINUOUS,
        resolution => resolution,
    };
    let steps = current / resolution;
    resolution * (steps / f64::from(i16::MAX)).ceil().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Friction, PlantFile};
    use crate::plant::Plant;
    use std::f64::consts::TAU;

    fn play(wish: Wish) -> Play {
        Play::new(&Drive::default_drive(), &wish).unwrap()
    }

    /// Amplitude of a multiple of 1 / period, steps: the discrete Fourier transform by its
    /// definition.
    fn amplitude(table: &[i16], line: usize) -> f64 {
        let samples = table.len();
        let (mut re, mut im) = (0.0, 0.0);
        for (k, step) in table.iter().enumerate() {
            let angle = TAU * ((k * line) % samples) as f64 / samples as f64;
            re += f64::from(*step) * angle.cos();
            im -= f64::from(*step) * angle.sin();
        }
        2.0 * re.hypot(im) / samples as f64
    }

    /// Equal current in every odd line of the band and none beside it, but for rounding: that of the
    /// beginning shows at the lowest lines, and is less than a step.
    #[test]
    fn the_spectrum_of_the_multisine_is_the_band() {
        let play = play(Wish::default());
        assert_eq!(
            (play.table.len(), play.lines.clone()),
            (2048, (5..=111).step_by(2).collect())
        );
        let expected = play.rms() / play.unit * (2.0 / 54.0_f64).sqrt();
        assert!(expected > 40.0);
        for line in 0..1024 {
            let found = amplitude(&play.table, line);
            if play.lines.contains(&line) {
                assert!((found - expected).abs() < 0.5, "{line}: {found} {expected}");
            } else if line % 2 == 0 {
                assert!(found < 1e-9, "{line}: {found}");
            } else if line < 5 {
                assert!(found < 1.0, "{line}: {found}");
            } else {
                assert!(found < 0.15, "{line}: {found}");
            }
        }
    }

    #[test]
    fn the_chirp_s_current_is_in_the_band() {
        let play = play(Wish {
            signal: Signal::Chirp,
            ..Wish::default()
        });
        let lines = play.lines.iter();
        let power: f64 = lines
            .map(|line| 0.5 * amplitude(&play.table, *line).powi(2))
            .sum();
        let all = (play.rms() / play.unit).powi(2);
        assert!(power > 0.95 * all, "{power} {all}");
        assert!((play.rms() / play.peak() - 0.5_f64.sqrt()).abs() < 0.01);
    }

    #[test]
    fn the_defaults_are_those_of_the_drive() {
        let drive = Drive::default_drive();
        let play = play(Wish::default());
        let modes = Chain::new(&drive.actuator, &drive.loads, 0.0).modes();
        let [from, to] = play.band();
        let line = 2.0 / 2.048;
        assert!((0.0..line).contains(&(from - 0.2 * modes[0].frequency_hz)));
        assert!((0.0..line).contains(&(1.5 * modes[2].frequency_hz - to)));
        assert!((play.peak() - 0.5).abs() < 1e-12);
        assert_eq!((play.unit, play.repetitions), (1e-3, 4));
        assert!((play.duration() - 8.192).abs() < 1e-12);
        assert_eq!(play.travel, 4.0 * play.prediction.travel);
        assert_eq!(play.currents().count(), 4 * 2048);
        assert_eq!(
            play.table.iter().map(|step| i32::from(*step)).sum::<i32>(),
            0
        );
    }

    /// Drives of all speeds and outputs: the table fits, its currents are steps of the output.
    #[test]
    fn every_drive_has_an_excitation() {
        for (sample_time, limit, resolution) in [
            (1e-3, 2.0, 1e-3),
            (1e-4, 2.0, 0.0),
            (5e-5, 300.0, 1e-3),
            (2.5e-3, 0.02, 1e-3),
            (1e-3, 1e9, 1e-9),
        ] {
            let mut drive = Drive::default_drive();
            drive.control.sample_time = sample_time;
            drive.actuator.current_limit = limit;
            drive.actuator.current_resolution = resolution;
            for signal in [Signal::Multisine, Signal::Chirp] {
                let wish = Wish {
                    signal,
                    repetitions: 1,
                    ..Wish::default()
                };
                let play = Play::new(&drive, &wish).unwrap();
                assert!(play.table.len() <= LONGEST_TABLE && play.lines[0] >= 4);
                let wanted = (0.25 * limit).max(10.0 * resolution);
                assert!(play.peak() <= wanted * (1.0 + 1e-9) && play.peak() > 0.9 * wanted);
                if resolution > 0.0 {
                    let steps = play.unit / resolution;
                    assert!((steps - steps.round()).abs() < 1e-6, "{steps}");
                }
                let lines = play.band().map(|end| end * sample_time);
                assert!(lines[0] > 0.0 && lines[1] <= 0.4);
            }
        }
    }

    /// A nearly rigid chain: the travel is the current integrated twice, and the springs carry the
    /// loads' inertia at the largest current, that at the actuator most.
    #[test]
    fn the_prediction_of_a_rigid_chain_is_newton_s() {
        let mut drive = Drive::default_drive();
        for load in &mut drive.loads {
            (load.stiffness, load.damping) = (1e6, 300.0);
        }
        let wish = Wish {
            from: Some(2.0),
            to: Some(20.0),
            ..Wish::default()
        };
        let play = Play::new(&drive, &wish).unwrap();
        let per_step = 6.43 / 0.116 * play.unit;
        let (mut position, mut velocity, mut farthest) = (0.0, 0.0, 0.0_f64);
        for step in &play.table {
            let acceleration = f64::from(*step) * per_step;
            position += 1e-3 * velocity + 0.5e-6 * acceleration;
            velocity += 1e-3 * acceleration;
            farthest = farthest.max(position.abs());
        }
        let found = play.prediction;
        assert!(
            (found.travel / farthest - 1.0).abs() < 1e-3,
            "{found:?} {farthest}"
        );
        let stretch = 0.057 * play.peak() * 6.43 / 0.116 / 1e6;
        assert_eq!(found.spring, 1);
        assert!(
            (found.stretch / stretch - 1.0).abs() < 0.02,
            "{found:?} {stretch}"
        );
    }

    /// A hundred plays on the flexible chain: the centre of mass always comes back, and the actuator
    /// gets no farther than was predicted for a few.
    #[test]
    fn the_machine_does_not_drift_away() {
        let drive = Drive::default_drive();
        let play = play(Wish::default());
        let mut plant = Plant::new(&PlantFile::from(&drive), play.sample_time);
        let mut farthest = 0.0_f64;
        for _ in 0..100 {
            for step in &play.table {
                plant.advance(f64::from(*step) * play.unit).unwrap();
                farthest = farthest.max(plant.state()[0].abs());
            }
            let mass = plant.chain().mass.iter().enumerate();
            let moment: f64 = mass.map(|(i, m)| m * plant.state()[2 * i]).sum();
            assert!((moment / 0.116).abs() < 1e-9, "{moment}");
        }
        let predicted = play.prediction.travel;
        assert!(
            (farthest / predicted - 1.0).abs() < 1e-3,
            "{farthest} {predicted}"
        );
    }

    /// Friction that is the same in both directions does not make the machine creep, once it has
    /// settled. With every multiple of 1 / period in the signal the default drive creeps by 0.1 m in each
    /// repetition, at 0.05 N already.
    #[test]
    fn friction_does_not_make_it_creep() {
        for signal in [Signal::Multisine, Signal::Chirp] {
            for (coulomb, viscous) in [(0.05, 0.0), (0.1, 0.2), (1.0, 0.0)] {
                let mut drive = Drive::default_drive();
                drive.friction = Friction { coulomb, viscous };
                let travel = |repetitions| {
                    let wish = Wish {
                        signal,
                        repetitions,
                        ..Wish::default()
                    };
                    Play::new(&drive, &wish).unwrap().prediction.travel
                };
                let creep = (travel(30) - travel(10)) / 20.0;
                assert!(creep < 2e-3, "{signal:?} {coulomb} {viscous}: {creep}");
            }
        }
    }

    /// Half of the travel that is given is enough for what is predicted; the rest is the wish's.
    #[test]
    fn the_current_is_reduced_to_fit_the_travel() {
        let whole = play(Wish::default());
        let reduced = play(Wish {
            travel: Some(0.5 * whole.prediction.travel),
            ..Wish::default()
        });
        assert_eq!(reduced.reduced_from, Some(0.5));
        assert_eq!(reduced.travel, 0.5 * whole.prediction.travel);
        assert!(
            (reduced.peak() - 0.125).abs() < 0.0025,
            "{}",
            reduced.peak()
        );
        assert!(reduced.prediction.travel <= 0.5 * reduced.travel);
        let wide = play(Wish {
            travel: Some(2.0 * whole.prediction.travel),
            ..Wish::default()
        });
        assert_eq!((wide.reduced_from, wide.table), (None, whole.table));
    }

    /// Friction beyond the current holds the actuator: said before anything is played.
    #[test]
    fn a_current_that_moves_nothing_is_refused() {
        let mut drive = Drive::default_drive();
        drive.friction.coulomb = 4.0;
        let error = Play::new(&drive, &Wish::default()).unwrap_err().to_string();
        assert!(
            error.contains("a current of 0.500 A moves the actuator by 0 counts"),
            "{error}"
        );
        let current = Some(1.5);
        let wish = Wish {
            current,
            ..Wish::default()
        };
        assert!(Play::new(&drive, &wish).is_ok());
    }

    /// The source is what the firmware compiles (a test of the firmware's file has the rest).
    #[test]
    fn source_and_csv_hold_every_entry() {
        let drive = Drive::default_drive();
        let play = play(Wish::default());
        let text = source(&play, &drive, "test.toml");
        let (_, profile) = text.split_once("profile: &[").unwrap();
        let (profile, _) = profile.split_once(']').unwrap();
        let entries = profile.split(',').map(str::trim).filter(|e| !e.is_empty());
        let entries: Vec<i16> = entries.map(|entry| entry.parse().unwrap()).collect();
        assert_eq!(entries, play.table);
        assert!(text.lines().all(|line| line.len() <= 120));

        let csv = csv(&play);
        let rows: Vec<&str> = csv.lines().collect();
        assert_eq!((rows.len(), rows[0]), (1 + 4 * 2048, "time[s],current[A]"));
        for (k, row) in rows[1..].iter().enumerate() {
            let (time, current) = row.split_once(',').unwrap();
            let steps = current.parse::<f64>().unwrap() / 1e-3;
            assert!((time.parse::<f64>().unwrap() - k as f64 * 1e-3).abs() < 1e-9);
            assert!((steps - f64::from(play.table[k % 2048])).abs() < 1e-3);
        }
    }
}
