//! The simulated plant: what is really there.
//!
//! The chain is advanced exactly, the current held over the whole control period as an amplifier does:
//! in one step where nothing changes within the period, in twenty where an external force begins or
//! acts or the actuator may stick. Coulomb friction acts on the actuator and is resolved within each of
//! the twenty: the friction force is the one that would bring the actuator to a stop in this step, as
//! far as the Coulomb limit reaches (a time-stepping scheme after Moreau), so that sticking needs no
//! threshold velocity. The encoder rounds to whole counts and wraps.

use crate::design::discretise::zero_order_hold;
use crate::drive::{ExternalForce, PlantFile};
use crate::error::{Error, Result};
use crate::model::Chain;
use nalgebra::{DMatrix, DVector};

/// Steps per control period in which something changes.
pub const SUBSTEPS: u32 = 20;

/// A plant in motion.
#[derive(Clone, Debug)]
pub struct Plant {
    chain: Chain,
    current_limit: f64,
    resolution: f64,
    counter_mask: u32,
    coulomb: f64,
    forces: Vec<ExternalForce>,
    substep: f64,
    transition: DMatrix<f64>,
    /// Response over one substep to 1 N on each mass.
    force_response: Vec<DVector<f64>>,
    /// The same over the whole period, the response being that of the actuator.
    period_transition: DMatrix<f64>,
    period_response: DVector<f64>,
    state: DVector<f64>,
    substeps: u64,
}

impl Plant {
    /// A plant at rest at the origin.
    ///
    /// * `period`: of the control, s
    #[must_use]
    pub fn new(file: &PlantFile, period: f64) -> Self {
        let chain = Chain::new(&file.actuator, &file.loads, file.friction.viscous);
        let substep = period / f64::from(SUBSTEPS);
        let a = chain.a();
        let response = |mass| zero_order_hold(&a, &chain.force_input(mass), substep);
        let force_response = (0..chain.mass.len()).map(|mass| response(mass).1).collect();
        let (period_transition, period_response) =
            zero_order_hold(&a, &chain.force_input(0), period);
        Self {
            current_limit: file.actuator.current_limit,
            resolution: file.encoder.resolution,
            counter_mask: u32::MAX >> (32 - file.encoder.counter_bits),
            coulomb: file.friction.coulomb,
            forces: file.forces.clone(),
            substep,
            transition: response(0).0,
            force_response,
            period_transition,
            period_response,
            state: DVector::zeros(chain.states()),
            substeps: 0,
            chain,
        }
    }

    /// The chain that is simulated.
    #[must_use]
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// State `x_a v_a x_1 v_1 …`, m and m/s.
    #[must_use]
    pub fn state(&self) -> &DVector<f64> {
        &self.state
    }

    /// Puts the plant into a state.
    pub fn set_state(&mut self, state: DVector<f64>) {
        self.state = state;
    }

    /// Encoder counter as the hardware would show it.
    #[must_use]
    pub fn count(&self) -> u32 {
        (self.state[0] / self.resolution).round() as i64 as u32 & self.counter_mask
    }

    /// Force between actuator and load, positive when the load holds the actuator back, N.
    #[must_use]
    pub fn reaction_force(&self) -> f64 {
        (self.chain.reaction_force() * &self.state).x
    }

    /// One control period under a held current, A. The amplifier keeps its own limit.
    ///
    /// # Errors
    /// [`Error::Simulation`] when the motion is no longer finite.
    pub fn advance(&mut self, current: f64) -> Result<()> {
        let current = current.clamp(-self.current_limit, self.current_limit);
        let motor = current * self.chain.force_constant;
        match self.whole_period(motor) {
            Some(next) => {
                self.state = next;
                self.substeps += u64::from(SUBSTEPS);
            }
            None => self.in_substeps(motor),
        }
        if self.state.iter().all(|x| x.is_finite()) {
            Ok(())
        } else {
            Err(Error::Simulation(
                "the plant's motion is no longer finite".into(),
            ))
        }
    }

    /// The state after a period in which nothing changes: no external force acts, and the actuator is
    /// too fast for its direction to change, because its velocity is larger than its change.
    fn whole_period(&self, motor: f64) -> Option<DVector<f64>> {
        let begin = self.substeps as f64 * self.substep;
        let end = begin + f64::from(SUBSTEPS) * self.substep;
        let acts = |force: &ExternalForce| {
            force.newton != 0.0 && force.start < end && begin < force.start + force.duration
        };
        if self.forces.iter().any(acts) {
            return None;
        }
        let before = self.state[1];
        let force = motor - self.coulomb * before.signum();
        let mut next = &self.period_transition * &self.state;
        next.axpy(force, &self.period_response, 1.0);
        let change = (next[1] - before).abs();
        (self.coulomb == 0.0 || change < before.abs().min(next[1].abs())).then_some(next)
    }

    fn in_substeps(&mut self, motor: f64) {
        for _ in 0..SUBSTEPS {
            let begin = self.substeps as f64 * self.substep;
            let mut next = &self.transition * &self.state;
            next.axpy(motor, &self.force_response[0], 1.0);
            for force in &self.forces {
                // The mean over the step, so that no force loses its momentum.
                let until = (force.start + force.duration).min(begin + self.substep);
                let share = (until - force.start.max(begin)) / self.substep;
                if share > 0.0 {
                    let newton = share * force.newton;
                    next.axpy(newton, &self.force_response[force.mass], 1.0);
                }
            }
            if self.coulomb > 0.0 {
                let stopping = -next[1] / self.force_response[0][1];
                let friction = stopping.clamp(-self.coulomb, self.coulomb);
                next.axpy(friction, &self.force_response[0], 1.0);
            }
            self.state = next;
            self.substeps += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, Friction};

    fn plant(change: impl FnOnce(&mut PlantFile)) -> Plant {
        let mut file = PlantFile::from(&Drive::default_drive());
        change(&mut file);
        Plant::new(&file, 1e-3)
    }

    fn centre_of_mass(plant: &Plant, element: usize) -> f64 {
        let mass = &plant.chain.mass;
        let weighted = mass
            .iter()
            .enumerate()
            .map(|(i, m)| m * plant.state[2 * i + element]);
        weighted.sum::<f64>() / mass.iter().sum::<f64>()
    }

    /// Whatever the springs do, the centre of mass obeys Newton: x = F t² / 2 M.
    #[test]
    fn centre_of_mass_follows_the_force() {
        let mut plant = plant(|_| {});
        for _ in 0..300 {
            plant.advance(0.5).unwrap();
        }
        let expected = 0.5 * 0.5 * 6.43 / 0.116 * 0.3_f64.powi(2);
        assert!((centre_of_mass(&plant, 0) / expected - 1.0).abs() < 1e-12);
    }

    /// Force on a load, from 10 to 30 ms: the momentum is force times duration.
    #[test]
    fn external_force_gives_its_momentum() {
        // Whole periods, whole steps, and neither.
        for (start, duration) in [(0.01, 0.02), (0.010_05, 0.000_1), (0.010_03, 0.000_04)] {
            let force = ExternalForce {
                mass: 2,
                start,
                duration,
                newton: -3.0,
            };
            let mut plant = plant(|file| file.forces.push(force));
            for _ in 0..100 {
                plant.advance(0.0).unwrap();
            }
            assert!((centre_of_mass(&plant, 1) + 3.0 * duration / 0.116).abs() < 1e-12);
        }
    }

    /// Below the Coulomb force nothing moves; beyond it a rigid drive accelerates with what is
    /// left; without drive it decelerates by F/M and stays where it stopped.
    #[test]
    fn coulomb_friction_sticks_and_slides() {
        let friction = Friction {
            coulomb: 0.5,
            viscous: 0.0,
        };
        let mut plant = plant(|file| {
            file.friction = friction;
            file.loads.truncate(1);
            file.loads[0].stiffness = 1e6;
            file.loads[0].damping = 100.0;
        });
        let total = 0.059 + 0.019;
        for _ in 0..100 {
            plant.advance(0.4 / 6.43).unwrap();
        }
        assert_eq!(plant.state[0], 0.0);
        for _ in 0..100 {
            plant.advance(1.5 / 6.43).unwrap();
        }
        let velocity = centre_of_mass(&plant, 1);
        assert!(
            (velocity / (1.0 * 0.1 / total) - 1.0).abs() < 1e-3,
            "{velocity}"
        );
        let mut stopped_after = 0;
        while plant.state[1] != 0.0 && stopped_after < 1000 {
            plant.advance(0.0).unwrap();
            stopped_after += 1;
        }
        assert!((f64::from(stopped_after) * 1e-3 - velocity * total / 0.5).abs() < 3e-3);
    }

    /// One exact step over the period and twenty make the same motion, sliding under friction.
    #[test]
    fn a_period_at_once_is_a_period_in_steps() {
        let mut at_once = plant(|file| {
            file.friction = Friction {
                coulomb: 0.2,
                viscous: 0.3,
            };
        });
        let mut in_steps = at_once.clone();
        for _ in 0..100 {
            at_once.advance(1.0).unwrap();
            in_steps.in_substeps(6.43);
        }
        assert!((at_once.state() - in_steps.state()).amax() < 1e-11);
        assert!(at_once.state()[1] > 0.1 && at_once.whole_period(6.43).is_some());
    }

    /// Energy of the free undriven chain never grows, and viscous friction takes the momentum
    /// away at the rate of a first-order lag when the chain is nearly rigid.
    #[test]
    fn viscous_friction_is_a_first_order_lag_of_a_rigid_drive() {
        let mut plant = plant(|file| {
            file.friction.viscous = 0.5;
            file.loads.truncate(1);
            file.loads[0].stiffness = 1e6;
            file.loads[0].damping = 100.0;
        });
        plant.set_state(DVector::from_row_slice(&[0.0, 1.0, 0.0, 1.0]));
        for _ in 0..200 {
            plant.advance(0.0).unwrap();
        }
        let expected = (-0.5 * 0.2 / 0.078_f64).exp();
        assert!((plant.state[1] / expected - 1.0).abs() < 1e-3);
    }

    #[test]
    fn counter_wraps_and_current_is_limited() {
        let mut plant = plant(|_| {});
        let mut state = DVector::zeros(8);
        state[0] = -1.6e-6;
        plant.set_state(state.clone());
        assert_eq!(plant.count(), 0xFFFE);
        state[0] = 65_537e-6;
        plant.set_state(state);
        assert_eq!(plant.count(), 1);
        let (mut asked, mut limited) = (self::plant(|_| {}), self::plant(|_| {}));
        asked.advance(50.0).unwrap();
        limited.advance(2.0).unwrap();
        assert_eq!(asked.state, limited.state);
    }
}
