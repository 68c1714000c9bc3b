//! What can be identified, by the names of the drive file, and how a fit varies it.
//!
//! Masses, stiffnesses, dampings and the force constant are positive and vary by factors (as
//! logarithms), friction may be zero and varies by amounts.

use crate::chain::Chain;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::machine::{Units, chain_of};

/// Which experiment a log is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Experiment {
    /// The whole chain, excited over all its modes.
    Excitation,
    /// The actuator alone, its load detached.
    Free,
    /// The whole chain, moved so slowly that its loads weigh, but hardly swing: they are taken from the
    /// drive file.
    Slow,
}

/// Which quantity of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// `m_a`.
    ActuatorMass,
    /// `k_f`.
    ForceConstant,
    /// Of a load, from 0.
    Mass(usize),
    /// Of the spring before that load.
    Stiffness(usize),
    /// Of the damper beside it.
    Damping(usize),
    /// Viscous friction of the actuator.
    Viscous,
    /// Coulomb friction of the actuator.
    Coulomb,
}

impl Quantity {
    /// The key in the drive file.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Quantity::ActuatorMass => "actuator.mass".into(),
            Quantity::ForceConstant => "actuator.force_constant".into(),
            Quantity::Mass(load) => format!("load[{}].mass", load + 1),
            Quantity::Stiffness(load) => format!("load[{}].stiffness", load + 1),
            Quantity::Damping(load) => format!("load[{}].damping", load + 1),
            Quantity::Viscous => "friction.viscous".into(),
            Quantity::Coulomb => "friction.coulomb".into(),
        }
    }

    /// Its unit.
    #[must_use]
    pub fn unit(self, units: &Units) -> &'static str {
        match self {
            Quantity::ActuatorMass | Quantity::Mass(_) => units.mass,
            Quantity::ForceConstant => units.force_constant,
            Quantity::Stiffness(_) => units.stiffness,
            Quantity::Damping(_) | Quantity::Viscous => units.damping,
            Quantity::Coulomb => units.force,
        }
    }

    /// Whether it varies by factors.
    pub(super) fn positive(self) -> bool {
        !matches!(self, Quantity::Viscous | Quantity::Coulomb)
    }

    /// Whether knowing it fixes the scale of all forces.
    fn scales(self) -> bool {
        matches!(
            self,
            Quantity::ActuatorMass
                | Quantity::ForceConstant
                | Quantity::Mass(_)
                | Quantity::Stiffness(_)
        )
    }
}

/// How far a fit may take a coordinate from the drive file: a factor of a thousand, or that many times
/// the amount by which friction varies.
const FARTHEST: f64 = 7.0;

/// A chain with its Coulomb friction: all that a fit can vary.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// Masses, springs, viscous friction, force constant.
    pub chain: Chain,
    /// Coulomb friction of the actuator, N.
    pub coulomb: f64,
}

/// The machine of a run before anything is identified, which of its quantities there are and which of
/// them are free.
#[derive(Clone, Debug)]
pub struct Parameters {
    /// What the run is of.
    experiment: Experiment,
    start: Machine,
    /// All quantities of the run, and whether each is held.
    pub(super) all: Vec<(Quantity, bool)>,
    /// Amounts by which friction varies: viscous, Coulomb.
    scale: (f64, f64),
    /// Of the slowest mode, rad/s.
    rate: f64,
}

impl Parameters {
    /// * `hold`: keys of quantities that are taken from the drive file as known
    ///
    /// # Errors
    /// [`Error::Parameter`] for a key that the run does not have, or when nothing fixes the scale of the
    /// forces: current and encoder alone determine ratios to the force constant only.
    pub fn new(drive: &Drive, experiment: Experiment, hold: &[String]) -> Result<Self> {
        let loads = if experiment == Experiment::Excitation {
            drive.loads.len()
        } else {
            0
        };
        let mut all = vec![Quantity::ActuatorMass, Quantity::ForceConstant];
        for load in 0..loads {
            all.extend([
                Quantity::Mass(load),
                Quantity::Stiffness(load),
                Quantity::Damping(load),
            ]);
        }
        all.extend([Quantity::Viscous, Quantity::Coulomb]);
        for key in hold {
            if !all.iter().any(|quantity| quantity.name() == *key) {
                let names: Vec<String> = all.iter().map(|quantity| quantity.name()).collect();
                let rule = format!("must be one of {}", names.join(", "));
                return Err(Error::parameter("hold", key, rule));
            }
        }
        let all: Vec<(Quantity, bool)> = all
            .into_iter()
            .map(|quantity| (quantity, hold.contains(&quantity.name())))
            .collect();
        if !all
            .iter()
            .any(|(quantity, held)| *held && quantity.scales())
        {
            return Err(Error::Parameter {
                parameter: "hold",
                values: hold.to_vec(),
                rule: "must name a mass, a stiffness or the force constant, because current and \
                       encoder determine ratios of forces only"
                    .into(),
            });
        }
        let mut chain = chain_of(&drive.actuator, &drive.loads, drive.friction.viscous);
        if experiment == Experiment::Free {
            chain.mass.truncate(1);
            chain.stiffness.clear();
            chain.damping.clear();
        }
        let total: f64 = chain.mass.iter().sum();
        let rate = chain
            .modes()
            .first()
            .map_or(10.0, |mode| std::f64::consts::TAU * mode.frequency_hz);
        let force = chain.force_constant * drive.actuator.current_limit;
        Ok(Self {
            experiment,
            start: Machine {
                chain,
                coulomb: drive.friction.coulomb,
            },
            all,
            scale: (0.1 * total * rate, 0.1 * force),
            rate,
        })
    }

    /// Rate of the drive file's slowest mode, rad/s.
    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    /// What the run is of.
    #[must_use]
    pub fn experiment(&self) -> Experiment {
        self.experiment
    }

    /// The quantities that are free.
    pub(super) fn free(&self) -> impl Iterator<Item = Quantity> {
        self.all
            .iter()
            .filter(|(_, held)| !held)
            .map(|(quantity, _)| *quantity)
    }

    /// The machine as the drive file has it.
    #[must_use]
    pub fn start(&self) -> &Machine {
        &self.start
    }

    /// Value of a quantity in a machine.
    #[must_use]
    pub fn value(&self, machine: &Machine, quantity: Quantity) -> f64 {
        let chain = &machine.chain;
        match quantity {
            Quantity::ActuatorMass => chain.mass[0],
            Quantity::ForceConstant => chain.force_constant,
            Quantity::Mass(load) => chain.mass[load + 1],
            Quantity::Stiffness(load) => chain.stiffness[load],
            Quantity::Damping(load) => chain.damping[load],
            Quantity::Viscous => chain.viscous,
            Quantity::Coulomb => machine.coulomb,
        }
    }

    /// The coordinates in which a fit varies the free quantities.
    pub(super) fn coordinates(&self, machine: &Machine) -> Vec<f64> {
        self.free()
            .map(|quantity| self.coordinate(machine, quantity))
            .collect()
    }

    fn coordinate(&self, machine: &Machine, quantity: Quantity) -> f64 {
        let value = self.value(machine, quantity);
        match quantity {
            Quantity::Viscous => value / self.scale.0,
            Quantity::Coulomb => value / self.scale.1,
            _ => value.ln(),
        }
    }

    /// The machine at some coordinates.
    pub(super) fn machine(&self, coordinates: &[f64]) -> Machine {
        let mut machine = self.start.clone();
        let chain = &mut machine.chain;
        for (quantity, x) in self.free().zip(coordinates) {
            let before = self.coordinate(&self.start, quantity);
            let x = x.clamp(before - FARTHEST, before + FARTHEST);
            match quantity {
                Quantity::ActuatorMass => chain.mass[0] = x.exp(),
                Quantity::ForceConstant => chain.force_constant = x.exp(),
                Quantity::Mass(load) => chain.mass[load + 1] = x.exp(),
                Quantity::Stiffness(load) => chain.stiffness[load] = x.exp(),
                Quantity::Damping(load) => chain.damping[load] = x.exp(),
                Quantity::Viscous => chain.viscous = x * self.scale.0,
                Quantity::Coulomb => machine.coulomb = x * self.scale.1,
            }
        }
        machine
    }

    /// Value per coordinate at a machine, for standard deviations.
    pub(super) fn slope(&self, machine: &Machine, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Viscous => self.scale.0,
            Quantity::Coulomb => self.scale.1,
            _ => self.value(machine, quantity),
        }
    }
}
