//! Homing: the drive finds its zero itself.
//!
//! ```text
//! approach   it jogs until the place is found
//!   stop       with a limited current, until the actuator has stood still against it (50 ms, see `rest`)
//!   input      until the home switch has been active for three periods; the first of them is the place
//! settle     by stop: it stands there, from rest as after a start, until the loads do
//! back       it moves back from there by a plan, with all that the motor has, and settles; from a stop by one that
//!            never turns round, for most plans of short ways do
//! done       the places get new names, in one period: that of the place found is the one that was asked for
//! ```
//!
//! Whatever ends it before that leaves zero as it was. To the end the travel is not kept: what is to be found is at
//! its end, or beyond it. A stop and an encoder that has died look the same while the actuator is pushed; the way
//! back tells them apart, and zero is set after it.
//!
//! **A stop takes** the motor's force and what it takes to stop the actuator within a period. That much more
//! is no fault in an approach to one:
//!
//! ```text
//! |d|, |innovation| ≤ limit + 2 (k_f I + m_a |v| / T)        |v_a| ≤ |v| + encoder_step / T
//! |s_k − s_k−1| ≤ encoder_step + 2 T² k_f I / m_a            (see `protection::encoder_step`)
//! ```
//!
//! Stall, tracking and travel are not watched until it moves back; all other watches stay. So that the encoder's motion
//! is watched too, an approach to a stop is slower than half of `encoder_step / T`.

use crate::encoder::Reading;
use crate::fault::Fault;
use crate::protection::Trip;
use crate::request::{At, Homing};
use crate::rest::{self, Rest};
use crate::units::{Current, Place, Position, Velocity};

/// Share of the current with which the actuator is pushed against a stop.
pub(crate) const PUSHED: f32 = 0.9;
/// Control periods in a row for which the home switch must be active: one alone may be a disturbance of its line.
const ACTIVE: u8 = 3;

/// Homing under way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Memory {
    homing: Homing,
    phase: Phase,
    /// Current that the command is limited to, until the machine moves back from a stop.
    limit: Option<Current>,
    /// Periods of the approach and of settling at a stop, and the most that they may be.
    periods: u32,
    longest: u32,
    /// Where the home switch became active, and for how many periods it has been.
    edge: Option<(Place, u8)>,
    /// Of a count, by which the reference is still to be set back, m.
    owed: f32,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Approach(rest::Memory),
    /// At the stop found, until nothing swings.
    Settle(Place),
    /// From the place found.
    Back(Place),
    /// To rest, without a place.
    End,
}

impl Memory {
    /// * `longest`: periods that the approach may take
    pub(crate) fn new(homing: Homing, longest: u32) -> Self {
        Self {
            homing,
            phase: Phase::Approach(rest::Memory::default()),
            limit: match homing.at {
                At::Stop { current } => Some(current),
                At::Input => None,
            },
            periods: 0,
            longest,
            edge: None,
            owed: 0.0,
        }
    }

    /// Where it is to rest, from the place found.
    pub(crate) fn rests_at(&self, found: Place) -> Place {
        self.homing.rests_at(found)
    }

    /// What the command is limited to.
    pub(crate) fn limit(&self) -> Option<Current> {
        self.limit
    }

    /// It is to end where the machine comes to rest.
    pub(crate) fn end(&mut self) {
        self.phase = Phase::End;
    }

    /// Whether nothing is sought any more.
    pub(crate) fn ends(&self) -> bool {
        matches!(self.phase, Phase::End)
    }

    /// The place found, and what it is to be called.
    pub(crate) fn found(&self) -> Option<(Place, Place)> {
        match self.phase {
            Phase::Back(found) => Some((found, self.homing.position)),
            _ => None,
        }
    }

    /// Velocity and largest current of an approach to a stop, until the machine moves back from it.
    pub(crate) fn seeks_stop(&self) -> Option<(Velocity, Current)> {
        Some((self.homing.velocity, self.limit?))
    }

    /// Whether the reference is not to begin anew where a limited command leaves the machine: it pushes against a stop,
    /// or what may be one, or is given up. The reference waits there, and the actuator is pushed no harder and no less.
    pub(crate) fn pushes(&self, command: Current) -> bool {
        self.limit.is_some() && self.towards(command) > 0.0 || self.ends()
    }

    /// A current, positive where it pushes along the approach, A.
    fn towards(&self, current: Current) -> f32 {
        if self.homing.velocity.0 > 0.0 {
            current.0
        } else {
            -current.0
        }
    }

    /// One period: whether the place is still to be waited for.
    pub(crate) fn wait(&mut self, sample_time: f32) -> Result<(), Trip> {
        if let Phase::Approach(_) | Phase::Settle(_) = self.phase {
            self.periods = self.periods.saturating_add(1);
        }
        if self.periods <= self.longest {
            return Ok(());
        }
        Err(Trip {
            fault: Fault::Homing,
            value: self.periods as f32 * sample_time,
        })
    }

    /// Where the machine is to rest, from the stop at which it has settled; the motor has all its current again.
    pub(crate) fn settled(&mut self) -> Option<Place> {
        let Phase::Settle(found) = self.phase else {
            return None;
        };
        self.phase = Phase::Back(found);
        self.limit = None;
        Some(self.homing.rests_at(found))
    }

    /// By how much the reference is to be set back, so that it does not go on where the command is cut: whole counts, the
    /// rest later.
    ///
    /// * `displacement`: by which it went on, m
    pub(crate) fn owes(&mut self, displacement: f32, resolution: f32, cut: bool) -> Position {
        if cut {
            self.owed -= displacement;
        }
        let whole = libm::roundf(self.owed / resolution) * resolution;
        self.owed -= whole;
        Position(whole)
    }

    /// One period of the approach: the place, once it is found.
    ///
    /// * `active`: whether the home switch is
    pub(crate) fn seek(
        &mut self,
        rest: &Rest,
        reading: &Reading,
        active: bool,
        command: Current,
    ) -> Option<(At, Place)> {
        let towards = self.towards(command);
        let Phase::Approach(memory) = &mut self.phase else {
            return None;
        };
        let found = match self.homing.at {
            At::Input => {
                let (edge, periods) = self.edge.unwrap_or((reading.place, 0));
                self.edge = active.then_some((edge, periods + 1));
                if !active || periods + 1 < ACTIVE {
                    return None;
                }
                self.phase = Phase::Back(edge);
                edge
            }
            At::Stop { current } => {
                if towards < PUSHED * current.0 {
                    *memory = memory.moved_to(reading.place);
                }
                if !rest.step(memory, reading) {
                    return None;
                }
                self.phase = Phase::Settle(reading.place);
                reading.place
            }
        };
        Some((self.homing.at, found))
    }
}
