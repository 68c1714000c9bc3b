//! The core's moves by themselves, for laws that are not the core: the same references, period by period.

use crate::design::Design;
use crate::drive::MAX_LOADS;
use crate::error::{Error, Result};
use arso_core::moves::{Memory, Moves};
use arso_core::{Place, Request, Velocity};
use nalgebra::DVector;

/// What the reference is in one period.
pub(crate) struct Instant<'p> {
    /// State `x_a v_a x_1 v_1 …`, m and m/s.
    pub(crate) state: &'p DVector<f64>,
    /// `i_ff`, A.
    pub(crate) feed_forward: f64,
    /// Of the actuator.
    pub(crate) velocity: Velocity,
}

/// Moves under way, of any number of loads.
pub(crate) trait Play {
    /// Asks for a step, a move, a jog or a halt.
    fn ask(&mut self, request: Request);

    /// One period.
    ///
    /// # Errors
    /// [`Error::Simulation`] when no move leads to what was asked for.
    fn step(&mut self) -> Result<Instant<'_>>;
}

/// The moves of a design, at rest at the origin.
///
/// # Errors
/// [`Error::Design`] when it has no plans.
pub(crate) fn player(design: &Design) -> Result<Box<dyn Play + '_>> {
    Ok(match design.loads() {
        1 => Box::new(Player::<1>::new(design)?),
        2 => Box::new(Player::<2>::new(design)?),
        3 => Box::new(Player::<3>::new(design)?),
        4 => Box::new(Player::<4>::new(design)?),
        5 => Box::new(Player::<5>::new(design)?),
        _ => Box::new(Player::<MAX_LOADS>::new(design)?),
    })
}

struct Player<'d, const N: usize> {
    moves: Moves<'d>,
    memory: Memory<N>,
    target: Place,
    asked: Option<Request>,
    /// m per count, and s.
    resolution: f64,
    period: f64,
    /// Of the last period.
    state: DVector<f64>,
}

impl<'d, const N: usize> Player<'d, N> {
    fn new(design: &'d Design) -> Result<Self> {
        let drive = &design.drive;
        let (resolution, period) = (drive.encoder.resolution, drive.control.sample_time);
        let plans = design.plans()?.plans();
        Ok(Self {
            moves: Moves::new(plans, period as f32, resolution as f32),
            memory: Memory::default(),
            target: Place(0),
            asked: None,
            resolution,
            period,
            state: DVector::zeros(2 * N + 2),
        })
    }
}

impl<const N: usize> Play for Player<'_, N> {
    fn ask(&mut self, request: Request) {
        self.asked = Some(request);
    }

    fn step(&mut self) -> Result<Instant<'_>> {
        let directed = self
            .moves
            .direct(&mut self.memory, &mut self.asked, self.target, None);
        self.target = directed
            .map_err(|_| Error::Simulation("no planned move leads to the target".into()))?;
        let reference = self.moves.step(&mut self.memory);
        let position = self.target.0 as f64 * self.resolution + f64::from(reference.position.0);
        let velocity = f64::from(reference.displacement) / self.period;
        let state = &mut self.state;
        (state[0], state[1]) = (position, velocity);
        for load in 0..N {
            state[2 * load + 2] = position + f64::from(reference.deflection[load]);
            state[2 * load + 3] = reference.load_velocity[load].into();
        }
        Ok(Instant {
            state,
            feed_forward: reference.feed_forward.0.into(),
            velocity: Velocity(velocity as f32),
        })
    }
}
