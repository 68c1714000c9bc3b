//! What a law that is not the core follows: a reference and what is fed forward beside it.
//!
//! ```text
//! step, drawn out into ramps and shaped -+-> position, velocity or displacement, i_ff, friction
//! planned move, as the core plays it ----+
//! ```
//!
//! A planned move comes as displacements: who measures motion takes it less the reference's, so that no filter's lag
//! counts as an error, and feeds its observers with the current less what was fed forward, as the core does.
//! Friction is fed forward by the velocity of the reference where the drive is sent by a move.

use super::ReferenceSettings;
use super::shaper::Shaper;
use crate::design::Design;
use crate::design::player::{Play, player};
use crate::error::Result;
use crate::simulate::scenario::{Approach, Scenario};
use arso_core::Velocity;
use arso_core::friction::FrictionFeedForward;
use nalgebra::DVector;

/// What a law is led by in one period.
pub(super) struct Led<'g> {
    /// State `x_a v_a x_1 v_1 …`, m and m/s.
    pub(super) state: &'g DVector<f64>,
    /// Distance by which the measured motion is to be taken less, m.
    pub(super) displacement: f64,
    /// Velocity that the motion ought to have beside that, m/s.
    pub(super) velocity: f64,
    /// `i_ff` and friction, A.
    pub(super) feed_forward: f64,
    pub(super) friction: f64,
}

/// What leads a law.
pub(super) struct Guide<'d> {
    source: Source<'d>,
    friction: Option<FrictionFeedForward>,
    /// N/A.
    force_constant: f64,
    /// s.
    period: f64,
    /// Of the reference before, m.
    before: f64,
}

enum Source<'d> {
    Shaped(Shaped),
    Plan(Box<dyn Play + 'd>),
}

/// A step in parts, each drawn out into a ramp; one of a single period is exactly that.
struct Shaped {
    /// Share and start of each part, and the duration of its ramp, control periods.
    parts: Vec<(f64, f64)>,
    ramp: f64,
    target: f64,
    /// Reference of every state in the last period.
    state: DVector<f64>,
    samples: u32,
}

impl Shaped {
    /// Reference and its velocity, m and m per period, after so many control periods.
    fn reference(&self, periods: f64) -> (f64, f64) {
        let (mut position, mut velocity) = (0.0, 0.0);
        for (share, start) in &self.parts {
            let part = share * self.target;
            let done = ((periods - start) / self.ramp).clamp(0.0, 1.0);
            position += part * done;
            if done > 0.0 && done < 1.0 {
                velocity += part / self.ramp;
            }
        }
        (position, velocity)
    }
}

impl<'d> Guide<'d> {
    /// A shaped step; a step as it is where nothing is said of its shape.
    pub(super) fn shaped(
        design: &Design,
        reference: Option<ReferenceSettings>,
        shaper: Shaper,
        scenario: &Scenario,
    ) -> Self {
        let period = design.drive.control.sample_time;
        let parts = reference.map_or_else(
            || vec![(1.0, 0.0)],
            |shaped| shaper.parts(shaped.frequency * period, shaped.damping),
        );
        let shaped = Shaped {
            parts,
            ramp: reference.map_or(1.0, |shaped| (shaped.ramp / period).max(1.0)),
            target: scenario.target,
            state: DVector::zeros(design.chain.states()),
            samples: 0,
        };
        Self::new(design, Source::Shaped(shaped), scenario)
    }

    /// The reference step or planned move of an experiment.
    ///
    /// # Errors
    /// [`Error::Design`](crate::error::Error::Design) when there are no plans.
    pub(super) fn of(design: &'d Design, scenario: &Scenario) -> Result<Self> {
        Ok(match scenario.approach {
            Approach::Step => Self::shaped(design, None, Shaper::None, scenario),
            Approach::Move => {
                let mut player = player(design)?;
                player.ask(scenario.request(design.drive.encoder.resolution));
                Self::new(design, Source::Plan(player), scenario)
            }
        })
    }

    fn new(design: &Design, source: Source<'d>, scenario: &Scenario) -> Self {
        Self {
            source,
            friction: (scenario.approach == Approach::Move).then(|| design.friction()),
            force_constant: design.chain.force_constant,
            period: design.drive.control.sample_time,
            before: 0.0,
        }
    }

    /// One period.
    pub(super) fn step(&mut self) -> Result<Led<'_>> {
        let (state, velocity, feed_forward) = match &mut self.source {
            Source::Shaped(shaped) => {
                // The first sample already sees the first part of the ramp, as a step is seen.
                shaped.samples += 1;
                let (position, velocity) = shaped.reference(f64::from(shaped.samples));
                let velocity = velocity / self.period;
                for (row, state) in shaped.state.iter_mut().enumerate() {
                    *state = if row % 2 == 0 { position } else { velocity };
                }
                (&shaped.state, Some(velocity), 0.0)
            }
            Source::Plan(player) => {
                let instant = player.step()?;
                (instant.state, None, instant.feed_forward)
            }
        };
        let moved = state[0] - self.before;
        self.before = state[0];
        let friction = self.friction.map_or(0.0, |friction| {
            let velocity = Velocity((moved / self.period) as f32);
            f64::from(friction.step(velocity).0) / self.force_constant
        });
        Ok(Led {
            state,
            displacement: velocity.map_or(moved, |_| 0.0),
            velocity: velocity.unwrap_or(0.0),
            feed_forward,
            friction,
        })
    }
}
