//! Reaction-force observer, eq. (18).
//!
//! From what the [`disturbance`](crate::disturbance) observer found and the current, the force that the
//! load exerts on the actuator, with the identified deviations of mass and force constant taken out:
//!
//! ```text
//! (18)  f_reac_hat = LPF_reac[ d_hat + Δk_f i ] − Δm LPF_reac[ s v_a ],   LPF_g = g / (s + g)
//! ```
//!
//! The nominal force is thus filtered twice, with `g_dist` and with `g_reac`, the deviations once. Its
//! current path is two lags in a row, exact for a held current; its position path two filtered
//! differences. See [`theory`](crate::theory), (18).
//!
//! Noise: 5 mN rms at 1 µm and 1 ms for both cutoffs at 628 rad/s and 59 g; proportional to mass and
//! resolution.

use crate::actuator::Actuator;
use crate::disturbance::Disturbance;
use crate::filter::{Lag, Real, SecondLag};
use crate::units::{Current, Force};

/// Coefficients of the reaction-force observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactionForceObserver<T = f32> {
    actuator: Actuator<T>,
    lag: Lag<T>,
    second: SecondLag<T>,
}

/// What is kept from one period to the next; zero is the actuator at rest without current.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory<T = f32> {
    /// Motor force through `LPF_dist` and `LPF_reac`, N.
    pub motor_force: T,
    /// Acceleration through both, m/s².
    pub acceleration: T,
    /// Current through `LPF_reac`, A.
    pub current: T,
    /// Acceleration through `LPF_reac`, m/s².
    pub mean_acceleration: T,
}

impl<T: Real> ReactionForceObserver<T> {
    /// The memory of an actuator at rest under a current that has flown for long.
    #[must_use]
    pub fn at_rest(&self, current: Current<T>) -> Memory<T> {
        Memory {
            motor_force: self.actuator.force_constant * current.0,
            current: current.0,
            ..Memory::default()
        }
    }

    /// * `disturbance_cutoff`: `g_dist`, rad/s
    /// * `cutoff`: `g_reac`, rad/s
    /// * `sample_time`: `T`, s
    ///
    /// All positive and finite; [`Settings::check`](crate::Settings::check) sees to it.
    #[must_use]
    pub fn new(actuator: &Actuator<T>, disturbance_cutoff: T, cutoff: T, sample_time: T) -> Self {
        Self {
            actuator: *actuator,
            lag: Lag::new(cutoff, sample_time),
            second: SecondLag::new(disturbance_cutoff, cutoff, sample_time),
        }
    }

    /// One period: the force, positive when the load holds the actuator back.
    ///
    /// * `disturbance`: what the disturbance observer found in this period
    /// * `current`: current that was applied over it
    pub fn step(
        &self,
        memory: &mut Memory<T>,
        disturbance: &Disturbance<T>,
        current: Current<T>,
    ) -> Force<T> {
        let actuator = &self.actuator;
        let (motor_force, once_before) = disturbance.motor_force;
        let twice = self
            .second
            .step(&mut memory.motor_force, once_before, motor_force);
        let acceleration = self
            .lag
            .step(&mut memory.acceleration, disturbance.acceleration);
        let filtered_current = self.lag.step(&mut memory.current, current.0);
        let mean_acceleration = self
            .lag
            .step(&mut memory.mean_acceleration, disturbance.mean_acceleration);
        Force(
            twice - actuator.mass * acceleration
                + actuator.force_constant_deviation * filtered_current
                - actuator.mass_deviation * mean_acceleration,
        )
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::disturbance::{self, DisturbanceObserver};

    const T: f32 = 1e-3;
    const NOMINAL: Actuator = Actuator {
        mass: 0.059,
        force_constant: 6.43,
        mass_deviation: 0.0,
        force_constant_deviation: 0.0,
    };

    /// Both observers, one after the other, as the corridor has them.
    struct Both {
        disturbance: (DisturbanceObserver, disturbance::Memory),
        reaction_force: (ReactionForceObserver, Memory),
    }

    /// What both find: (19), (18).
    struct Forces {
        disturbance: Force,
        reaction_force: Force,
    }

    impl Both {
        fn new(actuator: Actuator, g_dist: f32, g_reac: f32) -> Self {
            Self {
                disturbance: (
                    DisturbanceObserver::new(&actuator, g_dist, T),
                    disturbance::Memory::default(),
                ),
                reaction_force: (
                    ReactionForceObserver::new(&actuator, g_dist, g_reac, T),
                    Memory::default(),
                ),
            }
        }

        fn step(&mut self, displacement: f32, current: Current) -> Forces {
            let (observer, memory) = &mut self.disturbance;
            let disturbance = observer.step(memory, displacement, current);
            let (observer, memory) = &mut self.reaction_force;
            Forces {
                disturbance: disturbance.force,
                reaction_force: observer.step(memory, &disturbance, current),
            }
        }
    }

    /// Actuator held still under a constant current: the disturbance is the motor's force, seen
    /// through one lag (19) and through two (18), both in closed form.
    #[test]
    fn blocked_actuator_gives_the_lags_step_responses() {
        for (g_dist, g_reac) in [
            (628.0_f64, 628.0_f64),
            (628.0, 200.0),
            (300.0, 900.0),
            (500.0, 500.01),
        ] {
            let mut observers = Both::new(NOMINAL, g_dist as f32, g_reac as f32);
            for k in 1..=40 {
                let forces = observers.step(0.0, Current(0.5));
                let t = f64::from(k) * 1e-3;
                let force = 0.5 * 6.43;
                let one = force * (1.0 - (-g_dist * t).exp());
                let two = if (g_dist - g_reac).abs() < 0.1 {
                    force * (1.0 - (1.0 + g_dist * t) * (-g_dist * t).exp())
                } else {
                    force
                        * (1.0
                            - (g_reac * (-g_dist * t).exp() - g_dist * (-g_reac * t).exp())
                                / (g_reac - g_dist))
                };
                // Some 10 roundings of 6e-8 on 3.2 N, and 1e-4 for calling 500.01 equal to 500.
                let tolerance = if g_reac == 500.01 { 1e-4 } else { 5e-6 };
                assert!((f64::from(forces.disturbance.0) - one).abs() < 5e-6);
                assert!(
                    (f64::from(forces.reaction_force.0) - two).abs() < tolerance,
                    "{g_reac}"
                );
            }
        }
    }

    /// An actuator that has been at rest under a current for long is found under just that force.
    #[test]
    fn a_steady_current_is_a_steady_force() {
        let actual = Actuator {
            force_constant_deviation: -0.5,
            ..NOMINAL
        };
        let mut observers = Both::new(actual, 628.0, 300.0);
        let current = Current(0.2);
        observers.disturbance.1 = observers.disturbance.0.at_rest(current);
        observers.reaction_force.1 = observers.reaction_force.0.at_rest(current);
        for _ in 0..20 {
            let forces = observers.step(0.0, current);
            assert!((forces.disturbance.0 - 0.2 * 6.43).abs() < 1e-6);
            assert!((forces.reaction_force.0 - 0.2 * 5.93).abs() < 1e-6);
        }
    }

    /// Rigid two-mass motion: actuator and load accelerate together, the spring carries the
    /// load's inertia, and the observers find exactly that force.
    #[test]
    fn constant_acceleration_gives_the_loads_inertia() {
        let (load, acceleration) = (0.057_f64, 4.0_f64);
        let current = (0.059 + load) * acceleration / 6.43;
        let mut observers = Both::new(NOMINAL, 628.0, 628.0);
        let mut forces = observers.step(0.0, Current(0.0));
        let position = |k: i32| 0.5 * acceleration * (f64::from(k) * 1e-3).powi(2);
        for k in 1..60 {
            let displacement = (position(k) - position(k - 1)) as f32;
            forces = observers.step(displacement, Current(current as f32));
        }
        // Differences of raw velocity amplify the rounding of the displacement by rate² · mass.
        assert!((f64::from(forces.reaction_force.0) - load * acceleration).abs() < 1e-4);
        assert!((f64::from(forces.disturbance.0) - load * acceleration).abs() < 1e-4);
    }

    /// Free actuator whose mass and force constant deviate as identified: no load, so no
    /// reaction force, though (19) alone sees the deviation.
    #[test]
    fn identified_deviations_cancel_on_a_free_actuator() {
        let actual = Actuator {
            mass_deviation: 0.006,
            force_constant_deviation: -0.5,
            ..NOMINAL
        };
        let mut observers = Both::new(actual, 628.0, 628.0);
        let acceleration = f64::from(6.43_f32 - 0.5) * 0.2 / 0.065;
        let position = |k: i32| 0.5 * acceleration * (f64::from(k) * 1e-3).powi(2);
        let mut forces = observers.step(0.0, Current(0.0));
        for k in 1..60 {
            let displacement = (position(k) - position(k - 1)) as f32;
            forces = observers.step(displacement, Current(0.2));
        }
        assert!(
            forces.reaction_force.0.abs() < 5e-4,
            "{:?}",
            forces.reaction_force
        );
        let seen = 6.43 * 0.2 - 0.059 * acceleration;
        assert!((f64::from(forces.disturbance.0) - seen).abs() < 5e-4);
        assert!(seen.abs() > 0.1);
    }

    /// Frequency response of the position path at 12 Hz against the continuous filters: gain
    /// within 0.1 %, phase within half a degree (1.000 and −0.4°).
    #[test]
    fn position_path_follows_the_continuous_filter() {
        let (g, omega) = (628.0_f64, core::f64::consts::TAU * 12.0);
        let mut observers = Both::new(NOMINAL, g as f32, g as f32);
        let position = |k: i32| 1e-3 * (omega * f64::from(k) * 1e-3).sin();
        let (mut re, mut im, mut samples) = (0.0, 0.0, 0.0);
        for k in 1..=3000 {
            let forces = observers.step((position(k) - position(k - 1)) as f32, Current(0.0));
            // Whole periods only: 12 Hz fits three times into 250 samples.
            if k > 500 {
                let phase = omega * f64::from(k) * 1e-3;
                re += f64::from(forces.reaction_force.0) * phase.sin();
                im += f64::from(forces.reaction_force.0) * phase.cos();
                samples += 0.5;
            }
        }
        let (re, im): (f64, f64) = (re / samples, im / samples);
        // −m (jω)² (g / (jω + g))² · 1 mm
        let gain = 0.059 * omega * omega * (g * g / (g * g + omega * omega)) * 1e-3;
        let phase = -2.0 * (omega / g).atan();
        assert!((re.hypot(im) / gain - 1.0).abs() < 1e-3);
        assert!((im.atan2(re) - phase).to_degrees().abs() < 0.5);
    }
}
