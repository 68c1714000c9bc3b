//! Whether the encoder stands still though a force acts that friction cannot hold.
//!
//! An actuator that stands within two counts is held by friction; friction holds against forces from
//! minus to plus its limit. Two forces are looked at: the motor's, and what the model does not explain
//! (disturbance and innovation of the state observer together). Where both are by more than that others
//! than when the encoder last moved, for as long as it takes such a force to move the whole machine
//! visibly, either the encoder is dead or something holds the actuator. What the springs pull while the load
//! swings is in the first alone, and what the model has wrong in the second; a static force that the drive
//! holds does not change.
//!
//! How much friction there is has been seen while the signs were proven, in one place of the axis; elsewhere
//! it may be three times that, and a few thousandths of the motor's force. The setting is the most that it
//! can be. A coarse encoder makes forces of its own: what a few counts look like proves nothing.

use super::Trip;
use crate::encoder::Reading;
use crate::fault::Fault;
use crate::units::{Current, Place};

/// Counts within which the encoder stands still.
const STILL: i64 = 2;
/// What friction may be elsewhere: times what was seen, and as a share of the motor's force.
const ELSEWHERE: f32 = 3.0;
const SHARE: f32 = 0.005;
/// Counts whose force is noise.
const NOISE: f32 = 4.0;
/// Periods that the motion takes to show, whatever the force.
const PERIODS: u32 = 5;

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stall {
    force_constant: f32,
    /// N
    most: f32,
    share: f32,
    noise: f32,
    /// Periods in which 1 N moves the whole machine visibly, squared.
    visible: f32,
}

/// Where the encoder was last seen to move, and the forces then.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    anchor: Place,
    forces: [f32; 2],
    /// For how many periods the forces have been others.
    changed: u32,
    /// N, and periods
    limit: f32,
    patience: u32,
}

impl Memory {
    /// With the limits of another one.
    pub(super) fn renew(&mut self, other: &Self) {
        (self.limit, self.patience) = (other.limit, other.patience);
    }
}

impl Stall {
    /// * `stiction`, `of_a_count`: the most of it, and what one count looks like, N
    /// * `total_mass`: of actuator and loads, kg
    /// * `sample_time`: s
    pub(super) fn new(
        force_constant: f32,
        resolution: f32,
        (stiction, of_a_count): (f32, f32),
        current_limit: f32,
        total_mass: f32,
        sample_time: f32,
    ) -> Self {
        Self {
            force_constant,
            most: stiction,
            share: SHARE * force_constant * current_limit,
            noise: NOISE * of_a_count,
            // Eight times as far as it takes to be seen: F t² / 2 M.
            visible: 16.0 * STILL as f32 * resolution * total_mass / (sample_time * sample_time),
        }
    }

    /// * `stiction`: what was seen, N
    /// * `holding_force`: of the motor and of what the observer explains it with from the start, N
    pub(super) fn begin(self, stiction: Option<f32>, holding_force: f32) -> Memory {
        let seen = stiction.map_or(self.most, |seen| ELSEWHERE * seen + self.share);
        let most = if seen < self.most { seen } else { self.most };
        let limit = (2.0 * most).max(self.noise);
        Memory {
            forces: [holding_force; 2],
            limit,
            patience: PERIODS + libm::sqrtf(self.visible / limit) as u32,
            ..Memory::default()
        }
    }

    /// Force of the motor at a current, N.
    pub(super) fn motor(self, current: Current) -> f32 {
        self.force_constant * current.0
    }

    /// * `forces`: the motor's, and what the model does not explain, N
    pub(super) fn step(
        memory: &mut Memory,
        reading: &Reading,
        forces: [f32; 2],
    ) -> Result<(), Trip> {
        let moved = reading.place.counts_from(memory.anchor).saturating_abs() > STILL;
        if moved {
            memory.anchor = reading.place;
            memory.forces = forces;
            memory.changed = 0;
            return Ok(());
        }
        let [motor, unexplained] = forces;
        let change = motor - memory.forces[0];
        let still_explained = (unexplained - memory.forces[1]).abs() <= memory.limit;
        if change.abs() <= memory.limit || still_explained {
            memory.changed = 0;
            return Ok(());
        }
        memory.changed = memory.changed.saturating_add(1);
        if memory.changed <= memory.patience {
            return Ok(());
        }
        Err(Trip {
            fault: Fault::Stalled,
            value: change,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Periods until it trips, of a second.
    fn trips(of_a_count: f32, unexplained: f32) -> Option<usize> {
        // 4.5 N, 10 um a count, 0.3 kg.
        let stall = Stall::new(2.25, 10e-6, (0.14, of_a_count), 2.0, 0.3, 1e-3);
        let mut memory = stall.begin(Some(0.0), 0.0);
        let reading = Reading {
            place: Place(0),
            displacement: 0.0,
            jump: false,
        };
        (0..1000).find(|_| Stall::step(&mut memory, &reading, [3.0, unexplained]).is_err())
    }

    #[test]
    fn what_a_few_counts_look_like_proves_nothing() {
        assert_eq!(trips(0.43, 1.5), None);
        assert!(trips(0.43, 1.8).is_some_and(|periods| periods < 50));
        // A finer encoder tells more.
        assert!(trips(0.004, 1.5).is_some());
        assert_eq!(trips(0.004, 0.04), None);
        assert!(trips(0.004, 0.05).is_some());
    }
}
