//! What is under way, with what it remembers: a mode's memory lives as long as the mode.

use super::Request;
use crate::direction_check;
use crate::disturbance::{self, DisturbanceObserver};
use crate::encoder::Reading;
use crate::excitation::{self, Excitation};
use crate::fault::Fault;
use crate::mode::Mode;
use crate::moves::rigid::{self, RigidMoves};
use crate::observer::StateObserver;
use crate::reaction_force;
use crate::units::{Current, Position, Velocity};

/// A mode with its memory.
#[derive(Clone, Debug)]
pub(super) enum Activity<const N: usize, O: StateObserver<N>> {
    Idle,
    Commissioning(Commissioning),
    Exciting(Exciting),
    Ready,
    Running(Running<N, O>),
    Fault(Fault),
}

impl<const N: usize, O: StateObserver<N>> Activity<N, O> {
    /// The beginning of a mode; an excitation begins with what it is to play, see [`Exciting::new`].
    pub(super) fn enter(mode: Mode) -> Self {
        match mode {
            Mode::Idle | Mode::Exciting => Self::Idle,
            Mode::Commissioning => Self::Commissioning(Commissioning::default()),
            Mode::Ready => Self::Ready,
            Mode::Running => Self::Running(Running {
                memory: None,
                asked: None,
            }),
            Mode::Fault(fault) => Self::Fault(fault),
        }
    }

    pub(super) fn mode(&self) -> Mode {
        match self {
            Self::Idle => Mode::Idle,
            Self::Commissioning(_) => Mode::Commissioning,
            Self::Exciting(_) => Mode::Exciting,
            Self::Ready => Mode::Ready,
            Self::Running(_) => Mode::Running,
            Self::Fault(fault) => Mode::Fault(*fault),
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
    /// The wait for rest, until it is over.
    pub(super) rest: Option<direction_check::Memory>,
    pub(super) played: excitation::Memory,
}

impl Exciting {
    pub(super) fn new(excitation: Excitation) -> Self {
        Self {
            excitation,
            rest: Some(direction_check::Memory::default()),
            played: excitation::Memory::default(),
        }
    }
}

/// Memory of a running drive.
#[derive(Clone, Debug)]
pub(super) struct Running<const N: usize, O: StateObserver<N>> {
    /// Of the closed loop, from its first period on.
    pub(super) memory: Option<Loop<O::Memory>>,
    /// The target that is waiting.
    pub(super) asked: Option<Request>,
}

/// Memory of the closed loop, part by part in the order of the corridor.
#[derive(Clone, Debug)]
pub(super) struct Loop<M> {
    pub(super) disturbance: disturbance::Memory,
    pub(super) reaction_force: reaction_force::Memory,
    pub(super) observer: M,
    pub(super) moves: rigid::Memory,
}

impl<M> Loop<M> {
    /// At rest where the actuator stands, with the reference there.
    pub(super) fn at_rest<const N: usize, O: StateObserver<N, Memory = M>>(
        observer: &O,
        moves: &RigidMoves,
        position: Position,
    ) -> Self {
        let mut reference = rigid::Memory::default();
        moves.step_to(&mut reference, position);
        Self {
            disturbance: disturbance::Memory::default(),
            reaction_force: reaction_force::Memory::default(),
            observer: observer.at_rest(position),
            moves: reference,
        }
    }
}
