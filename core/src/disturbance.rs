//! Disturbance observer, eq. (19).
//!
//! Sees the actuator alone: its displacement and the current that was applied. The disturbance is all
//! that the nominal actuator does not explain (load, friction, deviations of mass and force constant),
//! through a low-pass filter:
//!
//! ```text
//! (19)  d_hat = LPF_dist[ k_fn i − m_an s v_a ],   LPF_g = g / (s + g)
//! ```
//!
//! The current path is exact for a current held over the period. The position path is a difference of
//! a difference through one [`Lag`], so that no velocity is differentiated twice and its low-frequency
//! gain is one. See [`theory`](crate::theory), (19).
//!
//! What eq. (18) needs besides is handed on to [`reaction_force`](crate::reaction_force), so that
//! nothing is computed twice.

use crate::actuator::Actuator;
use crate::filter::{Difference, Lag, Real};
use crate::units::{Current, Force, Velocity};

/// Coefficients of the disturbance observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisturbanceObserver<T = f32> {
    mass: T,
    force_constant: T,
    difference: Difference<T>,
    lag: Lag<T>,
}

/// What is kept from one period to the next; zero is the actuator at rest without current.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory<T = f32> {
    /// Motor force through `LPF_dist`, N.
    pub motor_force: T,
    /// Mean velocity over the last period, m/s.
    pub mean_velocity: T,
    /// That through `LPF_dist`, m/s.
    pub velocity: T,
    /// Its difference through `LPF_dist`, m/s².
    pub acceleration: T,
}

/// What the observer finds in one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance<T = f32> {
    /// Disturbance `d_hat` of (19): load, friction and everything else that holds back.
    pub force: Force<T>,
    /// Velocity of the actuator through the filter, `LPF_dist[v_a]`.
    pub velocity: Velocity<T>,
    /// Mean velocity over the period, without a filter.
    pub mean_velocity: Velocity<T>,
    /// Difference of the filtered velocity, m/s².
    pub(crate) acceleration: T,
    /// Difference of the mean velocity, m/s².
    pub(crate) mean_acceleration: T,
    /// Motor force over the period, and through `LPF_dist` when it began, N.
    pub(crate) motor_force: (T, T),
}

impl<T: Real> DisturbanceObserver<T> {
    /// The memory of an actuator at rest under a current that has flown for long.
    #[must_use]
    pub fn at_rest(&self, current: Current<T>) -> Memory<T> {
        Memory {
            motor_force: self.force_constant * current.0,
            ..Memory::default()
        }
    }

    /// * `cutoff`: `g_dist`, rad/s
    /// * `sample_time`: `T`, s
    ///
    /// Both positive and finite; [`Settings::check`](crate::Settings::check) sees to it.
    #[must_use]
    pub fn new(actuator: &Actuator<T>, cutoff: T, sample_time: T) -> Self {
        Self {
            mass: actuator.mass,
            force_constant: actuator.force_constant,
            difference: Difference::new(sample_time),
            lag: Lag::new(cutoff, sample_time),
        }
    }

    /// One period.
    ///
    /// * `displacement`: distance of the actuator since the sample before, m
    /// * `current`: current that was applied over the period that ends now
    pub fn step(
        &self,
        memory: &mut Memory<T>,
        displacement: T,
        current: Current<T>,
    ) -> Disturbance<T> {
        let motor_force = self.force_constant * current.0;
        let motor_force_before = memory.motor_force;
        let filtered_force = self.lag.step(&mut memory.motor_force, motor_force);

        let mean_velocity = self.difference.of(displacement);
        let mean_acceleration = self
            .difference
            .step(&mut memory.mean_velocity, mean_velocity);
        let filtered_acceleration = self.lag.step(&mut memory.acceleration, mean_acceleration);
        let velocity_before = memory.velocity;
        let velocity = self.lag.step(&mut memory.velocity, mean_velocity);

        Disturbance {
            force: Force(filtered_force - self.mass * filtered_acceleration),
            velocity: Velocity(velocity),
            mean_velocity: Velocity(mean_velocity),
            acceleration: self.difference.of(velocity - velocity_before),
            mean_acceleration,
            motor_force: (motor_force, motor_force_before),
        }
    }
}
