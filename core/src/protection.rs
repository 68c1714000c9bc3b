//! Protection: what is watched in every period in which current may flow.
//!
//! A file per watch, each with one job: it sees a period and says whether its fault is there, with the
//! value that tripped it. A new one is a file, a line in one of the two functions here and a row in
//! [`fault`](crate::fault). What merely has to stay within a limit is in `within`.
//!
//! ```text
//! any mode                thermal (the heat of the motor)
//! any mode with current   applied_current, encoder_jump
//! running                 encoder_step, within, tracking, stall, saturation, travel, thermal
//! ```

mod applied_current;
mod encoder_jump;
mod encoder_step;
mod model_error;
mod saturation;
mod stall;
mod thermal;
mod tracking;
mod travel;
mod within;

use crate::actuator::Actuator;
use crate::check::{SettingsError, positive};
use crate::encoder::{Encoder, Reading};
use crate::fault::Fault;
use crate::limits::Limits;
use crate::moves::Reference;
use crate::observer::Estimate;
use crate::units::{Current, Force, Place, Position, Travel, Velocity};
pub use model_error::ModelError;
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;
pub(crate) use thermal::Heat;

/// The limits of a running drive; read rad for m and N m for N on a rotary one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProtectionLimits<const N: usize> {
    /// Largest change of the actuator's motion from one period to the next that the current does not
    /// explain, m per period.
    pub encoder_step: f32,
    /// Fastest the actuator may be, m/s.
    pub velocity: f32,
    /// Farthest it may be from its reference, m.
    pub following_error: f32,
    /// Largest reaction force, N.
    pub reaction_force: f32,
    /// Largest disturbance on the actuator that the observer may find at rest, N.
    pub disturbance: f32,
    /// Largest innovation of the state observer at rest: force that the model does not expect, N.
    pub innovation: f32,
    /// Farthest the actuator may be from its plan at rest, m.
    pub tracking_error: f32,
    /// By how much these three may go further in a move.
    pub model_error: ModelError,
    /// Farthest each spring may be stretched or compressed, from the actuator outwards, m.
    #[serde(with = "BigArray")]
    pub deflection: [f32; N],
    /// Largest force by which friction can hold the actuator still, N.
    pub stiction: f32,
    /// How long the current may be at its limit, s.
    pub saturation_time: f32,
    /// Current that the motor can carry for ever, A, and the time in which it heats up, s.
    pub continuous_current: f32,
    /// See `continuous_current`.
    pub thermal_time: f32,
    /// Where the actuator may be once the position has been set; anywhere when absent.
    pub travel: Option<Travel>,
}

impl<const N: usize> ProtectionLimits<N> {
    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        positive("protection.encoder_step", self.encoder_step)?;
        positive("protection.velocity", self.velocity)?;
        positive("protection.following_error", self.following_error)?;
        positive("protection.reaction_force", self.reaction_force)?;
        positive("protection.disturbance", self.disturbance)?;
        positive("protection.innovation", self.innovation)?;
        positive("protection.tracking_error", self.tracking_error)?;
        self.model_error.check()?;
        for deflection in self.deflection {
            positive("protection.deflection", deflection)?;
        }
        positive("protection.stiction", self.stiction)?;
        positive("protection.saturation_time", self.saturation_time)?;
        positive("protection.continuous_current", self.continuous_current)?;
        positive("protection.thermal_time", self.thermal_time)?;
        match self.travel {
            Some(travel) if travel.lowest >= travel.highest => Err(SettingsError::Travel),
            _ => Ok(()),
        }
    }
}

/// A fault, and the value that tripped it in the unit of its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Trip {
    pub(crate) fault: Fault,
    pub(crate) value: f32,
}

/// A fault without a value of its own.
impl From<Fault> for Trip {
    fn from(fault: Fault) -> Self {
        Self { fault, value: 0.0 }
    }
}

/// The fault, unless a magnitude is within its limit; what is no number is within none.
fn beyond(fault: Fault, value: f32, limit: f32) -> Result<(), Trip> {
    if value.abs() <= limit {
        Ok(())
    } else {
        Err(trip(fault, value))
    }
}

/// Out of the way, so that a period in which nothing trips goes straight on.
#[cold]
#[inline(never)]
fn trip(fault: Fault, value: f32) -> Trip {
    Trip { fault, value }
}

/// What a running period is judged by.
pub(crate) struct Period<'a, const N: usize> {
    pub(crate) reading: &'a Reading,
    /// Position relative to the target.
    pub(crate) position: Position,
    /// The same from zero.
    pub(crate) from_zero: Position,
    /// Applied over the period that ends now.
    pub(crate) current: Current,
    pub(crate) heat: Heat,
    pub(crate) reaction_force: Force,
    pub(crate) estimate: &'a Estimate<N>,
    pub(crate) reference: &'a Reference<N>,
    /// Where there may be a stop: the approach's velocity and largest current.
    pub(crate) to_stop: Option<(Velocity, Current)>,
}

impl<const N: usize> Period<'_, N> {
    /// How far the actuator is from its reference.
    fn error(&self) -> Position {
        Position(self.position.0 - self.reference.position.0)
    }
}

/// All watches.
#[derive(Clone, Debug)]
pub(crate) struct Protection<const N: usize> {
    limits: ProtectionLimits<N>,
    applied_current: applied_current::AppliedCurrent,
    encoder_step: encoder_step::EncoderStep,
    stall: stall::Stall,
    saturation: saturation::Saturation,
    thermal: thermal::Thermal,
    tracking: tracking::Tracking,
    /// What the motor carries, N, and the current that it needs for it, A.
    holding_force: f32,
    holding_current: f32,
    force_constant: f32,
    /// Force that stops the actuator within a period, over its velocity: `m_a / T`, N s/m.
    stopping: f32,
    sample_time: f32,
}

/// What the watches of a running drive remember.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory {
    encoder_step: encoder_step::Memory,
    stall: stall::Memory,
    saturated: u32,
    tracking: tracking::Memory,
    /// Force of the plans, N.
    planned: f32,
    /// Where the actuator may be.
    travel: Option<Travel>,
}

impl<const N: usize> Protection<N> {
    /// * `total_mass`: of actuator and loads, kg
    /// * `holding_force`: what the motor carries, N
    /// * `disturbance_cutoff`: 1/s
    /// * `sample_time`: s
    pub(crate) fn new(
        protection: &ProtectionLimits<N>,
        (actuator, encoder, limits): (&Actuator, &Encoder, &Limits),
        (total_mass, holding_force): (f32, f32),
        (disturbance_cutoff, sample_time): (f32, f32),
    ) -> Self {
        // Of a motion by one count in one period, as the disturbance observer sees it.
        let of_a_count =
            actuator.actual_mass() * disturbance_cutoff * encoder.resolution / sample_time;
        Self {
            limits: protection.clone(),
            applied_current: applied_current::AppliedCurrent::new(limits),
            encoder_step: encoder_step::EncoderStep::new(
                actuator,
                protection.encoder_step,
                sample_time,
            ),
            stall: stall::Stall::new(
                actuator.actual_force_constant(),
                encoder.resolution,
                (protection.stiction, of_a_count),
                limits.current_limit,
                total_mass,
                sample_time,
            ),
            saturation: saturation::Saturation::new(
                limits,
                protection.saturation_time,
                sample_time,
            ),
            thermal: thermal::Thermal::new(
                protection.continuous_current,
                protection.thermal_time,
                sample_time,
            ),
            tracking: tracking::Tracking::new(
                protection.tracking_error,
                protection.model_error.periods(),
            ),
            holding_force,
            holding_current: holding_force / actuator.actual_force_constant(),
            force_constant: actuator.actual_force_constant(),
            stopping: actuator.actual_mass() / sample_time,
            sample_time,
        }
    }

    /// What a running drive begins with.
    ///
    /// * `stiction`: by which friction has been seen to hold the actuator, N
    /// * `place`: where it stands, if zero is known
    pub(crate) fn begin(&self, stiction: Option<f32>, place: Option<Place>) -> Memory {
        let travel = self.limits.travel.zip(place);
        Memory {
            stall: self.stall.begin(stiction, self.holding_force),
            travel: travel.map(|(travel, place)| travel.from(place)),
            ..Memory::default()
        }
    }

    /// How warm the motor is, as a share of what it can take.
    pub(crate) fn warmth(&self, heat: Heat) -> f32 {
        self.thermal.warmth(heat)
    }

    /// What of the memory hangs on limits is as these have it: the machine is held, and they are others than before.
    ///
    /// * `stiction`, `place`: as for [`begin`](Self::begin)
    pub(crate) fn renew(&self, memory: &mut Memory, stiction: Option<f32>, place: Option<Place>) {
        let Memory { stall, travel, .. } = self.begin(stiction, place);
        memory.stall.renew(&stall);
        memory.travel = travel;
    }

    /// The actuator is not to follow its plan from now on: a raw step, or a brake.
    pub(crate) fn leaves_plan(&self, memory: &mut Memory) {
        self.tracking.leaves(&mut memory.tracking);
    }

    /// What is looked for may lie outside of the travel.
    pub(crate) fn leaves_travel(memory: &mut Memory) {
        memory.travel = None;
    }

    /// The travel counts from now on.
    ///
    /// * `place`: where the actuator stands
    pub(crate) fn keeps_travel(&self, memory: &mut Memory, place: Place) {
        memory.travel = self.limits.travel.map(|travel| travel.from(place));
    }

    /// Whether one part of four is as in a copy.
    pub(crate) fn same(&self, copy: &Self, part: usize) -> bool {
        match part % 4 {
            0 => self.limits == copy.limits,
            1 => {
                (self.applied_current, self.encoder_step)
                    == (copy.applied_current, copy.encoder_step)
            }
            2 => (self.stall, self.saturation) == (copy.stall, copy.saturation),
            _ => {
                (self.thermal, self.tracking) == (copy.thermal, copy.tracking)
                    && (
                        self.holding_force,
                        self.holding_current,
                        self.force_constant,
                    ) == (
                        copy.holding_force,
                        copy.holding_current,
                        copy.force_constant,
                    )
                    && (self.stopping, self.sample_time) == (copy.stopping, copy.sample_time)
            }
        }
    }

    /// The travel that the settings allow.
    pub(crate) const fn travel(&self) -> Option<&Travel> {
        self.limits.travel.as_ref()
    }

    /// Largest change of the actuator's motion that the current does not explain, m per period.
    pub(crate) const fn encoder_step(&self) -> f32 {
        self.limits.encoder_step
    }

    /// One period of any mode: how hot the motor is. What cannot have been applied has not heated it.
    ///
    /// * `current`: said to have been applied over the period that ends now
    pub(crate) fn warm(&self, heat: &mut Heat, current: Current) {
        if self.applied_current.step(current).is_ok() {
            self.thermal.step(heat, current);
        }
    }

    /// One period of any mode in which current may flow.
    ///
    /// * `current`: said to have been applied over the period that ends now
    pub(crate) fn step(&self, reading: &Reading, current: Current) -> Result<(), Trip> {
        encoder_jump::step(reading)?;
        self.applied_current.step(current)
    }

    /// One period of a running drive.
    pub(crate) fn running(&self, memory: &mut Memory, period: &Period<'_, N>) -> Result<(), Trip> {
        let Period {
            reading, current, ..
        } = period;
        let moving = Current(current.0 - self.holding_current);
        let more = period
            .to_stop
            .map_or(0.0, |(_, current)| self.encoder_step.at_stop(current));
        self.encoder_step
            .step(&mut memory.encoder_step, reading, moving, more)?;
        let planned = self.force_constant * period.reference.feed_forward.0;
        let planned = self.limits.model_error.step(&mut memory.planned, planned);
        let stop = period.to_stop.map(|(Velocity(velocity), current)| {
            let force = self.force_constant * current.0 + self.stopping * velocity.abs();
            let fastest = velocity.abs() + self.limits.encoder_step / self.sample_time;
            (2.0 * force, fastest)
        });
        within::step(&self.limits, self.holding_force, (planned, stop), period)?;
        let more = self.limits.model_error.tracking_error * planned;
        self.tracking
            .step(&mut memory.tracking, period.error(), more)?;
        let unexplained = period.estimate.disturbance.0 + period.estimate.innovation.0;
        let forces = [self.stall.motor(*current), unexplained];
        if stop.is_some() {
            self.leaves_plan(memory);
        } else {
            stall::Stall::step(&mut memory.stall, reading, forces)?;
        }
        self.saturation.step(&mut memory.saturated, *current)?;
        travel::step(memory.travel, reading.place, period.from_zero)?;
        self.thermal.judge(period.heat)
    }
}
