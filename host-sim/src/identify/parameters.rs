//! What can be identified, by the names of the drive file, and how a fit varies it.
//!
//! Masses, stiffnesses, dampings and the force constant are positive and vary by factors (as
//! logarithms), friction may be zero and varies by amounts.

use super::neighbours::of_loads;
use crate::chain::Chain;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::machine::{DryFriction, Mechanics, Units};

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
    /// The same of motion backwards.
    CoulombBackward,
    /// What it holds at rest.
    Static,
    /// Viscous friction of a load against the ground.
    LoadViscous(usize),
    /// Coulomb friction of a load against the ground.
    LoadCoulomb(usize),
    /// By which the current comes late.
    Delay,
    /// Time constant of the current's lag.
    Lag,
    /// Force by which the motor holds the machine where it stands.
    HoldingForce,
    /// Gap at the spring before that load.
    Backlash(usize),
    /// Of what goes with the position.
    Ripple(RipplePart),
}

/// What of a ripple.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RipplePart {
    /// Amplitude of its sine.
    Sine,
    /// Amplitude of its cosine.
    Cosine,
    /// Length over which it repeats.
    Pitch,
}

/// What repeats itself over the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ripple {
    /// Which.
    pub kind: RippleKind,
    /// Length over which it repeats, m.
    pub pitch: f64,
    /// Amplitude of its sine, N or m.
    pub sine: f64,
    /// Amplitude of its cosine, N or m.
    pub cosine: f64,
}

/// Which of those.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RippleKind {
    /// A force on the actuator, N.
    Cogging,
    /// An error of the encoder, m.
    Eccentricity,
}

impl Ripple {
    /// At a position, m: N or m.
    #[must_use]
    pub fn at(&self, position: f64) -> f64 {
        let (sine, cosine) = (std::f64::consts::TAU * position / self.pitch).sin_cos();
        self.sine * sine + self.cosine * cosine
    }

    /// Its amplitude, N or m.
    #[must_use]
    pub fn amplitude(&self) -> f64 {
        self.sine.hypot(self.cosine)
    }
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
            Quantity::CoulombBackward => "friction.coulomb_backward".into(),
            Quantity::Static => "friction.static".into(),
            Quantity::LoadViscous(load) => format!("load[{}].viscous", load + 1),
            Quantity::LoadCoulomb(load) => format!("load[{}].coulomb", load + 1),
            Quantity::Delay => "actuator.delay".into(),
            Quantity::Lag => "actuator.lag".into(),
            Quantity::HoldingForce => "actuator.holding_force".into(),
            Quantity::Backlash(load) => format!("load[{}].backlash", load + 1),
            Quantity::Ripple(part) => format!("ripple ({part:?})"),
        }
    }

    /// Its unit.
    #[must_use]
    pub fn unit(self, units: &Units) -> &'static str {
        match self {
            Quantity::ActuatorMass | Quantity::Mass(_) => units.mass,
            Quantity::ForceConstant => units.force_constant,
            Quantity::Stiffness(_) => units.stiffness,
            Quantity::Damping(_) | Quantity::Viscous | Quantity::LoadViscous(_) => units.damping,
            Quantity::Coulomb
            | Quantity::CoulombBackward
            | Quantity::Static
            | Quantity::LoadCoulomb(_)
            | Quantity::HoldingForce => units.force,
            Quantity::Delay | Quantity::Lag => "s",
            Quantity::Backlash(_) | Quantity::Ripple(_) => units.position,
        }
    }

    /// Whether it varies by factors.
    pub(super) fn positive(self) -> bool {
        matches!(
            self,
            Quantity::ActuatorMass
                | Quantity::ForceConstant
                | Quantity::Mass(_)
                | Quantity::Stiffness(_)
                | Quantity::Damping(_)
        )
    }

    /// Whether it may be negative.
    pub(super) fn signed(self) -> bool {
        matches!(
            self,
            Quantity::HoldingForce | Quantity::CoulombBackward | Quantity::Ripple(_)
        )
    }

    /// Whether a drive file has it: what no drive can make good is taken out of a record and told.
    pub(super) fn of_a_drive(self) -> bool {
        !matches!(self, Quantity::Backlash(_) | Quantity::Ripple(_))
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

/// Velocity at which most of static friction is gone, where the drive file says nothing, m/s.
const STRIBECK_VELOCITY: f64 = 1e-3;

/// How far a fit may take a coordinate from the drive file: a factor of a thousand, or that many times
/// the amount by which friction varies.
const FARTHEST: f64 = 7.0;

/// All that a fit can vary: what moves, and what pushes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// Masses, springs, friction, and how late the force comes.
    pub mechanics: Mechanics,
    /// By which the motor holds the machine where it stands, N.
    pub holding_force: f64,
    /// Gap at each spring, m.
    pub backlash: Vec<f64>,
    /// What goes with the position.
    pub ripple: Option<Ripple>,
}

impl Machine {
    /// Masses, springs and dampers.
    #[must_use]
    pub fn chain(&self) -> &Chain {
        &self.mechanics.chain
    }

    /// Dry friction of the actuator.
    #[must_use]
    pub fn friction(&self) -> &DryFriction {
        &self.mechanics.friction[0]
    }

    /// The same, to be changed.
    pub fn friction_mut(&mut self) -> &mut DryFriction {
        &mut self.mechanics.friction[0]
    }
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
    /// Amounts by which friction varies, viscous and Coulomb, and time.
    scale: (f64, f64, f64),
    /// The same of lengths: what the first spring gives under a tenth of the motor's force.
    length: f64,
    /// Of the slowest mode, rad/s.
    rate: f64,
    /// The motor's largest, N.
    force: f64,
}

/// What the drive file says beside what every machine has.
fn stated(drive: &Drive, loads: usize) -> Vec<Quantity> {
    let (actuator, friction) = (&drive.actuator, &drive.friction);
    let mut result = Vec::new();
    let mut add = |there: bool, quantity: Quantity| {
        if there {
            result.push(quantity);
        }
    };
    add(
        friction.coulomb_backward.is_some(),
        Quantity::CoulombBackward,
    );
    add(friction.breakaway > 0.0, Quantity::Static);
    for (number, load) in drive.loads.iter().take(loads).enumerate() {
        add(load.viscous > 0.0, Quantity::LoadViscous(number));
        add(load.coulomb > 0.0, Quantity::LoadCoulomb(number));
    }
    add(actuator.delay > 0.0, Quantity::Delay);
    add(actuator.lag > 0.0, Quantity::Lag);
    add(actuator.holding_force != 0.0, Quantity::HoldingForce);
    result
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
        all.extend(stated(drive, loads));
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
        let mut mechanics = Mechanics::new(&drive.actuator, &drive.loads, &drive.friction);
        if mechanics.friction[0].stribeck_velocity == 0.0 {
            mechanics.friction[0].stribeck_velocity = STRIBECK_VELOCITY;
        }
        let chain = &mut mechanics.chain;
        if experiment == Experiment::Free {
            chain.mass.truncate(1);
            chain.stiffness.clear();
            chain.damping.clear();
            chain.ground.clear();
            mechanics.friction.truncate(1);
        }
        let chain = &mechanics.chain;
        let total: f64 = chain.mass.iter().sum();
        let rate = chain
            .modes()
            .first()
            .map_or(10.0, |mode| std::f64::consts::TAU * mode.frequency_hz);
        let force = chain.force_constant * drive.actuator.current_limit;
        let length = 0.1 * force / chain.stiffness.first().copied().unwrap_or(force);
        Ok(Self {
            experiment,
            start: Machine {
                mechanics,
                holding_force: drive.actuator.holding_force,
                backlash: vec![0.0; drive.loads.len()],
                ripple: None,
            },
            all,
            length,
            scale: (0.1 * total * rate, 0.1 * force, drive.control.sample_time),
            rate,
            force,
        })
    }

    /// Rate of the drive file's slowest mode, rad/s.
    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    /// Rows that so many periods of that mode are.
    ///
    /// * `period`: of the rows, s
    pub(super) fn rows(&self, periods: f64, period: f64) -> f64 {
        periods * std::f64::consts::TAU / (self.rate * period)
    }

    /// Largest force of the motor, N.
    pub(super) fn force(&self) -> f64 {
        self.force
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

    /// The same with one more quantity that is free.
    pub(super) fn with(&self, quantity: Quantity) -> Self {
        let mut more = self.clone();
        more.all.push((quantity, false));
        more
    }

    /// The same without a quantity.
    pub(super) fn without(&self, quantity: Quantity) -> Self {
        let mut less = self.clone();
        less.all.retain(|(other, _)| *other != quantity);
        less
    }

    /// The same of another machine, with its number of loads, all of whose parts are free.
    pub(super) fn around(&self, machine: Machine) -> Self {
        Self {
            all: of_loads(&self.all, machine.chain().loads()),
            start: machine,
            ..self.clone()
        }
    }

    /// The same with a ripple of some length, of nothing yet.
    pub(super) fn with_ripple(&self, kind: RippleKind, pitch: f64) -> Self {
        let mut more = self.clone();
        more.start.ripple = Some(Ripple {
            kind,
            pitch,
            sine: 0.0,
            cosine: 0.0,
        });
        let parts = [RipplePart::Sine, RipplePart::Cosine, RipplePart::Pitch];
        let parts = parts.map(|part| (Quantity::Ripple(part), false));
        more.all.extend(parts);
        more
    }

    /// What a machine may have beside what every one has, where it is not already asked for.
    pub(super) fn extensions(&self) -> Vec<Quantity> {
        let mut result = vec![
            Quantity::Delay,
            Quantity::Lag,
            Quantity::HoldingForce,
            Quantity::CoulombBackward,
            Quantity::Static,
        ];
        // Loads that hardly swing are not what is asked for.
        let loads = match self.experiment {
            Experiment::Excitation => self.start.chain().loads(),
            Experiment::Free | Experiment::Slow => 0,
        };
        for load in 0..loads {
            result.extend([
                Quantity::LoadViscous(load),
                Quantity::LoadCoulomb(load),
                Quantity::Backlash(load),
            ]);
        }
        let asked = |quantity: &Quantity| self.all.iter().any(|(asked, _)| asked == quantity);
        result.retain(|quantity| !asked(quantity));
        result
    }

    /// Value of a quantity in a machine.
    #[must_use]
    pub fn value(&self, machine: &Machine, quantity: Quantity) -> f64 {
        let mechanics = &machine.mechanics;
        let chain = &mechanics.chain;
        match quantity {
            Quantity::ActuatorMass => chain.mass[0],
            Quantity::ForceConstant => chain.force_constant,
            Quantity::Mass(load) => chain.mass[load + 1],
            Quantity::Stiffness(load) => chain.stiffness[load],
            Quantity::Damping(load) => chain.damping[load],
            Quantity::Viscous => chain.viscous,
            Quantity::Coulomb => mechanics.friction[0].forward,
            Quantity::CoulombBackward => mechanics.friction[0].backward,
            Quantity::Static => mechanics.friction[0].forward + mechanics.friction[0].breakaway,
            Quantity::LoadViscous(load) => chain.ground[load],
            Quantity::LoadCoulomb(load) => mechanics.friction[load + 1].forward,
            Quantity::Delay => mechanics.delay,
            Quantity::Lag => mechanics.lag,
            Quantity::HoldingForce => machine.holding_force,
            Quantity::Backlash(load) => machine.backlash[load],
            Quantity::Ripple(part) => machine.ripple.map_or(0.0, |ripple| match part {
                RipplePart::Sine => ripple.sine,
                RipplePart::Cosine => ripple.cosine,
                RipplePart::Pitch => ripple.pitch,
            }),
        }
    }

    /// The coordinates in which a fit varies the free quantities.
    pub(super) fn coordinates(&self, machine: &Machine) -> Vec<f64> {
        self.free()
            .map(|quantity| self.coordinate(machine, quantity))
            .collect()
    }

    fn coordinate(&self, machine: &Machine, quantity: Quantity) -> f64 {
        if quantity == Quantity::Static {
            // What there is above Coulomb friction.
            return machine.friction().breakaway / self.scale.1;
        }
        let value = self.value(machine, quantity);
        if quantity.positive() {
            value.ln()
        } else {
            value / self.slope(machine, quantity)
        }
    }

    /// The machine at some coordinates.
    pub(super) fn machine(&self, coordinates: &[f64]) -> Machine {
        let mut machine = self.start.clone();
        let mut backward = None;
        for (quantity, x) in self.free().zip(coordinates) {
            let before = self.coordinate(&self.start, quantity);
            let x = x.clamp(before - FARTHEST, before + FARTHEST);
            let amount = if quantity.positive() {
                x.exp()
            } else {
                x * self.slope(&self.start, quantity)
            };
            let mechanics = &mut machine.mechanics;
            let chain = &mut mechanics.chain;
            match quantity {
                Quantity::ActuatorMass => chain.mass[0] = amount,
                Quantity::ForceConstant => chain.force_constant = amount,
                Quantity::Mass(load) => chain.mass[load + 1] = amount,
                Quantity::Stiffness(load) => chain.stiffness[load] = amount,
                Quantity::Damping(load) => chain.damping[load] = amount,
                Quantity::Viscous => chain.viscous = amount,
                Quantity::Coulomb => {
                    mechanics.friction[0].forward = amount;
                    mechanics.friction[0].backward = amount;
                }
                Quantity::CoulombBackward => backward = Some(amount),
                Quantity::Static => mechanics.friction[0].breakaway = amount.max(0.0),
                Quantity::LoadViscous(load) => chain.ground[load] = amount,
                Quantity::LoadCoulomb(load) => {
                    mechanics.friction[load + 1] = DryFriction::coulomb(amount);
                }
                // The future is not known to a machine.
                Quantity::Delay => mechanics.delay = amount.max(0.0),
                Quantity::Lag => mechanics.lag = amount.max(0.0),
                Quantity::HoldingForce => machine.holding_force = amount,
                Quantity::Backlash(load) => machine.backlash[load] = amount.max(0.0),
                Quantity::Ripple(part) => {
                    if let Some(ripple) = &mut machine.ripple {
                        match part {
                            RipplePart::Sine => ripple.sine = amount,
                            RipplePart::Cosine => ripple.cosine = amount,
                            RipplePart::Pitch => ripple.pitch = amount,
                        }
                    }
                }
            }
        }
        if let Some(backward) = backward {
            machine.friction_mut().backward = backward;
        }
        machine
    }

    /// Value per coordinate at a machine, for standard deviations.
    pub(super) fn slope(&self, machine: &Machine, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Viscous | Quantity::LoadViscous(_) => self.scale.0,
            Quantity::Coulomb
            | Quantity::CoulombBackward
            | Quantity::Static
            | Quantity::LoadCoulomb(_)
            | Quantity::HoldingForce => self.scale.1,
            Quantity::Delay | Quantity::Lag => self.scale.2,
            Quantity::Backlash(_) => self.length,
            Quantity::Ripple(part) => {
                let (kind, pitch) = self
                    .start
                    .ripple
                    .map_or((RippleKind::Cogging, 1.0), |r| (r.kind, r.pitch));
                match (part, kind) {
                    (RipplePart::Pitch, _) => pitch,
                    (_, RippleKind::Cogging) => self.scale.1,
                    (_, RippleKind::Eccentricity) => self.length,
                }
            }
            _ => self.value(machine, quantity),
        }
    }
}
