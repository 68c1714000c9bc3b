//! The corridor: one control period from encoder count to current command.
//!
//! [`Controller`] owns the coefficients of every part and what the present mode remembers; the
//! firmware's interrupt and the simulation both call [`Controller::step`] once per period and nothing
//! else between two periods but [`Controller::request`].
//!
//! Every position in the loop is relative to the target, a whole count: the drive is as exact a million turns
//! from zero as at zero. The command is `i = i_ff − K (x_hat − x_ref) + (f_fric + d) / k_f`, limited; a value that is not finite
//! anywhere ends in a fault and zero current.

mod activity;
mod change;
mod homing;

pub use change::Change;

use crate::check::SettingsError;
use crate::direction_check::{Action, DirectionCheck, PATIENCE};
use crate::disturbance::DisturbanceObserver;
use crate::encoder::{self, Encoder, Reading};
use crate::excitation::Excitation;
use crate::fault::{Fault, Reaction};
use crate::friction::FrictionFeedForward;
use crate::homing::Memory as Homing;
use crate::limits::Limiter;
use crate::mode::Mode;
use crate::moves::plans::Plans;
use crate::moves::{self, Moves, Reference};
use crate::observer::{Estimate, Seen, StateObserver};
use crate::protection::{Heat, Period, Protection, Trip};
use crate::reaction_force::ReactionForceObserver;
use crate::record::Course;
use crate::regulator::Regulator;
use crate::request::{Reason, Refusal, Request};
use crate::rest::Rest;
use crate::settings::Settings;
use crate::standstill::{self, Standstill};
use crate::telemetry::Telemetry;
use crate::units::{Counts, Current, Force, Place, Position, Velocity};
use activity::{
    Activity, Commissioning, ExcitationStart, Exciting, Expected, Fed, Loop, Running, Start,
    Stopping,
};

/// How warm the motor may be for its heat to be forgotten, as a share of what it can take.
const COOL: f32 = 0.1;

/// What the drive measures once per period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Encoder counter.
    pub count: Counts,
    /// Current that was applied over the period that ends now, as the output really made it.
    pub current: Current,
    /// Whether the home switch is active now.
    pub home: bool,
}

/// What the drive has to do over the next period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Current to apply, within the limit and a whole number of the output's steps.
    pub current: Current,
    /// Whether the amplifier is to be enabled.
    pub enable: bool,
    /// Whether the current limit acted.
    pub limited: bool,
}

/// What a drive does with its machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doing {
    /// For who records its moves.
    pub course: Course,
    /// Whether it moves at a velocity, or is about to, until something else is asked: who asked is to be watched.
    pub jogs: bool,
    /// Whether it looks for zero, or is about to: who asked is to be watched.
    pub homes: bool,
}

/// The control corridor of a drive with `N` load masses and the state observer `O`.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Controller<'p, const N: usize, O: StateObserver<N>> {
    parts: Parts<'p, N, O>,
    /// What can be played.
    excitation: Option<Excitation>,
    encoder: encoder::Memory,
    activity: Activity<N, O>,
    /// By which friction held the actuator when the signs were proven, N.
    stiction: Option<f32>,
    /// Of the motor, whatever the mode.
    heat: Heat,
    /// Whether the home switch was active in the last period.
    home: bool,
    telemetry: Telemetry<[f32; N]>,
    /// The parts once more: what a disturbed memory changes shows as a difference. Last, because what is used
    /// in each period lies where one instruction reaches it.
    copy: Parts<'p, N, O>,
}

/// The coefficients of every part.
#[derive(Clone, Debug)]
struct Parts<'p, const N: usize, O> {
    encoder: Encoder,
    protection: Protection<N>,
    disturbance: DisturbanceObserver,
    reaction_force: ReactionForceObserver,
    observer: O,
    moves: Moves<'p>,
    friction: FrictionFeedForward,
    standstill: Standstill<N>,
    regulator: Regulator<N>,
    limiter: Limiter,
    direction_check: DirectionCheck,
    rest: Rest,
    sample_time: f32,
    /// Of the control periods, `1 / T`, 1/s.
    frequency: f32,
    /// `1 / k_f`, A/N.
    current_per_force: f32,
    /// By which the machine is carried.
    holding_force: Force,
    /// Mass and force constant of the actuator, kg and N/A.
    actuator: (f32, f32),
}

impl<'p, const N: usize, O: StateObserver<N> + Clone> Controller<'p, N, O> {
    /// An idle controller.
    ///
    /// # Errors
    /// When the settings cannot be run, see [`Settings::check`], or the plans cannot be played.
    pub fn new(settings: &Settings<N, O>, plans: Plans<'p>) -> Result<Self, SettingsError> {
        let parts = Parts::new(settings, plans)?;
        Ok(Self {
            copy: parts.clone(),
            parts,
            excitation: None,
            encoder: encoder::Memory::default(),
            activity: Activity::Idle,
            stiction: None,
            heat: 0.0,
            home: false,
            telemetry: Telemetry::default(),
        })
    }

    /// Gives the drive something to play.
    #[must_use]
    pub fn with_excitation(mut self, excitation: Excitation) -> Self {
        self.excitation = Some(excitation);
        self
    }

    /// Asks something of the drive. What is taken takes effect with the next period.
    ///
    /// # Errors
    /// The refusal, which names what the drive is doing; nothing has changed then.
    pub fn request(&mut self, request: Request) -> Result<(), Refusal> {
        let mode = self.mode();
        let next = mode.next(request)?;
        let refused = |reason| {
            Err(Refusal {
                request,
                mode,
                reason,
            })
        };
        let request = self.absolute(request);
        match (request, self.excitation, &mut self.activity) {
            (Request::Excite, None, _) => return refused(Reason::NoExcitation),
            (Request::Excite, Some(excitation), activity) => {
                *activity = Activity::Exciting(Exciting::new(excitation));
            }
            (
                Request::Step(_) | Request::Move(_) | Request::Jog(_) | Request::Home(_),
                _,
                Activity::Running(Running {
                    homing: Some(_), ..
                }),
            ) => return refused(Reason::Homing),
            (Request::Home(homing), _, Activity::Running(running)) => {
                let stands = running.asked.is_none()
                    && running
                        .memory
                        .as_ref()
                        .is_some_and(|memory| memory.moves.rests() && memory.standstill.ended());
                if !stands {
                    return refused(Reason::Moving);
                }
                let held = Current(self.telemetry.command);
                let parts = &self.parts;
                let allowed = parts.may_home(&homing, self.home, (self.stiction, held));
                if let Err(reason) = allowed {
                    return refused(reason);
                }
                running.asked = Some(request);
            }
            (Request::Jog(Velocity(velocity)), ..) if !velocity.is_finite() => {
                return refused(Reason::Unreachable);
            }
            (Request::Jog(_) | Request::Halt, _, Activity::Running(running)) => {
                if let Some(homing) = &mut running.homing {
                    homing.end();
                }
                running.asked = Some(request);
            }
            (Request::Step(target) | Request::Move(target), _, Activity::Running(running)) => {
                let travel = self.parts.protection.travel();
                if self.encoder.is_set() && travel.is_some_and(|travel| !travel.contains(target)) {
                    return refused(Reason::Travel);
                }
                let from = running.target(self.encoder.place());
                if !self.parts.moves.lead(from, target) {
                    return refused(Reason::Unreachable);
                }
                running.asked = Some(request);
            }
            (Request::SetPosition(place), ..) => self.encoder.set(place),
            (Request::Change, ..) => return refused(Reason::NoSettings),
            (Request::Store, ..) if self.parts.protection.warmth(self.heat) > COOL => {
                return refused(Reason::Warm);
            }
            (_, _, activity) => activity.enter(next, self.encoder.place()),
        }
        self.telemetry.fault_value = 0.0;
        Ok(())
    }

    /// A move from the target on, as one to a place.
    fn absolute(&self, request: Request) -> Request {
        let (Request::MoveBy(counts), Activity::Running(running)) = (request, &self.activity)
        else {
            return request;
        };
        let target = match running.asked {
            Some(Request::Move(place) | Request::Step(place)) => place,
            _ => running.target(self.encoder.place()),
        };
        Request::Move(Place(target.0.saturating_add(counts)))
    }

    /// Stops the drive with a fault that was found outside of it; the first fault stays.
    pub fn trip(&mut self, fault: Fault) {
        if !matches!(self.mode(), Mode::Fault(_)) {
            self.activity.trip(fault);
        }
    }

    /// What the drive is doing.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.activity.mode()
    }

    /// What it does with the machine from the last period on.
    #[must_use]
    pub fn doing(&self) -> Doing {
        let free = Doing {
            course: Course::Free,
            jogs: false,
            homes: false,
        };
        let running = match &self.activity {
            Activity::Running(running) => running,
            Activity::Exciting(Exciting {
                start: ExcitationStart::At(_),
                ..
            }) => {
                let course = Course::Moved;
                return Doing { course, ..free };
            }
            _ => return free,
        };
        let (asked, homing) = (running.asked.as_ref(), running.homing.is_some());
        let course = match &running.memory {
            // What waits for rest goes on.
            Some(memory) if asked.is_none() && !homing && memory.moves.rests() => {
                Course::Held(memory.target)
            }
            Some(_) => Course::Moved,
            None => Course::Free,
        };
        if running.stopping.is_some() {
            return Doing { course, ..free };
        }
        let memory = running.memory.as_ref();
        let under_way = memory.is_some_and(|memory| memory.moves.jogs());
        Doing {
            course,
            jogs: !homing && (under_way || matches!(asked, Some(Request::Jog(_)))),
            homes: homing || matches!(asked, Some(Request::Home(_))),
        }
    }

    /// Record of the last period.
    #[must_use]
    pub fn telemetry(&self) -> &Telemetry<[f32; N]> {
        &self.telemetry
    }

    /// One control period: the whole corridor.
    ///
    /// The same path is taken in every running period; its cost does not depend on the values, but on
    /// how many plans are under way, six at most, and on whether anything is asked: a period in which a
    /// plan is chosen costs a search in their table more. In each, a part of the settings is held against
    /// its copy, all of them within 64 periods. A drive that excites does less. Idle and faulted drives get
    /// zero current and a disabled amplifier.
    pub fn step(&mut self, measurement: Measurement) -> Command {
        let parts = &self.parts;
        let reading = parts.encoder.step(&mut self.encoder, measurement.count);
        let telemetry = &mut self.telemetry;
        telemetry.period = telemetry.period.wrapping_add(1);
        telemetry.count = measurement.count.0;
        telemetry.position = parts.encoder.position(reading.place).0;
        telemetry.position_set = self.encoder.is_set();
        self.home = measurement.home;

        if !parts.same(&self.copy, telemetry.period) {
            self.activity.trip(Fault::Settings);
        }
        let mode = self.activity.mode();
        // The record of a fault still has what was estimated before it.
        let estimated = telemetry.mode.closed_loop() || matches!(telemetry.mode, Mode::Fault(_));
        if estimated && !mode.closed_loop() {
            telemetry.forget_estimates();
        }

        parts.protection.warm(&mut self.heat, measurement.current);
        let watched = if mode.energised() {
            parts.protection.step(&reading, measurement.current)
        } else {
            Ok(())
        };
        let result = watched.and_then(|()| match &mut self.activity {
            Activity::Running(running) => parts.run(
                running,
                &mut self.encoder,
                (&measurement, &reading),
                telemetry,
                (self.stiction, self.heat),
            ),
            Activity::Commissioning(memory) => {
                parts.commission(memory, &reading, &mut self.stiction)
            }
            Activity::Exciting(memory) => parts.excite(memory, &reading),
            Activity::Ready(rest) => {
                parts.rest.may_start(rest, &reading);
                Ok(Some(Command::default()))
            }
            Activity::Idle | Activity::Fault(_) | Activity::Storing => Ok(Some(Command::default())),
        });
        let command = match result {
            Ok(Some(command)) => command,
            Ok(None) => {
                self.activity.enter(mode.completed(), reading.place);
                Command::default()
            }
            Err(trip) => {
                telemetry.fault_value = trip.value;
                self.activity.trip(trip.fault);
                Command::default()
            }
        };

        telemetry.mode = self.activity.mode();
        telemetry.command = command.current.0;
        telemetry.limited = command.limited;
        if measurement.current.0.is_finite() {
            telemetry.applied_current = measurement.current.0;
        }
        command
    }
}

/// What a mode says for one period: a command, or nothing when it has done what it is there for.
type Outcome = Result<Option<Command>, Trip>;

impl<'p, const N: usize, O: StateObserver<N> + Clone> Parts<'p, N, O> {
    /// # Errors
    /// As [`Controller::new`].
    fn new(settings: &Settings<N, O>, plans: Plans<'p>) -> Result<Self, SettingsError> {
        settings.check()?;
        plans.check(N)?;
        let Settings {
            sample_time,
            encoder,
            actuator,
            disturbance_cutoff,
            reaction_force_cutoff,
            observer,
            regulator,
            limits,
            total_mass,
            friction,
            standstill,
            holding_force,
            protection,
            // The board's affair.
            amplifier: _,
        } = settings;
        let force_constant = actuator.actual_force_constant();
        let (g_dist, g_reac, period) = (*disturbance_cutoff, *reaction_force_cutoff, *sample_time);
        let rest = Rest::new(encoder, actuator, limits, period);
        Ok(Self {
            encoder: *encoder,
            protection: Protection::new(
                protection,
                (actuator, encoder, limits),
                (*total_mass, *holding_force),
                (g_dist, period),
            ),
            disturbance: DisturbanceObserver::new(actuator, g_dist, period),
            reaction_force: ReactionForceObserver::new(actuator, g_dist, g_reac, period),
            observer: observer.clone(),
            moves: Moves::new(plans, period, encoder.resolution),
            friction: *friction,
            standstill: *standstill,
            regulator: *regulator,
            limiter: limits.limiter(),
            direction_check: DirectionCheck::new(limits, actuator, rest, period),
            rest,
            sample_time: period,
            frequency: 1.0 / period,
            current_per_force: 1.0 / force_constant,
            holding_force: Force(*holding_force),
            actuator: (actuator.actual_mass(), force_constant),
        })
    }
}

impl<const N: usize, O: StateObserver<N>> Parts<'_, N, O> {
    /// Whether a part of this is as in its copy, another part in each period: a few words, so that the cost
    /// of a period hardly grows. All have been compared after 64 periods: 8
    /// parts, one of which has 4, in every other period; the observer's states are fewer.
    fn same(&self, copy: &Self, period: u32) -> bool {
        let (part, observer) = ((period / 2) as usize, period.is_multiple_of(2));
        if observer {
            return self.observer.same(&copy.observer, part);
        }
        match part % 8 {
            0 => (self.encoder, self.limiter) == (copy.encoder, copy.limiter),
            1 => self.regulator == copy.regulator,
            2 => self.disturbance == copy.disturbance,
            3 => self.reaction_force == copy.reaction_force,
            4 => {
                self.moves.same(&copy.moves)
                    && self.friction == copy.friction
                    && self.standstill == copy.standstill
            }
            5 => self.direction_check == copy.direction_check,
            6 => {
                (self.rest, self.sample_time, self.frequency)
                    == (copy.rest, copy.sample_time, copy.frequency)
                    && (self.current_per_force, self.holding_force, self.actuator)
                        == (copy.current_per_force, copy.holding_force, copy.actuator)
            }
            _ => self.protection.same(&copy.protection, part / 8),
        }
    }

    /// Current by which the machine is carried.
    fn holding_current(&self) -> Current {
        Current(self.holding_force.0 * self.current_per_force)
    }

    /// Coulomb friction: what is declared, or what held the actuator when the signs were proven, where none is.
    fn coulomb(&self, stiction: Option<f32>) -> Force {
        match stiction {
            Some(seen) if self.friction.coulomb == 0.0 => {
                Force(seen.min(self.standstill.learning.most))
            }
            _ => Force(self.friction.coulomb),
        }
    }

    /// What a running drive begins with, where the actuator stands, at rest.
    ///
    /// * `set`: whether zero is known
    fn begin(&self, place: Place, set: bool, stiction: Option<f32>) -> Loop<N, O::Memory> {
        let current = self.holding_current();
        Loop {
            disturbance: self.disturbance.at_rest(current),
            reaction_force: self.reaction_force.at_rest(current),
            observer: self.observer.at_rest(self.holding_force),
            target: place,
            moves: moves::Memory::default(),
            standstill: standstill::Memory::at_rest(self.holding_force, self.coulomb(stiction)),
            fed: Fed::default(),
            difference: Estimate::default(),
            expected: Expected::default(),
            limited: 0,
            protection: self.protection.begin(stiction, set.then_some(place)),
        }
    }

    /// Commissioning: open loop until the signs are proven, closed from then on.
    fn commission(
        &self,
        memory: &mut Commissioning,
        reading: &Reading,
        stiction: &mut Option<f32>,
    ) -> Outcome {
        let check = &self.direction_check;
        match check.step(&mut memory.direction_check, reading)? {
            Action::Wait => Ok(Some(Command::default())),
            Action::Push(current) => self.carried(current),
            Action::Brake(origin) => {
                let velocity = memory.velocity(&self.disturbance, reading);
                let position = self.encoder.distance(origin, reading.place);
                self.carried(self.regulator.brake(position, velocity))
            }
            Action::Done => {
                *stiction = check.stiction(&memory.direction_check);
                Ok(None)
            }
        }
    }

    /// Excitation: from rest, as commissioning; then open loop from the first period to the last, within
    /// the travel allowed.
    fn excite(&self, memory: &mut Exciting, reading: &Reading) -> Outcome {
        let start = match &mut memory.start {
            ExcitationStart::At(start) => *start,
            ExcitationStart::WaitingForRest(rest) => {
                if self.direction_check.step(rest, reading)? == Action::Wait {
                    return Ok(Some(Command::default()));
                }
                memory.start = ExcitationStart::At(reading.place);
                reading.place
            }
        };
        let least_motion = self.direction_check.least_motion();
        let excitation = &memory.excitation;
        let position = self.encoder.distance(start, reading.place);
        let played = excitation.step(&mut memory.played, position, least_motion);
        let value = position.0;
        match played.map_err(|fault| Trip { fault, value })? {
            Some(current) => self.carried(current),
            None => Ok(None),
        }
    }

    /// The corridor proper. Coefficients and memory lie farther apart than an instruction of the drive's processor
    /// reaches; not inlined, each has a register of its own.
    #[cfg_attr(target_arch = "arm", inline(never))]
    fn run(
        &self,
        running: &mut Running<N, O>,
        encoder: &mut encoder::Memory,
        (measurement, reading): (&Measurement, &Reading),
        telemetry: &mut Telemetry<[f32; N]>,
        (stiction, heat): (Option<f32>, Heat),
    ) -> Outcome {
        if !self.starts(&mut running.start, reading)? {
            return Ok(Some(Command::default()));
        }
        // What is looked for may lie outside of the travel.
        let set = telemetry.position_set && running.homing.is_none();
        let (memory, displacement, current) = match &mut running.memory {
            Some(memory) => (memory, reading.displacement, measurement.current),
            // What was before the start is not the observers' to know.
            none => (
                none.insert(self.begin(reading.place, set, stiction)),
                0.0,
                self.holding_current(),
            ),
        };
        self.direct(memory, &mut running.asked, &mut running.homing, set)?;
        let reference = self.moves.step(&mut memory.moves);
        let position = self.encoder.distance(memory.target, reading.place);
        let error = Position(position.0 - reference.position.0);

        // The observers see how the machine differs from the reference: what a plan does to it is known.
        let fed = core::mem::take(&mut memory.fed);
        let differing = Current(current.0 - fed.moves.0 - fed.friction.0);
        let displacement = displacement - reference.displacement;
        let disturbance = self
            .disturbance
            .step(&mut memory.disturbance, displacement, differing);
        let reaction_force =
            self.reaction_force
                .step(&mut memory.reaction_force, &disturbance, differing);
        let seen = Seen {
            position: error,
            mean_velocity: disturbance.mean_velocity,
            velocity: disturbance.velocity,
            current: differing,
            reaction_force,
        };
        memory.difference = self.observer.step(&mut memory.observer, &seen);
        let difference = &memory.difference;
        let velocity = Velocity(reference.displacement * self.frequency);
        let expected = self.expected(&mut memory.expected, &reference, fed.moves);
        let estimate = on_reference(difference, &reference, velocity);
        let reaction_force = Force(reaction_force.0 + expected.0);

        let disturbance = Force(disturbance.force.0 + expected.0);
        let target = self.encoder.position(memory.target);
        let forces = (disturbance, reaction_force);
        record(telemetry, target, &reference, &estimate, forces);

        let period = Period {
            reading,
            position,
            from_zero: Position(telemetry.position),
            current,
            heat,
            reaction_force,
            estimate: &estimate,
            reference: &reference,
            to_stop: running.homing.as_ref().and_then(Homing::seeks_stop),
        };
        let watched = self.protection.running(&mut memory.protection, &period);
        let sought = |homing: &mut Homing| homing.wait(self.sample_time);
        let watched = watched.and_then(|()| running.homing.as_mut().map_or(Ok(()), sought));
        if let Err(trip) = watched {
            let asked = (&mut running.stopping, &mut running.asked);
            brakes(trip, asked, reading.place, telemetry)?;
        }
        memory.fed.moves = reference.feed_forward;
        if let Some(stopping) = &mut running.stopping {
            self.protection.leaves_plan(&mut memory.protection);
            telemetry.reference = self.encoder.position(stopping.place).0;
            if stopping.ended(&self.rest, reading, self.sample_time) {
                return Ok(None);
            }
            let off = self.encoder.distance(stopping.place, reading.place);
            return self.stand(off, estimate);
        }
        let feedback = self.regulator.step(difference);
        let rule = self
            .standstill
            .step(&mut memory.standstill, reference.rests, difference);
        let friction =
            self.friction.with(self.coulomb(stiction)).step(velocity).0 + rule.friction.0;
        memory.fed.friction = Current(friction * self.current_per_force);
        let wanted = Current(
            reference.feed_forward.0
                + memory.fed.friction.0
                + feedback.0
                + rule.compensation.0 * self.current_per_force,
        );
        let command = self.limited_in(running.homing.as_ref(), wanted)?;
        let cut = command.limited && !reference.rests;
        match &mut running.homing {
            Some(homing) if homing.pushes(command.current) => {
                let back = homing.owes(reference.displacement, self.encoder.resolution, cut);
                self.set_back(memory, back);
            }
            _ => self.slip(memory, &mut running.asked, cut.then_some(error)),
        }
        if running.homing.is_some() {
            let now = (reading, measurement.home);
            if self.home(running, encoder, now, reference.rests, command.current)? {
                // The record of this very period has the new names.
                let target = self.renamed(running, encoder.place(), telemetry);
                record(telemetry, target, &reference, &estimate, forces);
            }
        }
        Ok(Some(command))
    }

    /// Whether the loop may be closed: never from motion, rest is proven first.
    fn starts(&self, start: &mut Start, reading: &Reading) -> Result<bool, Fault> {
        let Start::WaitingForRest(rest, periods) = start else {
            return Ok(true);
        };
        if self.rest.rested(rest) || self.rest.may_start(rest, reading) {
            *start = Start::AtRest;
            return Ok(true);
        }
        *periods = periods.saturating_add(1);
        if *periods as f32 * self.sample_time > PATIENCE {
            return Err(Fault::NotAtRest);
        }
        Ok(false)
    }

    /// What is asked of the moves is begun, and the target moves on.
    fn direct(
        &self,
        memory: &mut Loop<N, O::Memory>,
        asked: &mut Option<Request>,
        homing: &mut Option<Homing>,
        set: bool,
    ) -> Result<(), Fault> {
        if asked.is_none() && !memory.moves.jogs() {
            // The target stays.
            return Ok(());
        }
        if let Some(Request::Home(how)) = *asked
            && memory.moves.rests()
        {
            *homing = Some(self.begin_homing(memory, how, asked));
        }
        let keeps = set && homing.is_none();
        let travel = self.protection.travel().copied().filter(|_| keeps);
        let steps = matches!(asked, Some(Request::Step(_)));
        let before = memory.target;
        let directed = self.moves.direct(&mut memory.moves, asked, before, travel);
        memory.target = directed.map_err(|_| Fault::Target)?;
        if steps && memory.target != before {
            // The reference leaps, and the machine is as far from it.
            let distance = self.encoder.distance(before, memory.target);
            self.observer.shift(&mut memory.observer, distance);
            self.protection.leaves_plan(&mut memory.protection);
        }
        Ok(())
    }

    /// The force that the reference's load exerts.
    fn expected(
        &self,
        memory: &mut Expected,
        reference: &Reference<N>,
        feed_forward: Current,
    ) -> Force {
        let of_actuator = (self.actuator, self.frequency);
        memory.step(reference.displacement, feed_forward, of_actuator)
    }

    /// The command that holds the machine at a place, whatever the move goes on to do.
    ///
    /// * `off`: where the actuator is, from there, as measured: what the target is worth by now is not known
    /// * `estimate`: of the rest of the machine
    fn stand(&self, off: Position, mut estimate: Estimate<N>) -> Outcome {
        estimate.position = off;
        let feedback = self.regulator.step(&estimate);
        let compensation = estimate.disturbance.0 * self.current_per_force;
        self.limited(Current(feedback.0 + compensation))
    }

    /// A machine that is held back at the current limit is not run away from: where that lasts, the reference
    /// goes on from where the machine is, and what is then missing is a move of its own.
    ///
    /// * `behind`: by how much the machine is, where the current limit acts in a move
    fn slip(
        &self,
        memory: &mut Loop<N, O::Memory>,
        asked: &mut Option<Request>,
        behind: Option<Position>,
    ) {
        let Some(Position(error)) = behind else {
            memory.limited = 0;
            return;
        };
        memory.limited = memory.limited.saturating_add(1);
        if memory.limited < self.moves.patience() || error.abs() <= self.standstill.tolerance {
            return;
        }
        memory.limited = 0;
        let before = memory.target;
        self.set_back(memory, Position(error));
        if asked.is_none() && !memory.moves.jogs() {
            *asked = Some(Request::Move(before));
        }
    }

    /// The target moves by a distance, in whole counts, and the reference with it.
    fn set_back(&self, memory: &mut Loop<N, O::Memory>, distance: Position) {
        let before = memory.target;
        let counts = self.encoder.place(distance).0;
        memory.target = Place(before.0.wrapping_add(counts));
        let distance = self.encoder.distance(before, memory.target);
        self.observer.shift(&mut memory.observer, distance);
    }

    /// The command of an open loop: a current beside what carries the machine.
    fn carried(&self, current: Current) -> Outcome {
        self.limited(Current(current.0 + self.holding_current().0))
    }

    /// The command that applies a current as far as the limits allow.
    fn limited(&self, current: Current) -> Outcome {
        Ok(Some(within(&self.limiter, current)?))
    }

    /// The command that applies a current as far as a lower limit allows.
    #[cold]
    fn limited_below(&self, Current(limit): Current, wanted: Current) -> Result<Command, Fault> {
        within(&self.limiter.with_limit(limit), wanted)
    }

    /// The command of the closed loop; an approach to a stop has a limit of its own.
    fn limited_in(&self, homing: Option<&Homing>, wanted: Current) -> Result<Command, Fault> {
        match homing.and_then(Homing::limit) {
            None => within(&self.limiter, wanted),
            Some(limit) => self.limited_below(limit, wanted),
        }
    }
}

/// The command that applies a current as far as limits allow.
#[inline]
fn within(limiter: &Limiter, current: Current) -> Result<Command, Fault> {
    let limited = limiter.step(current).ok_or(Fault::NonFinite)?;
    Ok(Command {
        current: limited.current,
        enable: true,
        limited: limited.limited,
    })
}

/// A fault is answered by braking, where it leaves the loop trustworthy.
///
/// # Errors
/// The fault, where it does not.
fn brakes<L>(
    trip: Trip,
    (stopping, asked): (&mut Option<Stopping>, &mut Option<Request>),
    place: Place,
    telemetry: &mut Telemetry<L>,
) -> Result<(), Trip> {
    if trip.fault.reaction() == Reaction::Off {
        return Err(trip);
    }
    // What led to the braking is no news while it goes on.
    if stopping.is_none() {
        telemetry.fault_value = trip.value;
        *stopping = Some(Stopping::new(trip.fault, place));
        *asked = None;
    }
    Ok(())
}

/// What a period of the closed loop found, into its record.
///
/// * `target`: from zero
/// * `disturbance`, `reaction_force`: the whole forces, what the reference exerts included
fn record<const N: usize>(
    telemetry: &mut Telemetry<[f32; N]>,
    target: Position,
    reference: &Reference<N>,
    estimate: &Estimate<N>,
    (disturbance, reaction_force): (Force, Force),
) {
    telemetry.reference = target.0 + reference.position.0;
    telemetry.velocity = estimate.velocity.0;
    telemetry.disturbance = disturbance.0;
    telemetry.reaction_force = reaction_force.0;
    telemetry.disturbance_state = estimate.disturbance.0;
    telemetry.load_velocity = estimate.load_velocity;
    for (position, deflection) in telemetry.load_position.iter_mut().zip(&estimate.deflection) {
        *position = target.0 + estimate.position.0 + deflection;
    }
}

/// Where the machine is: what it differs by on top of the reference.
///
/// * `velocity`: of the reference's actuator
fn on_reference<const N: usize>(
    difference: &Estimate<N>,
    reference: &Reference<N>,
    velocity: Velocity,
) -> Estimate<N> {
    let mut estimate = *difference;
    estimate.position.0 += reference.position.0;
    estimate.velocity.0 += velocity.0;
    let loads = estimate
        .deflection
        .iter_mut()
        .zip(&mut estimate.load_velocity);
    let references = reference.deflection.iter().zip(&reference.load_velocity);
    for ((deflection, load_velocity), (of_deflection, of_velocity)) in loads.zip(references) {
        *deflection += of_deflection;
        *load_velocity += of_velocity;
    }
    estimate
}

#[cfg(test)]
pub(crate) mod tests;
