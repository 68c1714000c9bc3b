//! Other settings for a drive that runs: between two control periods, and without a leap of the current.
//!
//! What an estimate or a place means stays what it is: encoder, actuator, holding force, control period, force observers
//! and plans are those of the drive. Gains, state observer, friction and limits may change, while the machine is held
//! at a target and has settled: the estimates and the friction that was learned go on as they are, and the feedback may
//! differ by no more than [`LEAP`] of the current limit. Whether the loop is stable with the new gains is for the
//! design to know; the protection goes on with the new limits.

use super::{Activity, Controller, Parts, Running};
use crate::check::SettingsError;
use crate::moves::plans::Plans;
use crate::observer::StateObserver;
use crate::request::{Reason, Refusal, Request};
use crate::settings::Settings;

/// By which the feedback may differ, as a share of the current limit.
const LEAP: f32 = 0.01;

/// Settings that have been checked, ready for [`Controller::change`].
#[derive(Clone, Debug)]
pub struct Change<'p, const N: usize, O: StateObserver<N>>(Parts<'p, N, O>);

impl<'p, const N: usize, O: StateObserver<N> + Clone> Change<'p, N, O> {
    /// * `plans`: those that the drive has
    ///
    /// # Errors
    /// As [`Controller::new`].
    pub fn new(settings: &Settings<N, O>, plans: Plans<'p>) -> Result<Self, SettingsError> {
        Parts::new(settings, plans).map(Self)
    }
}

impl<'p, const N: usize, O: StateObserver<N> + Clone> Controller<'p, N, O> {
    /// Goes on with other settings.
    ///
    /// # Errors
    /// The refusal; nothing has changed then.
    pub fn change(&mut self, change: &Change<'p, N, O>) -> Result<(), Refusal> {
        let mode = self.mode();
        mode.next(Request::Change)?;
        let Change(parts) = change;
        if let Err(reason) = self.may_change(parts) {
            let request = Request::Change;
            return Err(Refusal {
                request,
                mode,
                reason,
            });
        }
        self.parts.clone_from(parts);
        self.copy.clone_from(parts);
        // It was made for the settings before.
        self.excitation = None;
        let place = self.encoder.is_set().then(|| self.encoder.place());
        if let Activity::Running(Running {
            memory: Some(memory),
            ..
        }) = &mut self.activity
        {
            let protection = &self.parts.protection;
            protection.renew(&mut memory.protection, self.stiction, place);
        }
        Ok(())
    }

    fn may_change(&self, parts: &Parts<'p, N, O>) -> Result<(), Reason> {
        let own = &self.parts;
        let alike = (
            own.encoder,
            own.sample_time,
            own.actuator,
            own.holding_force,
        ) == (
            parts.encoder,
            parts.sample_time,
            parts.actuator,
            parts.holding_force,
        ) && own.disturbance == parts.disturbance
            && own.reaction_force == parts.reaction_force
            && own.moves.same(&parts.moves);
        if !alike {
            return Err(Reason::Restart);
        }
        let Activity::Running(Running {
            memory: Some(memory),
            asked: None,
            homing: None,
            ..
        }) = &self.activity
        else {
            return Err(Reason::Moving);
        };
        if !memory.moves.rests() || !memory.standstill.ended() {
            return Err(Reason::Moving);
        }
        let [before, after] = [own, parts].map(|p| p.regulator.step(&memory.difference).0);
        let limit = own.limiter.limit().min(parts.limiter.limit());
        let command = self.telemetry.command;
        // A value that is no number is no small one.
        let small = (after - before).abs() <= LEAP * limit && command.abs() <= limit;
        if small { Ok(()) } else { Err(Reason::Leap) }
    }
}
