//! Rigid moves: every mass follows the same motion, as if the chain were one body.
//!
//! Positions are relative to the target: the move ends at zero, exactly.
//!
//! * A *step* is the target's own affair, as in the paper's experiments: the reference is at zero.
//! * A *move* is a symmetric jerk-limited profile (seven phases at most): jerk, constant
//!   acceleration, jerk, constant velocity, and the same backwards. The durations of the phases
//!   are whole control periods, rounded up, and the jerk is then set so that the distance is
//!   exact; rounding up keeps velocity, acceleration and jerk within their limits. With the
//!   durations `T_j, T_a, T_v` and the jerk `j`:
//!
//! ```text
//! peak velocity v = j T_j (T_j + T_a)        distance = v (2 T_j + T_a + T_v)
//! ```
//!
//! The feed-forward current is what accelerates the sum of the masses,
//! `i_ff = M (v_{k+1} − v_k) / (T k_f)`: held over the period it gives the next velocity exactly.

use super::Reference;
use crate::check::{SettingsError, positive};
use crate::units::{Current, Position, Velocity};
use serde::{Deserialize, Serialize};

/// Limits of a jerk-limited move; read `rad` for `m` on a rotary drive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionLimits {
    /// m/s
    pub velocity: f32,
    /// m/s²
    pub acceleration: f32,
    /// m/s³
    pub jerk: f32,
    /// Mass that the feed-forward accelerates: actuator and all loads, kg.
    pub total_mass: f32,
}

impl MotionLimits {
    pub(crate) fn check(&self) -> Result<(), SettingsError> {
        positive("motion.velocity", self.velocity)?;
        positive("motion.acceleration", self.acceleration)?;
        positive("motion.jerk", self.jerk)?;
        positive("motion.total_mass", self.total_mass)
    }
}

/// The longest half of a move, in periods: up to here `f32` counts them exactly.
const LONGEST: f32 = 8_388_608.0;

/// Coefficients of the generator of rigid references.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMoves {
    limits: MotionLimits,
    sample_time: f32,
    /// `M / (T k_f)`, A s/m.
    current_per_velocity: f32,
}

/// The move under way; the default is at rest at the target.
#[derive(Clone, Copy, Debug, Default)]
pub struct Memory {
    profile: Option<Profile>,
    tick: u32,
}

/// A planned move.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Profile {
    distance: f32,
    jerk: f32,
    /// Durations of the phases, in periods.
    jerk_ticks: u32,
    acceleration_ticks: u32,
    velocity_ticks: u32,
}

impl RigidMoves {
    /// * `limits`: of the moves
    /// * `force_constant`: `k_f`, N/A
    /// * `sample_time`: s
    #[must_use]
    pub fn new(limits: MotionLimits, force_constant: f32, sample_time: f32) -> Self {
        Self {
            limits,
            sample_time,
            current_per_velocity: limits.total_mass / (sample_time * force_constant),
        }
    }

    /// Plans a move from rest to a target at that distance; `false` when the move would not be finite or
    /// would take longer than can be counted.
    pub fn move_by(&self, memory: &mut Memory, distance: Position) -> bool {
        let distance = distance.0;
        if distance == 0.0 {
            return true;
        }
        let profile = self.plan(distance);
        if profile.is_some() {
            memory.profile = profile;
            memory.tick = 0;
        }
        profile.is_some()
    }

    /// Whether a move is under way.
    #[must_use]
    pub fn moving(&self, memory: &Memory) -> bool {
        memory.profile.is_some()
    }

    /// The reference of this period; the next call gives that of the next.
    pub fn step<const N: usize>(&self, memory: &mut Memory) -> Reference<N> {
        let Some(profile) = memory.profile else {
            return Reference::default();
        };
        let (position, velocity) = profile.at(memory.tick, self.sample_time);
        let (_, next) = profile.at(memory.tick + 1, self.sample_time);
        let reference = Reference::rigid(
            Position(position),
            Velocity(velocity),
            Current((next - velocity) * self.current_per_velocity),
        );
        memory.tick += 1;
        if memory.tick >= profile.ticks() {
            memory.profile = None;
        }
        reference
    }

    fn plan(&self, distance: f32) -> Option<Profile> {
        let MotionLimits {
            velocity,
            acceleration,
            jerk,
            ..
        } = self.limits;
        let length = distance.abs();

        // Time optimum without rounding: the jerk phase ends at the first of the limits of
        // acceleration, velocity and distance.
        let jerk_time = (acceleration / jerk)
            .min(libm::sqrtf(velocity / jerk))
            .min(libm::powf(length / (2.0 * jerk), 1.0 / 3.0));
        // Jerk phase and constant acceleration together, from a (T_j + T_a)(2 T_j + T_a) = D.
        let by_distance =
            0.5 * (libm::sqrtf(jerk_time * jerk_time + 4.0 * length / acceleration) - jerk_time);
        let acceleration_time = (velocity / acceleration).min(by_distance) - jerk_time;
        let peak_velocity = jerk * jerk_time * (jerk_time + acceleration_time.max(0.0));
        let velocity_time = length / peak_velocity - (2.0 * jerk_time + acceleration_time.max(0.0));

        let ticks = |time: f32| {
            // What is less than a thousandth of a period above is rounding.
            let ticks = libm::ceilf(time.max(0.0) / self.sample_time - 1e-3);
            (ticks <= LONGEST).then_some(ticks.max(0.0))
        };
        let t_j = ticks(jerk_time)?.max(1.0);
        let t_a = ticks(acceleration_time)?;
        let t_v = ticks(velocity_time)?;
        if 2.0 * (2.0 * t_j + t_a) + t_v > LONGEST {
            return None;
        }
        let t = self.sample_time;
        let jerk = distance / (t_j * t * ((t_j + t_a) * t) * ((2.0 * t_j + t_a + t_v) * t));
        jerk.is_finite().then_some(Profile {
            distance,
            jerk,
            jerk_ticks: t_j as u32,
            acceleration_ticks: t_a as u32,
            velocity_ticks: t_v as u32,
        })
    }
}

impl Profile {
    fn ticks(&self) -> u32 {
        2 * (2 * self.jerk_ticks + self.acceleration_ticks) + self.velocity_ticks
    }

    /// Position from the target and velocity after `tick` periods. The second half is the first
    /// one backwards, so that both ends are exact.
    fn at(&self, tick: u32, sample_time: f32) -> (f32, f32) {
        let ticks = self.ticks();
        let tick = tick.min(ticks);
        if 2 * tick > ticks {
            let (position, velocity) = self.first_half(ticks - tick, sample_time);
            (-position, velocity)
        } else {
            let (position, velocity) = self.first_half(tick, sample_time);
            (position - self.distance, velocity)
        }
    }

    fn first_half(&self, tick: u32, sample_time: f32) -> (f32, f32) {
        let (mut position, mut velocity, mut acceleration) = (0.0_f32, 0.0_f32, 0.0_f32);
        let mut left = tick;
        for (duration, jerk) in [
            (self.jerk_ticks, self.jerk),
            (self.acceleration_ticks, 0.0),
            (self.jerk_ticks, -self.jerk),
            (self.velocity_ticks, 0.0),
        ] {
            let ticks = left.min(duration);
            let t = ticks as f32 * sample_time;
            position += t * (velocity + t * (acceleration / 2.0 + t * jerk / 6.0));
            velocity += t * (acceleration + t * jerk / 2.0);
            acceleration += t * jerk;
            left -= ticks;
        }
        (position, velocity)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const T: f32 = 1e-3;
    const LIMITS: MotionLimits = MotionLimits {
        velocity: 0.5,
        acceleration: 20.0,
        jerk: 1000.0,
        total_mass: 0.116,
    };

    fn positions(limits: MotionLimits, distance: f32) -> Vec<Reference<1>> {
        let moves = RigidMoves::new(limits, 6.43, T);
        let mut memory = Memory::default();
        assert!(moves.move_by(&mut memory, Position(distance)));
        let mut path = Vec::new();
        while moves.moving(&memory) {
            path.push(moves.step(&mut memory));
        }
        path.push(moves.step(&mut memory));
        path
    }

    /// 1 m at 0.5 m/s, 20 m/s², 1000 m/s³: jerk for 20 ms, acceleration for 5 ms, velocity for 1.955 s.
    #[test]
    fn a_long_move_reaches_its_velocity_limit() {
        let path = positions(LIMITS, 1.0);
        assert_eq!(path.len() - 1, 2 * (2 * 20 + 5) + 1955);
        let peak = path.iter().map(|s| s.velocity.0).fold(0.0, f32::max);
        assert!((peak - 0.5).abs() < 1e-5);
        assert_eq!(path[0].position.0, -1.0);
        assert_eq!(path.last().unwrap().position.0, 0.0);
    }

    /// The feed-forward current is the total mass times the exact acceleration, so that the
    /// rigid drive driven by it follows the reference.
    #[test]
    fn feed_forward_moves_a_rigid_drive_along_the_reference() {
        let path = positions(LIMITS, 0.03);
        let (mut x, mut v) = (-0.03_f64, 0.0_f64);
        for reference in &path {
            // Between samples the acceleration is held: position lags by up to j T² T_j / 12.
            assert!(
                (x - f64::from(reference.position.0)).abs() < 1000.0 * 1e-6 * 0.02 / 12.0 + 2e-7
            );
            assert!((v - f64::from(reference.velocity.0)).abs() < 1e-6);
            let a = f64::from(reference.feed_forward.0) * 6.43 / 0.116;
            x += v * 1e-3 + 0.5 * a * 1e-6;
            v += a * 1e-3;
        }
        assert!(x.abs() < 2e-7 && v.abs() < 1e-6);
    }

    #[test]
    fn a_move_that_cannot_be_counted_is_refused() {
        let moves = RigidMoves::new(LIMITS, 6.43, T);
        for distance in [f32::NAN, f32::INFINITY, 1e30, -1e9] {
            let mut memory = Memory::default();
            assert!(
                !moves.move_by(&mut memory, Position(distance)),
                "{distance}"
            );
            assert_eq!(moves.step::<1>(&mut memory), Reference::default());
        }
    }

    proptest! {
        /// From below one encoder count to metres: exact arrival, monotonic, within the limits.
        #[test]
        fn moves_keep_their_limits(
            exponent in -6.5_f32..0.7,
            negative: bool,
            velocity in 0.01_f32..3.0,
            acceleration in 0.1_f32..100.0,
            jerk in 1.0_f32..1e5,
        ) {
            let length = 10_f32.powf(exponent);
            let distance = if negative { -length } else { length };
            let limits = MotionLimits { velocity, acceleration, jerk, total_mass: 1.0 };
            let moves = RigidMoves::new(limits, 1.0, T);
            let profile = moves.plan(distance).unwrap();
            // 1e-3 of a period is what `ticks` calls rounding; T_j is one period at least.
            let slack = 1.004;
            let (t_j, t_a) = (profile.jerk_ticks as f32 * T, profile.acceleration_ticks as f32 * T);
            prop_assert!(profile.jerk.abs() <= jerk * slack);
            prop_assert!(profile.jerk.abs() * t_j <= acceleration * slack);
            prop_assert!(profile.jerk.abs() * t_j * (t_j + t_a) <= velocity * slack);

            let ticks = profile.ticks();
            prop_assert_eq!(profile.at(0, T), (-distance, 0.0));
            prop_assert_eq!(profile.at(ticks, T), (0.0, 0.0));
            let stride = (ticks / 1000).max(1);
            let mut last = -distance;
            for tick in (0..=ticks).step_by(stride as usize) {
                let (position, _) = profile.at(tick, T);
                let forward = if negative { last - position } else { position - last };
                prop_assert!(forward >= -1e-6 * length);
                last = position;
            }
        }
    }
}
