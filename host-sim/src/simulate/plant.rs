//! The simulated plant: what is really there.
//!
//! A machine in [`Motion`] under the held current, the forces from outside and friction, behind an
//! amplifier that keeps its own limit; the encoder rounds to whole counts and wraps. Where it has a brake,
//! this holds the actuator while the amplifier is off.

use crate::chain::Chain;
use crate::drive::PlantFile;
use crate::error::{Error, Result};
use crate::linear::zoh::zero_order_hold;
use crate::machine::motion::PARTS;
use crate::machine::{ExternalForce, Mechanics, Motion};
use nalgebra::DVector;

/// Where the loads are at rest under the steady forces while the actuator is held at the origin: each spring
/// carries what pulls at the masses beyond it.
fn hanging(chain: &Chain, forces: &[ExternalForce]) -> DVector<f64> {
    let mut state = DVector::zeros(chain.states());
    let mut position = 0.0;
    for load in 1..=chain.loads() {
        let beyond = forces
            .iter()
            .filter(|force| force.steady() && force.mass >= load);
        let pull: f64 = beyond.map(|force| force.newton).sum();
        // A broken spring carries nothing.
        if chain.stiffness[load - 1] > 0.0 {
            position += pull / chain.stiffness[load - 1];
        }
        state[2 * load] = position;
    }
    state
}

/// A plant in motion.
#[derive(Clone, Debug)]
pub struct Plant {
    chain: Chain,
    current_limit: f64,
    resolution: f64,
    counter_mask: u32,
    /// Each with the response over one part of a period to 1 N of it.
    forces: Vec<(ExternalForce, DVector<f64>)>,
    part: f64,
    motion: Motion,
    /// Whether there is a brake.
    brake: bool,
    /// Whether the amplifier is on.
    enabled: bool,
    /// State in which it hangs under the steady forces, the actuator held.
    hanging: DVector<f64>,
    /// Parts of periods that have passed.
    parts: u64,
}

impl Plant {
    /// A plant at rest at the origin, its loads where steady forces pull them; amplifier off.
    ///
    /// * `period`: of the control, s
    #[must_use]
    pub fn new(file: &PlantFile, period: f64) -> Self {
        let mechanics = Mechanics::new(&file.actuator, &file.loads, &file.friction);
        let chain = mechanics.chain.clone();
        let part = period / f64::from(PARTS);
        let a = chain.a();
        let forces = file.forces.iter().map(|force| {
            let (_, response) = zero_order_hold(&a, &chain.force_input(force.mass), part);
            (force.clone(), response)
        });
        let hanging = hanging(&chain, &file.forces);
        let mut motion = Motion::new(&mechanics, period);
        motion.state_mut().copy_from(&hanging);
        Self {
            current_limit: file.actuator.current_limit,
            resolution: file.encoder.resolution,
            counter_mask: u32::MAX >> (32 - file.encoder.counter_bits),
            forces: forces.collect(),
            part,
            motion,
            brake: file.actuator.brake,
            enabled: false,
            hanging,
            parts: 0,
            chain,
        }
    }

    /// The amplifier is switched on or off, and with it the brake.
    pub fn enable(&mut self, enabled: bool) {
        self.enabled = enabled;
    }

    /// The chain that is simulated.
    #[must_use]
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// State `x_a v_a x_1 v_1 …`, m and m/s.
    #[must_use]
    pub fn state(&self) -> &DVector<f64> {
        self.motion.state()
    }

    /// Puts the plant into a state.
    pub fn set_state(&mut self, state: DVector<f64>) {
        *self.motion.state_mut() = state;
    }

    /// Puts the plant into a state that is given without the steady forces, which then act as well.
    pub fn start_from(&mut self, state: &DVector<f64>) {
        self.set_state(state + &self.hanging);
    }

    /// Where the encoder really is, counts from the origin.
    #[must_use]
    pub fn place(&self) -> i64 {
        (self.state()[0] / self.resolution).round() as i64
    }

    /// Encoder counter as the hardware would show it.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.place() as u32 & self.counter_mask
    }

    /// Force between actuator and load, positive when the load holds the actuator back, N.
    #[must_use]
    pub fn reaction_force(&self) -> f64 {
        (self.chain.reaction_force() * self.state()).x
    }

    /// One control period under a held current, A. The amplifier keeps its own limit.
    ///
    /// # Errors
    /// [`Error::Simulation`] when the motion is no longer finite.
    pub fn advance(&mut self, current: f64) -> Result<()> {
        let current = current.clamp(-self.current_limit, self.current_limit);
        let motor = current * self.chain.force_constant;
        let held = self.brake && !self.enabled;
        let begin = self.parts as f64 * self.part;
        let end = begin + f64::from(PARTS) * self.part;
        let acts = |force: &ExternalForce| {
            force.newton != 0.0 && force.start < end && begin < force.start + force.duration
        };
        let motion = &mut self.motion;
        motion.brake(held);
        let place = motion.state()[0];
        if held || self.forces.iter().any(|(force, _)| acts(force)) {
            let (forces, parts, length) = (&self.forces, self.parts, self.part);
            motion.in_parts(motor, |part, _, state| {
                let begin = (parts + u64::from(part)) as f64 * length;
                for (force, response) in forces {
                    // The mean over the part, so that no force loses its momentum.
                    let until = (force.start + force.duration).min(begin + length);
                    let share = (until - force.start.max(begin)) / length;
                    if share > 0.0 {
                        state.axpy(share * force.newton, response, 1.0);
                    }
                }
            });
        } else {
            motion.advance(motor);
        }
        self.parts += u64::from(PARTS);
        if held {
            // The brake holds to the last digit.
            let state = self.motion.state_mut();
            (state[0], state[1]) = (place, 0.0);
        }
        if self.state().iter().all(|x| x.is_finite()) {
            Ok(())
        } else {
            Err(Error::Simulation(
                "the plant's motion is no longer finite".into(),
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;
    use crate::machine::Friction;

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
            .map(|(i, m)| m * plant.state()[2 * i + element]);
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
            ..Friction::default()
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
        assert_eq!(plant.state()[0], 0.0);
        for _ in 0..100 {
            plant.advance(1.5 / 6.43).unwrap();
        }
        let velocity = centre_of_mass(&plant, 1);
        assert!(
            (velocity / (1.0 * 0.1 / total) - 1.0).abs() < 1e-3,
            "{velocity}"
        );
        let mut stopped_after = 0;
        while plant.state()[1] != 0.0 && stopped_after < 1000 {
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
                ..Friction::default()
            };
        });
        let mut in_steps = at_once.clone();
        for _ in 0..100 {
            at_once.advance(1.0).unwrap();
            in_steps.motion.in_parts(6.43, |_, _, _| ());
        }
        assert!((at_once.state() - in_steps.state()).amax() < 1e-11);
        assert!(at_once.state()[1] > 0.1 && at_once.motion.at_once(6.43));
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
        assert!((plant.state()[1] / expected - 1.0).abs() < 1e-3);
    }

    /// Under gravity the loads hang still from a braked actuator, the springs carry what hangs from them,
    /// and when the brake opens all fall at the same rate.
    #[test]
    fn a_brake_holds_what_hangs() {
        let weights = [0.059, 0.019, 0.019, 0.019].map(|mass| -9.81 * mass);
        let mut plant = plant(|file| {
            file.actuator.brake = true;
            file.forces = weights
                .iter()
                .enumerate()
                .map(|(mass, newton)| ExternalForce {
                    mass,
                    start: 0.0,
                    duration: 100.0,
                    newton: *newton,
                })
                .collect();
        });
        let before = plant.state().clone();
        let first = -9.81 * 3.0 * 0.019 / 300.0;
        assert!((before[2] - first).abs() < 1e-12, "{before}");
        for _ in 0..200 {
            plant.advance(1.0).unwrap();
        }
        assert!((plant.state() - &before).amax() < 1e-9, "{}", plant.state());
        plant.enable(true);
        for _ in 0..50 {
            plant.advance(0.0).unwrap();
        }
        assert!((centre_of_mass(&plant, 1) + 9.81 * 0.05).abs() < 1e-9);
        let falling = plant.state()[0];
        plant.enable(false);
        plant.advance(0.0).unwrap();
        assert_eq!((plant.state()[0], plant.state()[1]), (falling, 0.0));
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
        for bits in 2..=32 {
            let mut plant = self::plant(|file| file.encoder.counter_bits = bits);
            let mut state = DVector::zeros(8);
            state[0] = -1.6e-6;
            plant.set_state(state);
            assert_eq!(u64::from(plant.count()), (1 << bits) - 2);
        }
        let (mut asked, mut limited) = (self::plant(|_| {}), self::plant(|_| {}));
        asked.advance(50.0).unwrap();
        limited.advance(2.0).unwrap();
        assert_eq!(asked.state(), limited.state());
    }
}
