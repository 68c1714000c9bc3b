//! The controller's part of [`homing`](crate::homing).

use super::Parts;
use super::activity::{Loop, Running};
use crate::encoder::{self, Reading};
use crate::fault::Fault;
use crate::homing::{Memory, PUSHED};
use crate::observer::StateObserver;
use crate::protection::Protection;
use crate::request::{At, Homing, Reason, Request};
use crate::telemetry::Telemetry;
use crate::units::{Current, Place, Position};

/// Longest approach where there is no travel, s, and where there is one, as a part of its length.
const LONGEST: f32 = 60.0;
const FARTHEST: f32 = 1.5;

impl<const N: usize, O: StateObserver<N>> Parts<'_, N, O> {
    /// Refuses what cannot be done.
    ///
    /// * `active`: whether the home switch is
    /// * `stiction`: by which friction has been seen to hold the actuator, N
    /// * `held`: the current that holds the machine now
    pub(super) fn may_home(
        &self,
        homing: &Homing,
        active: bool,
        (stiction, held): (Option<f32>, Current),
    ) -> Result<(), Reason> {
        let velocity = homing.velocity.0.abs();
        if !self.moves.cruises(velocity) {
            return Err(Reason::Velocity);
        }
        match homing.at {
            At::Input if active => return Err(Reason::HomeSwitch),
            At::Input => {}
            At::Stop { current } => {
                let seen = 2.0 * velocity * self.sample_time <= self.protection.encoder_step();
                if !seen || !self.rest.tells(velocity) {
                    return Err(Reason::Velocity);
                }
                let friction = self.friction.coulomb.max(stiction.unwrap_or(0.0))
                    + self.friction.viscous * velocity;
                let taken = (friction + self.holding_force.0.abs()) * self.current_per_force;
                let taken = taken.max(held.0.abs());
                // Written so that what is no number is none of them.
                if !(PUSHED * current.0 > taken && current.0 < self.limiter.limit()) {
                    return Err(Reason::Current);
                }
                let back_off = homing.back_off as f32 * self.encoder.resolution;
                if back_off <= self.standstill.tolerance {
                    return Err(Reason::BackOff);
                }
            }
        }
        let rests_at = homing.rests_at(homing.position);
        if self
            .protection
            .travel()
            .is_some_and(|travel| !travel.contains(rests_at))
        {
            return Err(Reason::Travel);
        }
        if self.moves.lead(homing.position, rests_at) {
            Ok(())
        } else {
            Err(Reason::Unreachable)
        }
    }

    /// The approach begins where the machine rests. Out of the way of the usual period, as what follows.
    #[cold]
    #[inline(never)]
    pub(super) fn begin_homing(
        &self,
        memory: &mut Loop<N, O::Memory>,
        homing: Homing,
        asked: &mut Option<Request>,
    ) -> Memory {
        Protection::<N>::leaves_travel(&mut memory.protection);
        *asked = Some(Request::Jog(homing.velocity));
        let settling = 2 * self.standstill.settling;
        let longest = self.protection.travel().map_or(LONGEST, |travel| {
            let length = self.encoder.distance(travel.lowest, travel.highest);
            FARTHEST * length.0 / homing.velocity.0.abs()
        });
        // The cast saturates.
        let longest = (longest / self.sample_time) as u32;
        Memory::new(homing, longest.saturating_add(settling))
    }

    /// Where the actuator is by its new name, into the record; the target by its own.
    #[cold]
    #[inline(never)]
    pub(super) fn renamed(
        &self,
        running: &Running<N, O>,
        place: Place,
        telemetry: &mut Telemetry<[f32; N]>,
    ) -> Position {
        telemetry.position = self.encoder.position(place).0;
        telemetry.position_set = true;
        self.encoder.position(running.target(place))
    }

    /// The end of a period of a drive that homes.
    ///
    /// * `active`: whether the home switch is
    /// * `rests`: whether the reference does
    ///
    /// Whether the places have new names from now on.
    #[cold]
    #[inline(never)]
    pub(super) fn home(
        &self,
        running: &mut Running<N, O>,
        encoder: &mut encoder::Memory,
        (reading, active): (&Reading, bool),
        rests: bool,
        command: Current,
    ) -> Result<bool, Fault> {
        let (Some(homing), Some(memory)) = (&mut running.homing, &mut running.memory) else {
            return Ok(false);
        };
        let to_stop = homing.limit().is_some();
        match homing.seek(&self.rest, reading, active, command) {
            None => {}
            Some((At::Input, edge)) => {
                running.asked = Some(Request::Move(homing.rests_at(edge)));
                return Ok(false);
            }
            Some((At::Stop { .. }, _)) => {
                // What has pushed the actuator is void: from rest, as after a start.
                running.memory = None;
                return Ok(false);
            }
        }
        if running.asked.is_some() || !rests {
            return Ok(false);
        }
        let holds = memory.standstill.holds();
        if let Some(rests_at) = holds.then(|| homing.settled()).flatten() {
            let begun = self
                .moves
                .retreat(&mut memory.moves, memory.target, rests_at);
            memory.target = begun.map_err(|_| Fault::Target)?;
            return Ok(false);
        }
        match homing.found() {
            Some((found, name)) if holds => {
                let rename = |place: Place| {
                    let counts = place.counts_from(found);
                    Place(name.0.wrapping_add(counts))
                };
                memory.target = rename(memory.target);
                let place = rename(reading.place);
                encoder.set(place);
                self.protection.keeps_travel(&mut memory.protection, place);
                running.homing = None;
                return Ok(true);
            }
            None if homing.ends() && memory.standstill.ended() => {
                if encoder.is_set() {
                    self.protection
                        .keeps_travel(&mut memory.protection, reading.place);
                }
                if to_stop {
                    // Something may hold it: as where a stop has been found.
                    running.memory = None;
                }
                running.homing = None;
            }
            _ => {}
        }
        Ok(false)
    }
}
