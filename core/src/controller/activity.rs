//! What is under way, with what it remembers: a mode's memory lives as long as the mode.

use super::Request;
use crate::direction_check;
use crate::disturbance::{self, DisturbanceObserver};
use crate::encoder::Reading;
use crate::excitation::{self, Excitation};
use crate::fault::Fault;
use crate::homing;
use crate::mode::Mode;
use crate::moves;
use crate::observer::{Estimate, StateObserver};
use crate::protection;
use crate::reaction_force;
use crate::rest::{self, Rest};
use crate::standstill;
use crate::units::{Current, Force, Place, Velocity};

/// A mode with its memory. Which one is looked up several times in a period, and so has a byte of its own.
#[derive(Clone, Debug)]
#[repr(u8)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap to put the larger one on"
)]
pub(super) enum Activity<const N: usize, O: StateObserver<N>> {
    Idle,
    Commissioning(Commissioning),
    Exciting(Exciting),
    /// Whether the machine is at rest is followed all the time.
    Ready(rest::Memory),
    Running(Running<N, O>),
    Fault(Fault),
    Storing,
}

impl<const N: usize, O: StateObserver<N>> Activity<N, O> {
    /// Goes on to a mode; an excitation begins with what it is to play, see [`Exciting::new`].
    pub(super) fn enter(&mut self, mode: Mode, place: Place) {
        let next = match (mode, &*self) {
            (Mode::Idle | Mode::Exciting, _) => Self::Idle,
            (Mode::Commissioning, _) => Self::Commissioning(Commissioning::default()),
            // The signs are proven when the actuator has come to rest.
            (Mode::Ready, Self::Commissioning(_)) => Self::Ready(rest::Memory::proven(place)),
            (Mode::Ready, Self::Ready(rest)) => Self::Ready(*rest),
            (Mode::Ready, _) => Self::Ready(rest::Memory::default()),
            (Mode::Running, Self::Ready(rest)) => Self::Running(Running::new(*rest)),
            (Mode::Running | Mode::Stopping(_), _) => {
                Self::Running(Running::new(rest::Memory::default()))
            }
            (Mode::Fault(fault), _) => Self::Fault(fault),
            (Mode::Storing, _) => Self::Storing,
        };
        *self = next;
    }

    /// Stops with a fault.
    pub(super) fn trip(&mut self, fault: Fault) {
        *self = Self::Fault(fault);
    }

    pub(super) fn mode(&self) -> Mode {
        match self {
            Self::Idle => Mode::Idle,
            Self::Commissioning(_) => Mode::Commissioning,
            Self::Exciting(_) => Mode::Exciting,
            Self::Ready(_) => Mode::Ready,
            Self::Running(running) => match &running.stopping {
                None => Mode::Running,
                Some(stopping) => Mode::Stopping(stopping.fault),
            },
            Self::Fault(fault) => Mode::Fault(*fault),
            Self::Storing => Mode::Storing,
        }
    }
}

/// Memory of commissioning.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Commissioning {
    pub(super) direction_check: direction_check::Memory,
    /// Of the filter of the velocity, once the loop is closed.
    brake: Option<disturbance::Memory>,
}

impl Commissioning {
    /// Velocity of the actuator through the disturbance observer's filter, from rest on.
    pub(super) fn velocity(
        &mut self,
        observer: &DisturbanceObserver,
        reading: &Reading,
    ) -> Velocity {
        let (memory, displacement) = match &mut self.brake {
            Some(memory) => (memory, reading.displacement),
            none => (none.insert(disturbance::Memory::default()), 0.0),
        };
        observer.step(memory, displacement, Current(0.0)).velocity
    }
}

/// Memory of an excitation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exciting {
    pub(super) excitation: Excitation,
    pub(super) start: ExcitationStart,
    pub(super) played: excitation::Memory,
}

impl Exciting {
    pub(super) fn new(excitation: Excitation) -> Self {
        Self {
            excitation,
            start: ExcitationStart::WaitingForRest(direction_check::Memory::default()),
            played: excitation::Memory::default(),
        }
    }
}

/// How far the start of an excitation has come.
#[derive(Clone, Copy, Debug)]
pub(super) enum ExcitationStart {
    WaitingForRest(direction_check::Memory),
    /// It is played from there.
    At(Place),
}

/// Memory of a running drive.
#[derive(Clone, Debug)]
pub(super) struct Running<const N: usize, O: StateObserver<N>> {
    pub(super) start: Start,
    /// Of the closed loop, from its first period on.
    pub(super) memory: Option<Loop<N, O::Memory>>,
    /// The target that is waiting.
    pub(super) asked: Option<Request>,
    /// The stand that a fault asks for.
    pub(super) stopping: Option<Stopping>,
    /// The search for zero.
    pub(super) homing: Option<homing::Memory>,
}

impl<const N: usize, O: StateObserver<N>> Running<N, O> {
    /// * `rest`: what is known of the machine's rest
    fn new(rest: rest::Memory) -> Self {
        Self {
            start: Start::WaitingForRest(rest, 0),
            memory: None,
            asked: None,
            stopping: None,
            homing: None,
        }
    }

    /// Where it is to be, or what it will begin with.
    ///
    /// * `place`: where the actuator is
    pub(super) fn target(&self, place: Place) -> Place {
        self.memory.as_ref().map_or(place, |memory| memory.target)
    }
}

/// How far the start has come.
#[derive(Clone, Copy, Debug)]
pub(super) enum Start {
    /// With the periods that it has waited.
    WaitingForRest(rest::Memory, u32),
    AtRest,
}

/// A fault that the loop answers by braking.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stopping {
    fault: Fault,
    /// Where it is held.
    pub(super) place: Place,
    rest: rest::Memory,
    periods: u32,
}

impl Stopping {
    /// Longest braking, s, and grains within which the actuator has then come to a stand.
    const LONGEST: f32 = 1.0;
    const GRAINS: f32 = 20.0;

    pub(super) fn new(fault: Fault, place: Place) -> Self {
        Self {
            fault,
            place,
            rest: rest::Memory::default().moved_to(place),
            periods: 0,
        }
    }

    /// One period: whether the machine stands, or has been given long enough.
    pub(super) fn ended(&mut self, rest: &Rest, reading: &Reading, sample_time: f32) -> bool {
        self.periods = self.periods.saturating_add(1);
        rest.within(&mut self.rest, reading, Self::GRAINS)
            || self.periods as f32 * sample_time > Self::LONGEST
    }
}

/// Memory of the closed loop, part by part in the order of the corridor.
#[derive(Clone, Debug)]
pub(super) struct Loop<const N: usize, M> {
    pub(super) disturbance: disturbance::Memory,
    pub(super) reaction_force: reaction_force::Memory,
    pub(super) observer: M,
    /// What all positions are relative to.
    pub(super) target: Place,
    pub(super) moves: moves::Memory<N>,
    pub(super) standstill: standstill::Memory,
    /// What of the current that is applied now is fed forward: for the move, and for friction.
    pub(super) fed: Fed,
    /// Where the machine was found last, relative to the reference.
    pub(super) difference: Estimate<N>,
    /// The force that the reference's load exerts, beside what the observers find.
    pub(super) expected: Expected,
    /// For how many periods the current limit has acted in a move.
    pub(super) limited: u32,
    pub(super) protection: protection::Memory,
}

/// Currents that are fed forward.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fed {
    /// `i_ff`.
    pub(super) moves: Current,
    /// What friction takes.
    pub(super) friction: Current,
}

/// What the reaction force of the reference is made of.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Expected {
    displacement: f32,
    feed_forward: f32,
}

impl Expected {
    /// Force that the load exerts on an actuator that moves as the reference does: `k_f i_ff − m_a s v_a`,
    /// both over the last two periods.
    pub(super) fn step(
        &mut self,
        displacement: f32,
        feed_forward: Current,
        ((mass, force_constant), frequency): ((f32, f32), f32),
    ) -> Force {
        let acceleration = (displacement - self.displacement) * frequency * frequency;
        let current = 0.5 * (feed_forward.0 + self.feed_forward);
        self.displacement = displacement;
        self.feed_forward = feed_forward.0;
        Force(force_constant * current - mass * acceleration)
    }
}
