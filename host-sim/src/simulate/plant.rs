//! The simulated plant: what is really there.
//!
//! A machine in [`Motion`] under the held current, the forces from outside and friction, behind an
//! amplifier that keeps its own limit; the encoder rounds to whole counts and wraps. Where it has a brake,
//! this holds the actuator while the amplifier is off.
//!
//! Cogging and backlash are forces over a part of a period, the mean over it each: the chain has every spring
//! and damper, and a gap takes back what they do not carry. Outside of the gap that is a constant force.

use crate::chain::Chain;
use crate::drive::{MAX_LOADS, PlantFile};
use crate::error::{Error, Result};
use crate::linear::zoh::zero_order_hold;
use crate::machine::motion::PARTS;
use crate::machine::{ExternalForce, Mechanics, Motion, Wave};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Of the encoder's noise: the same in every run.
const SEED: u64 = 1;
/// Times that the motion over a part is found again under the forces that follow from it.
const ROUNDS: usize = 4;

/// Where the loads are at rest under the steady forces while the actuator is held at the origin: each spring
/// carries what pulls at the masses beyond it.
fn hanging(chain: &Chain, gaps: &[Gap], forces: &[ExternalForce]) -> DVector<f64> {
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
            if pull != 0.0 {
                let gap = gaps.iter().find(|gap| gap.inner == 2 * load - 2);
                position += gap.map_or(0.0, |gap| gap.half.copysign(pull));
            }
        }
        state[2 * load] = position;
    }
    state
}

/// A gap at a spring.
#[derive(Clone, Debug)]
struct Gap {
    /// Positions in the state of the masses beside it.
    inner: usize,
    outer: usize,
    stiffness: f64,
    damping: f64,
    /// m to each side.
    half: f64,
    /// Response over a part to 1 N on the inner mass and -1 N on the outer one, and to as much rising over the part
    /// from -1/2 N to 1/2 N.
    response: DVector<f64>,
    rising: DVector<f64>,
}

impl Gap {
    /// Force that spring and damper of the chain have beyond what they carry over the gap, N, towards the outer
    /// mass positive. No contact pulls.
    fn beyond(&self, state: impl Fn(usize) -> f64) -> f64 {
        let stretch = state(self.inner) - state(self.outer);
        let rate = state(self.inner + 1) - state(self.outer + 1);
        let side = stretch.signum();
        let pressed = self.stiffness * (stretch - side * self.half) + self.damping * rate;
        let carried = if stretch.abs() <= self.half {
            0.0
        } else {
            side * (side * pressed).max(0.0)
        };
        self.stiffness * stretch + self.damping * rate - carried
    }
}

/// Response over some time to an input that rises from -1/2 to 1/2.
fn rising(a: &DMatrix<f64>, b: &DVector<f64>, time: f64) -> DVector<f64> {
    let n = b.len();
    let mut augmented = DMatrix::zeros(n + 1, n + 1);
    augmented.view_mut((0, 0), (n, n)).copy_from(a);
    augmented.view_mut((0, n), (n, 1)).copy_from(b);
    let mut slope = DVector::zeros(n + 1);
    slope[n] = 1.0 / time;
    let (transition, response) = zero_order_hold(&augmented, &slope, time);
    response.rows(0, n) - transition.view((0, n), (n, 1)) * 0.5
}

/// What acts on a plant besides its motor, over parts of a period.
#[derive(Clone, Debug)]
struct Surroundings {
    /// Each with the response over one part of a period to 1 N of it.
    forces: Vec<(ExternalForce, DVector<f64>)>,
    cogging: Wave,
    /// To 1 N on the actuator over a part.
    response: DVector<f64>,
    gaps: Vec<Gap>,
    /// s.
    part: f64,
}

impl Surroundings {
    fn new(file: &PlantFile, chain: &Chain, part: f64) -> Self {
        let a = chain.a();
        let response = |mass: usize| zero_order_hold(&a, &chain.force_input(mass), part).1;
        let forces = file.forces.iter();
        let forces = forces.map(|force| (force.clone(), response(force.mass)));
        let gaps = file.imperfections.backlash.iter().enumerate();
        let gaps = gaps
            .filter(|(_, gap)| **gap > 0.0)
            .map(|(spring, gap)| Gap {
                inner: 2 * spring,
                outer: 2 * spring + 2,
                stiffness: chain.stiffness[spring],
                damping: chain.damping[spring],
                half: 0.5 * gap,
                response: response(spring) - response(spring + 1),
                rising: rising(
                    &a,
                    &(chain.force_input(spring) - chain.force_input(spring + 1)),
                    part,
                ),
            });
        Self {
            forces: forces.collect(),
            cogging: file.imperfections.cogging,
            response: response(0),
            gaps: gaps.collect(),
            part,
        }
    }

    /// Whether anything acts between two times, s.
    fn act(&self, begin: f64, end: f64) -> bool {
        let acts = |force: &ExternalForce| {
            force.newton != 0.0 && force.start < end && begin < force.start + force.duration
        };
        self.cogging.amplitude != 0.0
            || !self.gaps.is_empty()
            || self.forces.iter().any(|(force, _)| acts(force))
    }

    /// What they do over a part that begins at a time, s.
    fn add(&self, begin: f64, before: &DVector<f64>, state: &mut DVector<f64>) {
        for (force, response) in &self.forces {
            // The mean over the part, so that no force loses its momentum.
            let until = (force.start + force.duration).min(begin + self.part);
            let share = (until - force.start.max(begin)) / self.part;
            if share > 0.0 {
                state.axpy(share * force.newton, response, 1.0);
            }
        }
        if self.cogging.amplitude == 0.0 && self.gaps.is_empty() {
            return;
        }
        let mut cogging = 0.0;
        let mut taken = [(0.0, 0.0); MAX_LOADS];
        for _ in 0..ROUNDS {
            let force = -self.cogging.at(self.mean(0, before, state));
            state.axpy(force - cogging, &self.response, 1.0);
            cogging = force;
            for (gap, taken) in self.gaps.iter().zip(&mut taken) {
                let mean = gap.beyond(|element| self.mean(element, before, state));
                let change =
                    gap.beyond(|element| state[element]) - gap.beyond(|element| before[element]);
                state.axpy(mean - taken.0, &gap.response, 1.0);
                state.axpy(change - taken.1, &gap.rising, 1.0);
                *taken = (mean, change);
            }
        }
    }

    /// Mean of an element of the state over a part, from those at its ends: a position by the cubic through both,
    /// a velocity by the way.
    fn mean(&self, element: usize, before: &DVector<f64>, after: &DVector<f64>) -> f64 {
        if element % 2 == 1 {
            return (after[element - 1] - before[element - 1]) / self.part;
        }
        let change = after[element + 1] - before[element + 1];
        0.5 * (before[element] + after[element]) - change * self.part / 12.0
    }
}

/// What the encoder makes of a position.
#[derive(Clone, Debug)]
struct Reading {
    resolution: f64,
    counter_mask: u32,
    eccentricity: Wave,
    /// Of the noise, m.
    deviation: f64,
    random: ChaCha8Rng,
    /// Noise in this period, m.
    noise: f64,
}

impl Reading {
    fn new(file: &PlantFile) -> Self {
        let mut reading = Self {
            resolution: file.encoder.resolution,
            counter_mask: u32::MAX >> (32 - file.encoder.counter_bits),
            eccentricity: file.imperfections.eccentricity,
            deviation: file.imperfections.noise,
            random: ChaCha8Rng::seed_from_u64(SEED),
            noise: 0.0,
        };
        reading.look();
        reading
    }

    /// Draws the noise of a period, Gaussian after Box and Muller.
    fn look(&mut self) {
        if self.deviation > 0.0 {
            let (u, turn): (f64, f64) = (
                self.random.random_range(f64::MIN_POSITIVE..1.0),
                self.random.random_range(0.0..std::f64::consts::TAU),
            );
            self.noise = self.deviation * (-2.0 * u.ln()).sqrt() * turn.cos();
        }
    }

    /// Counts from the origin.
    fn counts(&self, position: f64) -> i64 {
        let read = position + self.eccentricity.at(position) + self.noise;
        nearest(read / self.resolution)
    }
}

/// The nearest whole number, halves away from zero: as `f64::round`, which is a call on a PC that need not have an
/// instruction for it.
fn nearest(x: f64) -> i64 {
    let whole = x as i64;
    let rest = x - whole as f64;
    whole.saturating_add(i64::from(rest >= 0.5) - i64::from(rest <= -0.5))
}

/// A plant in motion.
#[derive(Clone, Debug)]
pub struct Plant {
    chain: Chain,
    current_limit: f64,
    reading: Reading,
    surroundings: Surroundings,
    motion: Motion,
    /// Whether there is a brake.
    brake: bool,
    /// Whether the amplifier is on.
    enabled: bool,
    /// Where a stop is that the actuator does not pass downwards, m.
    stop: Option<f64>,
    /// State in which it hangs under the steady forces, the actuator held.
    hanging: DVector<f64>,
    /// Parts of periods that have passed.
    parts: u64,
}

impl Plant {
    /// A plant at rest at the origin, its loads where steady forces pull them, its motor's force, should it come
    /// late, what has held it there; amplifier off.
    ///
    /// * `period`: of the control, s
    #[must_use]
    pub fn new(file: &PlantFile, period: f64) -> Self {
        let mechanics = Mechanics::new(&file.actuator, &file.loads, &file.friction);
        let chain = mechanics.chain.clone();
        let surroundings = Surroundings::new(file, &chain, period / f64::from(PARTS));
        let hanging = hanging(&chain, &surroundings.gaps, &file.forces);
        let mut motion = Motion::new(&mechanics, period);
        motion.state_mut().copy_from(&hanging);
        // What has held it there.
        let steady = file.forces.iter().filter(|force| force.steady());
        motion.hold(-steady.map(|force| force.newton).sum::<f64>());
        Self {
            current_limit: file.actuator.current_limit,
            reading: Reading::new(file),
            surroundings,
            motion,
            brake: file.actuator.brake,
            enabled: false,
            stop: None,
            hanging,
            parts: 0,
            chain,
        }
    }

    /// The amplifier is switched on or off, and with it the brake.
    pub fn enable(&mut self, enabled: bool) {
        self.enabled = enabled;
    }

    /// Puts a stop there that the actuator does not pass downwards, m: where it would have at the end of a period, it
    /// stands there. It gives nothing and throws nothing back.
    pub fn stop_at(&mut self, position: f64) {
        self.stop = Some(position);
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

    /// What the encoder reads, counts from the origin.
    #[must_use]
    pub fn place(&self) -> i64 {
        self.reading.counts(self.state()[0])
    }

    /// Encoder counter as the hardware would show it.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.place() as u32 & self.reading.counter_mask
    }

    /// Force between actuator and load, positive when the load holds the actuator back, N.
    #[must_use]
    pub fn reaction_force(&self) -> f64 {
        let state = self.state();
        let (stiffness, damping) = (self.chain.stiffness[0], self.chain.damping[0]);
        let mut force =
            stiffness * state[0] + damping * state[1] - stiffness * state[2] - damping * state[3];
        if let Some(gap) = self.surroundings.gaps.first().filter(|gap| gap.inner == 0) {
            force -= gap.beyond(|element| self.state()[element]);
        }
        force
    }

    /// One control period under a held current, A. The amplifier keeps its own limit.
    ///
    /// # Errors
    /// [`Error::Simulation`] when the motion is no longer finite.
    pub fn advance(&mut self, current: f64) -> Result<()> {
        self.advance_for(current, PARTS)
    }

    /// Some parts of a control period, each a twentieth: a period that is longer or shorter.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    #[inline]
    pub fn advance_for(&mut self, current: f64, parts: u32) -> Result<()> {
        let current = current.clamp(-self.current_limit, self.current_limit);
        let motor = current * self.chain.force_constant;
        let held = self.brake && !self.enabled;
        let (surroundings, passed) = (&self.surroundings, self.parts);
        let begin = passed as f64 * surroundings.part;
        let end = begin + f64::from(parts) * surroundings.part;
        let motion = &mut self.motion;
        motion.brake(held);
        let place = motion.state()[0];
        if held || parts != PARTS || surroundings.act(begin, end) {
            motion.for_parts(motor, parts, |part, before, state| {
                let begin = (passed + u64::from(part)) as f64 * surroundings.part;
                surroundings.add(begin, before, state);
            });
        } else {
            motion.advance(motor);
        }
        self.parts += u64::from(parts);
        self.reading.look();
        if held {
            // The brake holds to the last digit.
            let state = self.motion.state_mut();
            (state[0], state[1]) = (place, 0.0);
        }
        if let Some(stop) = self.stop.filter(|stop| self.state()[0] < *stop) {
            let state = self.motion.state_mut();
            (state[0], state[1]) = (stop, state[1].max(0.0));
        }
        if self.state().as_slice().iter().all(|x| x.is_finite()) {
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

    /// An encoder off its axis reads a sine of the position too much.
    #[test]
    fn an_eccentric_encoder_reads_a_sine_too_much() {
        let mut plant = plant(|file| {
            file.imperfections.eccentricity = Wave {
                amplitude: 3e-4,
                pitch: 0.02,
            };
        });
        for position in [0.0, 0.005, 0.0123, -0.005, 0.31] {
            let mut state = DVector::zeros(8);
            state[0] = position;
            plant.set_state(state);
            let sine = (std::f64::consts::TAU * position / 0.02).sin();
            let expected = ((position + 3e-4 * sine) / 1e-6).round() as i64;
            assert_eq!(plant.place(), expected);
        }
    }

    /// Noise of 20 counts: that much rms over many periods, none on the average, and each run the same.
    #[test]
    fn noise_has_its_deviation_and_repeats() {
        let noisy = || plant(|file| file.imperfections.noise = 20e-6);
        let read = |mut plant: Plant| -> Vec<f64> {
            let read = (0..20_000).map(|_| {
                plant.advance(0.0).unwrap();
                plant.place() as f64
            });
            read.collect()
        };
        let counts = read(noisy());
        let mean = counts.iter().sum::<f64>() / 20_000.0;
        let square = counts.iter().map(|count| count.powi(2)).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 4.0 * 20.0 / 20_000_f64.sqrt(), "{mean}");
        // Rounding adds a twelfth.
        assert!(
            (square / (400.0 + 1.0 / 12.0) - 1.0).abs() < 0.04,
            "{square}"
        );
        let within = counts.iter().filter(|count| count.abs() < 20.0).count();
        assert!((within as f64 / 20_000.0 - 0.6827).abs() < 0.02, "{within}");
        assert_eq!(counts, read(noisy()));
        assert_eq!(noisy().count(), noisy().count());
    }

    /// A constant force comes to rest where cogging balances it, `F = A sin(2 pi x / p)`; around its rest the
    /// actuator swings with `omega^2 = 2 pi A / (p M)`, and energy stays.
    #[test]
    fn cogging_balances_a_force() {
        let cogging = Wave {
            amplitude: 2.0,
            pitch: 0.02,
        };
        let mut held = plant(|file| {
            file.imperfections.cogging = cogging;
            file.friction.viscous = 3.0;
        });
        for _ in 0..20_000 {
            held.advance(1.0 / 6.43).unwrap();
        }
        let expected = 0.02 / std::f64::consts::TAU * 0.5_f64.asin();
        let found = held.state()[0];
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");

        let mut free = plant(|file| {
            file.imperfections.cogging = cogging;
            file.loads.truncate(1);
            file.loads[0].mass = 1e-9;
            file.loads[0].stiffness = 1e-3;
            file.loads[0].damping = 1e-9;
        });
        free.set_state(DVector::from_row_slice(&[1e-5, 0.0, 1e-5, 0.0]));
        let omega = (std::f64::consts::TAU * 2.0 / (0.02 * 0.059)).sqrt();
        for period in 1..=500 {
            free.advance(0.0).unwrap();
            let expected = 1e-5 * (omega * f64::from(period) * 1e-3).cos();
            let far = (free.state()[0] - expected).abs();
            assert!(far < 2e-8, "{period}: {far}");
        }
    }

    #[test]
    fn the_nearest_whole_number_is_that_of_round() {
        let below_half = 0.5_f64.next_down();
        for x in [
            0.0,
            0.5,
            below_half,
            1.5,
            2.5,
            1e3 + 0.49,
            4503599627370497.5,
            9.3e18,
            1e300,
        ] {
            for x in [x, -x] {
                assert_eq!(nearest(x), x.round() as i64, "{x}");
            }
        }
        assert_eq!(nearest(f64::NAN), 0);
        assert_eq!(nearest(f64::INFINITY), i64::MAX);
    }

    /// With a gap the load stands until the actuator has crossed half of it, however fast; then it is taken
    /// along, and momentum is what the motor gave.
    #[test]
    fn a_gap_carries_nothing() {
        let gapped = || {
            plant(|file| {
                file.imperfections.backlash = vec![2e-3];
                file.loads.truncate(1);
                file.loads[0].stiffness = 2e4;
                file.loads[0].damping = 2.0;
            })
        };
        let mut pushed = gapped();
        let mut period = 0;
        while pushed.state()[0] < 0.99e-3 {
            assert!(pushed.state()[2].abs() < 1e-8, "{}", pushed.state());
            assert!(pushed.reaction_force().abs() < 1e-12);
            pushed.advance(0.1).unwrap();
            period += 1;
            let expected = 0.5 * 0.643 / 0.059 * (f64::from(period) * 1e-3).powi(2);
            if expected < 0.99e-3 {
                let far = pushed.state()[0] / expected - 1.0;
                assert!(far.abs() < 1e-4, "{period}: {far}");
            }
        }
        for _ in period..200 {
            pushed.advance(0.1).unwrap();
        }
        let momentum = centre_of_mass(&pushed, 1) * 0.078;
        assert!((momentum / (0.643 * 0.2) - 1.0).abs() < 1e-9, "{momentum}");
        assert!(pushed.state()[2] > 5e-3);

        // Pressed against a load that is held, the spring carries the motor's force beyond half the gap.
        let mut pressed = plant(|file| {
            file.imperfections.backlash = vec![2e-3];
            file.loads.truncate(1);
            file.loads[0].damping = 3.0;
            file.loads[0].coulomb = 1e3;
        });
        for _ in 0..2000 {
            pressed.advance(0.1).unwrap();
        }
        let expected = 1e-3 + 0.643 / 300.0;
        let found = pressed.state()[0] - pressed.state()[2];
        assert!((found / expected - 1.0).abs() < 1e-6, "{}", pressed.state());
        assert!(pressed.state()[2].abs() < 1e-6, "{}", pressed.state());
        assert!((pressed.reaction_force() - 0.643).abs() < 1e-6);
    }

    /// A load that hangs hangs lower by half the gap.
    #[test]
    fn a_gap_hangs_open() {
        let weight = ExternalForce {
            mass: 1,
            start: 0.0,
            duration: 100.0,
            newton: -0.3,
        };
        let mut plant = plant(|file| {
            file.actuator.brake = true;
            file.imperfections.backlash = vec![0.5e-3];
            file.forces.push(weight);
        });
        let before = plant.state().clone();
        assert!((before[2] + 0.3 / 300.0 + 0.25e-3).abs() < 1e-12);
        for _ in 0..200 {
            plant.advance(0.0).unwrap();
        }
        assert!((plant.state() - before).amax() < 1e-9);
    }

    /// A braked plant remembers what its motor is told: delay and lag go on while the actuator is held.
    #[test]
    fn a_brake_does_not_stop_a_late_force() {
        let mut plant = plant(|file| {
            file.actuator.brake = true;
            file.actuator.delay = 2.4e-3;
            file.actuator.lag = 1e-3;
        });
        for _ in 0..50 {
            plant.advance(0.2).unwrap();
        }
        assert_eq!(plant.state()[0], 0.0);
        plant.enable(true);
        plant.advance(0.2).unwrap();
        let momentum = centre_of_mass(&plant, 1) * 0.116;
        assert!((momentum / (0.2 * 6.43 * 1e-3) - 1.0).abs() < 1e-9);
    }

    /// A gap of 27 parts of a period under one current is as long as it is.
    #[test]
    fn parts_of_a_period_add_up() {
        let mut plant = plant(|_| {});
        plant.advance_for(0.5, 27).unwrap();
        plant.advance(0.5).unwrap();
        plant.advance_for(0.5, 13).unwrap();
        let expected = 0.5 * 6.43 / 0.116 * 3e-3;
        assert!((centre_of_mass(&plant, 1) / expected - 1.0).abs() < 1e-12);
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
