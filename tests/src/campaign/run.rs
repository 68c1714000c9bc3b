//! One run: a fault at an instant, some time, and the run switch opened.

use super::faults::{Fault, Processor};
use super::inject;
use super::outcome::{Outcome, Verdict};
use super::stage::{Instant, Stage, TARGET};
use super::{RUNAWAY_BEYOND, RUNAWAY_VELOCITY};
use crate::virtual_board::rig::Switches;
use crate::virtual_board::{Rig, Stop};
use arso_core::Mode;
use host_sim::capture::read_defmt;

/// Control periods from the fault until the run switch is opened.
pub const HORIZON: u32 = 600;
/// Periods for which the amplifier must have stayed off by then.
const STAYS_OFF: u32 = 150;
/// Periods after the run switch is opened within which the amplifier must be off, and for which it is
/// waited for, to see how long it takes.
pub const STOP_WITHIN: u32 = 100;
const LONGEST_STOP: u32 = 3000;
/// Periods for which the load must be within its band at the end, and how wide that is.
const IN_BAND: u32 = 50;
const BAND: f64 = 0.02 * TARGET;
/// Which load has the target.
const TARGETED: usize = 2;

/// Makes one run on a rig.
pub fn run(fault: Fault, seed: u64, instant: &Instant, stage: &Stage, rig: &mut Rig) -> Outcome {
    rig.restore(&instant.rig);
    let mut watch = Watch::new(rig, stage);
    if fault == Fault::Processor(Processor::Reset) {
        watch.by = Some("reset");
    }
    let ends = inject::begin(fault, rig, stage, seed);
    let mut until = HORIZON;
    while watch.now < until && !watch.ran_away {
        if ends == Some(watch.now) {
            inject::end(rig, stage);
        }
        watch.period(rig, stage);
        if let Some(off) = watch.off {
            until = until.min(off + STAYS_OFF);
        }
    }
    let mut outcome = watch.outcome(rig, stage);
    if !watch.ran_away {
        open_run_switch(&mut watch, &mut outcome, rig, stage);
    }
    outcome
}

/// Opens the run switch: the amplifier must go off, and stay off.
pub fn open_run_switch(watch: &mut Watch, outcome: &mut Outcome, rig: &mut Rig, stage: &Stage) {
    rig.switches(Switches::default());
    let was_off = watch.off.is_some() && !watch.energised;
    let opened = watch.now;
    let mut off = None;
    while off.is_none_or(|off| watch.now < off + 30) && watch.now < opened + LONGEST_STOP {
        watch.period(rig, stage);
        if watch.energised {
            off = None;
        } else if off.is_none() {
            off = Some(watch.now);
        }
    }
    if !was_off {
        outcome.stop_periods = off.map(|off| off - opened);
    }
    if off.is_none_or(|off| off > opened + STOP_WITHIN) {
        outcome.verdict = Verdict::Unstoppable;
    }
}

/// Follows a run period by period.
pub struct Watch {
    /// Periods since the fault.
    pub now: u32,
    /// Whether the amplifier is enabled.
    pub energised: bool,
    /// When it was first off.
    pub off: Option<u32>,
    /// Too fast or too far while it was enabled.
    pub ran_away: bool,
    /// It was off, and came on again by itself.
    back: bool,
    /// What, other than the drive itself, has switched the amplifier off.
    by: Option<&'static str>,
    /// The amplifier's, A.
    limit: f64,
    /// Where the actuator was at the fault, m.
    origin: f64,
    travel: f64,
    current: f64,
    velocity: f64,
    beyond: f64,
    in_band: u32,
    /// Sum of the current's magnitude over the periods at the end that count for the band.
    late_current: f64,
}

impl Watch {
    /// Begins with the rig as it is.
    #[must_use]
    pub fn new(rig: &Rig, stage: &Stage) -> Self {
        Self {
            now: 0,
            energised: true,
            off: None,
            ran_away: false,
            back: false,
            by: None,
            limit: stage.drive.actuator.current_limit,
            origin: rig.plant().state()[0],
            travel: 0.0,
            current: 0.0,
            velocity: 0.0,
            beyond: 0.0,
            in_band: 0,
            late_current: 0.0,
        }
    }

    /// One period of the rig; a board that is reset starts again.
    pub fn period(&mut self, rig: &mut Rig, stage: &Stage) {
        self.now += 1;
        let resets = rig.resets;
        match rig.period() {
            Ok(period) => {
                self.energised = period.enabled;
                if rig.resets > resets {
                    self.by.get_or_insert("watchdog");
                }
            }
            Err(stop) => {
                let resets = matches!(stop, Stop::WatchdogReset | Stop::ResetRequested);
                self.energised = false;
                self.by.get_or_insert("watchdog");
                // The plant alone stops a rig otherwise, when its motion is no longer finite.
                self.ran_away |= !resets;
                rig.reset_board(&stage.fresh);
            }
        }
        self.see(rig);
    }

    fn see(&mut self, rig: &Rig) {
        let state = rig.plant().state();
        let (position, velocity) = (state[0], state[1].abs());
        // The first that is off was still energised for most of its time, or for none of it.
        if self.off.is_none() {
            self.travel = self.travel.max((position - self.origin).abs());
        }
        if self.energised {
            self.back |= self.off.is_some();
            let current = rig.amplifier.current().abs().min(self.limit);
            let beyond = (-position).max(position - TARGET).max(0.0);
            self.current = self.current.max(current);
            self.velocity = self.velocity.max(velocity);
            self.beyond = self.beyond.max(beyond);
            self.ran_away |= velocity > RUNAWAY_VELOCITY || beyond > RUNAWAY_BEYOND;
            if self.now > HORIZON - IN_BAND {
                self.late_current += current / f64::from(IN_BAND) / self.limit;
            }
        } else if self.off.is_none() {
            self.off = Some(self.now);
            if rig.board.dead().is_some() {
                self.by = self.by.or(Some("halt"));
            }
        }
        let near = (state[2 * TARGETED] - TARGET).abs() < BAND;
        self.in_band = if near { self.in_band + 1 } else { 0 };
    }

    /// What came of it so far.
    #[must_use]
    pub fn outcome(&self, rig: &Rig, stage: &Stage) -> Outcome {
        let code = (self.off.is_some() && !self.ran_away).then(|| self.code(rig, stage));
        let verdict = if self.ran_away {
            Verdict::Runaway
        } else if self.back {
            Verdict::Unstoppable
        } else if self.off.is_some() {
            Verdict::Detected
        } else if self.in_band >= IN_BAND {
            Verdict::Tolerated
        } else if self.late_current > 0.5 {
            Verdict::LeftEnergised
        } else {
            Verdict::Astray
        };
        Outcome {
            verdict,
            code,
            periods: self.off,
            travel: self.travel,
            force: self.current * stage.machine().actuator.actual_force_constant(),
            velocity: self.velocity,
            beyond: self.beyond,
            stop_periods: None,
        }
    }

    /// What has switched the amplifier off, from the log and the state of the board.
    fn code(&self, rig: &Rig, stage: &Stage) -> String {
        fault_in_log(&rig.log, &stage.elf)
            .or(self.by.map(Into::into))
            .unwrap_or_else(|| "off".into())
    }
}

/// The fault that a log tells of: the record's, or by the message where records are of another version.
fn fault_in_log(log: &[u8], elf: &[u8]) -> Option<String> {
    let capture = read_defmt(elf, "firmware", log, |_| ()).ok()?;
    let mut records = capture.records.iter();
    let recorded = records.find_map(|record| match record.mode {
        Mode::Fault(fault) => Some(fault.name().to_owned()),
        _ => None,
    });
    recorded.or_else(|| {
        let mut messages = capture.messages.iter();
        messages.find_map(|message| {
            let (_, rest) = message.split_once("fault ")?.1.split_once(": ")?;
            Some(rest.split(' ').next()?.to_owned())
        })
    })
}
