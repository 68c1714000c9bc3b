//! The experiments: where the drive starts and where it is sent.

use crate::chain::Chain;
use crate::design::paper;
use crate::machine::Kind;
use arso_core::{Place, Request};
use nalgebra::DVector;

/// How the drive is sent to its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Approach {
    /// The reference steps, as in the paper.
    Step,
    /// Planned move.
    Move,
}

/// Where the loads are at the start; the actuator is at the origin, everything at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// At the origin.
    Origin,
    /// As if the last load were held aside by this distance, m.
    PulledAtLast(f64),
    /// As if the first load were held aside by this distance, m; the others follow.
    PulledAtFirst(f64),
}

/// One experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// Its name.
    pub name: &'static str,
    /// What it shows, for a linear drive.
    pub linear_title: &'static str,
    /// How the drive is sent.
    pub approach: Approach,
    /// Where to, m.
    pub target: f64,
    /// Where it starts.
    pub start: Start,
}

/// All experiments: the paper's four (Figs. 3 to 6), and a planned move.
pub const SCENARIOS: [Scenario; 5] = [
    Scenario {
        name: "fig3",
        linear_title: "second mass to a reference, 30 mm",
        approach: Approach::Step,
        target: paper::STEP,
        start: Start::Origin,
    },
    Scenario {
        name: "fig4",
        linear_title: "second mass to a reference, 15 mm",
        approach: Approach::Step,
        target: 0.015,
        start: Start::Origin,
    },
    Scenario {
        name: "fig5",
        linear_title: "to the origin, last mass pulled by 6 mm",
        approach: Approach::Step,
        target: 0.0,
        start: Start::PulledAtLast(0.006),
    },
    Scenario {
        name: "fig6",
        linear_title: "to the origin, first mass pulled by -4 mm",
        approach: Approach::Step,
        target: 0.0,
        start: Start::PulledAtFirst(-0.004),
    },
    Scenario::PLANNED,
];

impl Scenario {
    /// A planned move.
    pub const PLANNED: Self = Self {
        name: "move",
        linear_title: "planned move of 30 mm",
        approach: Approach::Move,
        target: paper::STEP,
        start: Start::Origin,
    };

    /// The experiment of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Scenario> {
        SCENARIOS.iter().find(|scenario| scenario.name == name)
    }

    /// What is asked of the drive.
    ///
    /// * `resolution`: of its encoder, m
    #[must_use]
    pub fn request(&self, resolution: f64) -> Request {
        let target = Place((self.target / resolution).round() as i64);
        match self.approach {
            Approach::Step => Request::Step(target),
            Approach::Move => Request::Move(target),
        }
    }

    /// What it shows, in the units of a kind of drive.
    #[must_use]
    pub fn title(&self, kind: Kind) -> String {
        self.linear_title.replace("mm", kind.units().milli_position)
    }

    /// State `x_a v_a x_1 v_1 …` of a chain at the start.
    #[must_use]
    pub fn initial_state(&self, chain: &Chain) -> DVector<f64> {
        let mut state = DVector::zeros(chain.states());
        // A static force at a mass stretches the springs up to it by 1/k each.
        let (last_stretched, deflection) = match self.start {
            Start::Origin => return state,
            Start::PulledAtLast(deflection) => (chain.loads(), deflection),
            Start::PulledAtFirst(deflection) => (1, deflection),
        };
        let compliance = |springs: usize| {
            let springs = &chain.stiffness[..springs.min(last_stretched)];
            springs.iter().map(|k| 1.0 / k).sum::<f64>()
        };
        for load in 1..=chain.loads() {
            state[2 * load] = deflection * compliance(load) / compliance(last_stretched);
        }
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulled_chains_have_equal_spring_forces() {
        let chain = Chain::of_table_1(300.0, 0.1);
        let state = |name: &str| Scenario::named(name).unwrap().initial_state(&chain);
        let expected = [0.0, 0.0, 0.002, 0.0, 0.004, 0.0, 0.006, 0.0];
        assert!((state("fig5") - DVector::from_row_slice(&expected)).amax() < 1e-15);
        let expected = [0.0, 0.0, -0.004, 0.0, -0.004, 0.0, -0.004, 0.0];
        assert!((state("fig6") - DVector::from_row_slice(&expected)).amax() < 1e-15);
    }
}
