//! A machine that moves, and is waited for.

use super::Connection;
use crate::capture::short;
use crate::error::{Error, Result};
use crate::output::significant;
use arso_core::link::message::Status;
use arso_core::request::{Reason, Request};
use arso_core::{Fault, Homing, Mode, Place, Refusal, Velocity};
use std::time::{Duration, Instant};

/// Largest position, distance or velocity that can be asked for, m or m/s.
pub const LARGEST: f64 = 1e6;

/// How often a drive that moves is looked at, and one that jogs or homes, which ends it when it hears nothing for 100 ms.
const EVERY: Duration = Duration::from_millis(5);
const EVERY_IN_JOG: Duration = Duration::from_millis(30);
/// Time of the drive after which what it is doing is what was asked of it, s.
const BEGUN: f64 = 0.01;

/// How long a machine is waited for that settles.
const SETTLES: Duration = Duration::from_secs(5);

/// Whether to go on waiting.
pub type GoOn<'a> = dyn Fn() -> bool + 'a;

/// A machine that has come to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// What the drive is doing then.
    pub status: Status,
    /// How long it took by the drive's clock, s.
    pub time: f64,
}

impl Connection {
    /// Distance per count, m.
    #[must_use]
    pub fn resolution(&self) -> f64 {
        short(self.introduction().resolution)
    }

    /// Position of a place, m.
    #[must_use]
    pub fn position(&self, place: Place) -> f64 {
        place.0 as f64 * self.resolution()
    }

    /// Nearest whole counts of a position or distance, m.
    ///
    /// # Errors
    /// [`Error::Parameter`] as [`require_possible`].
    pub fn counts(&self, parameter: &'static str, length: f64) -> Result<i64> {
        require_possible(parameter, length)?;
        Ok((length / self.resolution()).round() as i64)
    }

    /// A position or distance, m, as people read it.
    #[must_use]
    pub fn shown(&self, length: f64) -> String {
        let decimals = (-self.resolution().log10()).ceil().clamp(0.0, 12.0) as usize;
        format!(
            "{length:.decimals$} {}",
            self.origin().kind.units().position
        )
    }

    /// Closes the loop; an idle drive proves its signs before. Whether there was something to do.
    ///
    /// # Errors
    /// [`Error::Refused`], [`Error::Drive`] for a fault on the way and for an interruption, after which the drive is
    /// disabled; [`Error::Link`].
    pub fn enable(&mut self, go_on: &GoOn<'_>) -> Result<bool> {
        let before = self.status()?;
        require_go_on(go_on)?;
        match before.mode {
            Mode::Running => return Ok(false),
            Mode::Ready => {}
            mode => {
                // Of the other modes all but this one refuse.
                if mode != Mode::Commissioning {
                    self.request(Request::Commission)?;
                }
                let ready = self.follow(&before, go_on, |_, status| match status.mode {
                    Mode::Ready => Ok(true),
                    Mode::Commissioning => Ok(false),
                    mode => Err(left("proving its signs", mode)),
                })?;
                if ready.is_none() || !go_on() {
                    self.request(Request::Stop)?;
                    return Err(interrupted("the drive is disabled"));
                }
            }
        }
        self.request(Request::Start)?;
        self.follow(&before, &|| true, |_, status| running(status))?;
        Ok(true)
    }

    /// Acknowledges a fault, once the machine stands. Whether there was one.
    ///
    /// # Errors
    /// [`Error::Link`].
    pub fn clear(&mut self) -> Result<bool> {
        loop {
            match self.status()?.mode {
                // `Stop` would switch the amplifier off while the loop brakes.
                Mode::Stopping(_) => std::thread::sleep(EVERY),
                Mode::Fault(_) => return self.request(Request::Stop).map(|()| true),
                _ => return Ok(false),
            }
        }
    }

    /// Asks for a move, and waits until the machine is held at its target.
    ///
    /// # Errors
    /// [`Error::Refused`]; [`Error::Drive`] for a fault on the way, for a drive that something else is asked of, and
    /// for an interruption, after which the machine is halted; [`Error::Link`].
    pub fn go(&mut self, request: Request, go_on: &GoOn<'_>) -> Result<Arrival> {
        let before = self.status()?;
        require_go_on(go_on)?;
        self.request(request)?;
        let arrival = self.follow(&before, go_on, |drive, status| {
            running(status)?;
            match (status.held, request) {
                (Some(held), Request::Move(target)) if held != target => {
                    let (held, target) = (drive.position(held), drive.position(target));
                    Err(Error::Drive(format!(
                        "the machine is held at {}, and not at the target {}: something else was asked of the drive",
                        drive.shown(held),
                        drive.shown(target)
                    )))
                }
                (held, _) => Ok(held.is_some()),
            }
        })?;
        if let Some(arrival) = arrival {
            return Ok(arrival);
        }
        let position = self.halt()?.status.position.into();
        let place = self.shown(position);
        Err(interrupted(&format!("the machine is halted at {place}")))
    }

    /// Brings the machine to rest by a plan, and waits until it is held.
    ///
    /// # Errors
    /// [`Error::Refused`]; [`Error::Drive`] for a fault on the way; [`Error::Link`].
    pub fn halt(&mut self) -> Result<Arrival> {
        let before = self.status()?;
        self.request(Request::Halt)?;
        let arrival = self.follow(&before, &|| true, |_, status| {
            running(status)?;
            Ok(status.held.is_some())
        })?;
        // Nothing interrupts it.
        arrival.ok_or_else(|| interrupted("the machine is being halted"))
    }

    /// Moves at a velocity for a time, or until it is interrupted, and brings the machine to rest. Whether it had
    /// come to rest by itself, and when it stands.
    ///
    /// * `velocity`: m/s
    /// * `duration`: by the drive's clock, s
    ///
    /// # Errors
    /// [`Error::Parameter`] for a velocity that is none; otherwise as [`halt`](Self::halt).
    pub fn jog(
        &mut self,
        velocity: f64,
        duration: Option<f64>,
        go_on: &GoOn<'_>,
    ) -> Result<(bool, Arrival)> {
        require_possible("velocity", velocity)?;
        let before = self.status()?;
        require_go_on(go_on)?;
        self.request(Request::Jog(Velocity(velocity as f32)))?;
        loop {
            let status = self.status_in_jog()?;
            let time = self.time(before.period, status.period);
            require_no_fault(&status)?;
            if time >= BEGUN {
                running(&status)?;
                if status.held.is_some() {
                    return Ok((true, Arrival { status, time }));
                }
            }
            if !go_on() || duration.is_some_and(|duration| time >= duration) {
                let halted = self.halt()?;
                let time = self.time(before.period, halted.status.period);
                return Ok((false, Arrival { time, ..halted }));
            }
            let left = duration.map_or(EVERY_IN_JOG, |duration| {
                Duration::from_secs_f64((duration - time).clamp(0.0, 1.0))
            });
            std::thread::sleep(left.min(EVERY_IN_JOG));
        }
    }

    /// Lets the drive find its zero, and waits until the machine rests where it is to, zero known.
    ///
    /// # Errors
    /// [`Error::Refused`]; [`Error::Drive`] for a fault on the way, for a drive that comes to rest without having found
    /// it, and for an interruption, after which the machine is halted and zero is what it was; [`Error::Link`].
    pub fn home(&mut self, homing: Homing, go_on: &GoOn<'_>) -> Result<Arrival> {
        require_go_on(go_on)?;
        self.home_from_rest(homing, go_on)?;
        let before = self.status()?;
        let rests = homing.rests_at(homing.position);
        loop {
            let status = self.status_in_jog()?;
            let time = self.time(before.period, status.period);
            require_no_fault(&status)?;
            if time >= BEGUN {
                running(&status)?;
                if !status.homing && status.held == Some(rests) && status.position_set {
                    return Ok(Arrival { status, time });
                }
                if !status.homing {
                    return Err(Error::Drive(
                        "homing ended before it had found its place: something else was asked of the drive, or it \
                         heard nothing for 0.1 s; zero is what it was"
                            .into(),
                    ));
                }
            }
            if !go_on() {
                let position = self.halt()?.status.position.into();
                let place = self.shown(position);
                return Err(interrupted(&format!(
                    "the machine is halted at {place}, zero is what it was"
                )));
            }
            std::thread::sleep(EVERY_IN_JOG);
        }
    }

    /// Asks for homing, once the machine has settled.
    fn home_from_rest(&mut self, homing: Homing, go_on: &GoOn<'_>) -> Result<()> {
        let patience = Instant::now() + SETTLES;
        loop {
            match self.request(Request::Home(homing)) {
                Err(Error::Refused(Refusal {
                    reason: Reason::Moving,
                    ..
                })) if go_on() && Instant::now() < patience => std::thread::sleep(EVERY),
                done => return done,
            }
        }
    }

    /// Time of the drive between two periods, s.
    fn time(&self, from: u32, to: u32) -> f64 {
        f64::from(to.wrapping_sub(from)) * self.origin().period
    }

    /// Looks at a drive of which something was asked until that is done; nothing where it was interrupted.
    ///
    /// * `before`: what it was doing before it was asked
    /// * `done`: of a status which is later than what was asked
    fn follow(
        &mut self,
        before: &Status,
        go_on: &GoOn<'_>,
        mut done: impl FnMut(&Self, &Status) -> Result<bool>,
    ) -> Result<Option<Arrival>> {
        let begun = self.status()?;
        let mut status = begun;
        loop {
            require_no_fault(&status)?;
            let later = self.time(begun.period, status.period) >= BEGUN;
            if later && done(self, &status)? {
                let time = self.time(before.period, status.period);
                return Ok(Some(Arrival { status, time }));
            }
            if !go_on() {
                return Ok(None);
            }
            std::thread::sleep(EVERY);
            status = self.status()?;
        }
    }
}

/// Refuses a position, distance or velocity that nobody means.
///
/// # Errors
/// [`Error::Parameter`] for what is no number, or larger than [`LARGEST`].
pub fn require_possible(parameter: &'static str, value: f64) -> Result<()> {
    if value.abs() <= LARGEST {
        return Ok(());
    }
    let rule = format!("must be a number from -{LARGEST:e} to {LARGEST:e}");
    Err(Error::parameter(parameter, value, rule))
}

/// Whether the drive runs, as it must to move.
fn running(status: &Status) -> Result<bool> {
    match status.mode {
        Mode::Running => Ok(true),
        mode => Err(left("running", mode)),
    }
}

fn require_no_fault(status: &Status) -> Result<()> {
    let Some(fault) = status.mode.fault() else {
        return Ok(());
    };
    let fault = fault_words(fault, status.fault_value);
    Err(Error::Drive(format!("the drive stopped with {fault}")))
}

/// A drive that no longer does what it was to go on with.
fn left(what: &str, mode: Mode) -> Error {
    Error::Drive(format!(
        "the drive stopped {what} before it was done, without a fault, and is {}: was its run switch opened?",
        mode_name(mode)
    ))
}

/// Refuses to begin what has been interrupted already.
fn require_go_on(go_on: &GoOn<'_>) -> Result<()> {
    if go_on() {
        return Ok(());
    }
    Err(interrupted("nothing was asked of the drive"))
}

fn interrupted(state: &str) -> Error {
    Error::Drive(format!("interrupted: {state}"))
}

/// What a drive is doing, in a word.
#[must_use]
pub const fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Idle => "idle",
        Mode::Commissioning => "commissioning",
        Mode::Exciting => "exciting",
        Mode::Ready => "ready",
        Mode::Storing => "storing settings",
        Mode::Running => "running",
        Mode::Stopping(_) => "stopping",
        Mode::Fault(_) => "stopped by a fault",
    }
}

/// A fault in words: number, name, the value that tripped it in the unit of its limit where it has one, what
/// happened, what to do.
#[must_use]
pub fn fault_words(fault: Fault, value: f32) -> String {
    let value = if value == 0.0 {
        String::new()
    } else {
        format!(", value {}", significant(value.into(), 4))
    };
    let (number, name) = (fault.number(), fault.name());
    format!(
        "fault {number} ({name}){value}: {}; {}",
        fault.sentence(),
        fault.remedy()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_said_with_its_value_and_its_remedy() {
        assert_eq!(
            fault_words(Fault::Velocity, 2.5),
            "fault 10 (Velocity), value 2.500: the actuator is faster than it may be; ask for slower moves, or allow \
             more"
        );
        let words = fault_words(Fault::Amplifier, 0.0);
        assert!(
            words.starts_with("fault 20 (Amplifier): the amplifier"),
            "{words}"
        );
    }
}
