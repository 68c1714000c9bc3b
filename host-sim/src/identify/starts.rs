//! Where the search begins: around the drive file, and where the frequency response points.
//!
//! A user knows masses best and springs least, so the springs are varied; friction makes minima of its own,
//! so it is varied as well. Where the record excites more frequencies than there are unknowns, the machines
//! that fit its frequency response are tried too.

use super::frequency::{self, Point};
use super::{Experiment, Machine, Parameters, Quantity};
use crate::chain::Chain;

/// Factors on every spring.
const STIFFNESS: [f64; 5] = [1.0, 0.65, 0.8, 1.25, 1.5];
/// Factors on the mass of an actuator by itself.
const MASS: [f64; 3] = [1.0, 0.6, 1.6];
/// Coulomb friction, in shares of the motor's largest force.
const FRICTION: [f64; 3] = [0.0, 0.015, 0.05];

/// The machines to start from.
///
/// * `response`: empty where there is none
/// * `beside`: a machine whose chain is wrong, but not what it has beside it
pub(super) fn starts(
    parameters: &Parameters,
    beside: &Machine,
    response: &[Point],
    period: f64,
) -> Vec<Machine> {
    let force = parameters.force();
    let mut start = beside.clone();
    start.mechanics.chain = Chain {
        ground: beside.chain().ground.clone(),
        ..parameters.start().chain().clone()
    };
    let free = |quantity: Quantity| parameters.free().any(|free| free == quantity);
    let factors: &[f64] = match parameters.experiment() {
        Experiment::Excitation => &STIFFNESS,
        Experiment::Free | Experiment::Slow => &MASS,
    };
    let stated = start.friction().forward;
    let mut friction = vec![stated];
    if free(Quantity::Coulomb) {
        let others = FRICTION.iter().map(|share| share * force);
        friction.extend(others.filter(|other| (other - stated).abs() > 0.005 * force));
    }
    let mut result = Vec::new();
    for factor in factors {
        for coulomb in &friction {
            let mut machine = start.clone();
            let friction = machine.friction_mut();
            friction.backward += coulomb - friction.forward;
            friction.forward = *coulomb;
            if parameters.experiment() == Experiment::Excitation {
                for (spring, stiffness) in machine.mechanics.chain.stiffness.iter_mut().enumerate()
                {
                    if free(Quantity::Stiffness(spring)) {
                        *stiffness *= factor;
                    }
                }
            } else if free(Quantity::ActuatorMass) {
                machine.mechanics.chain.mass[0] *= factor;
            }
            result.push(machine);
        }
    }
    if response.len() >= parameters.free().count() {
        result.extend(frequency::starts(parameters, response, period));
    }
    result
}
