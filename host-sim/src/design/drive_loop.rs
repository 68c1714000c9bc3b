//! The drive from measured position to command, as a linear sampled system, and its loop with the plant.
//!
//! Gain and observer are each designed to be stable, but the gain acts on the filtered velocity of the
//! encoder and the observer on filtered forces, so that the loop of the drive is more than both: its
//! poles are those of everything together.
//!
//! ```text
//! s⁺ = A s + b x_a        i = c s + d x_a
//! ```
//!
//! The memory `s` is what the drive keeps from one period to the next; the matrices are its answers to
//! unit memories, which is all there is to know of something linear. The force observers are the core's
//! own, in `f64`, fed with the command of the period before, as in the drive.

use super::Design;
use crate::linear::response::Response;
use arso_core::actuator::Actuator;
use arso_core::disturbance::{self, DisturbanceObserver};
use arso_core::reaction_force::{self, ReactionForceObserver};
use arso_core::units::Current;
use nalgebra::{Complex, DMatrix, DVector, RowDVector};

/// What the rule for rest does with the disturbance that the observer finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compensation {
    /// It is compensated at once: while the drive moves and settles.
    Follows,
    /// The compensation is held, and nothing in the loop integrates: at rest.
    Held,
}

/// The drive as `s⁺ = A s + b x_a`, `i = c s + d x_a`.
#[derive(Clone, Debug)]
pub struct DriveLoop {
    transition: DMatrix<f64>,
    input: DVector<f64>,
    output: RowDVector<f64>,
    through: f64,
    /// The same of the disturbance found and of the innovation, N.
    found: (RowDVector<f64>, f64),
    innovation: (RowDVector<f64>, f64),
}

/// See [`DriveLoop::response`].
pub struct DriveResponse {
    of_memory: Response,
    through: f64,
}

impl DriveResponse {
    /// Command per metre of position at `z`; none at a pole.
    #[must_use]
    pub fn at(&self, z: Complex<f64>) -> Option<Complex<f64>> {
        Some(self.of_memory.at(z)?[0] + self.through)
    }
}

/// What the memory holds, before the states of the observer: position and command of the period before,
/// then the memories of the force observers.
const POSITION: usize = 0;
const COMMAND: usize = 1;
const FORCES: usize = 2;
const OBSERVER: usize = FORCES + 8;

impl DriveLoop {
    /// The drive of a design.
    #[must_use]
    pub fn new(design: &Design, compensation: Compensation) -> Self {
        let step = |memory: &DVector<f64>, position| step(design, compensation, memory, position);
        let (mut found, mut unexpected) = (Vec::new(), Vec::new());
        let n = OBSERVER + design.observer.input.len();
        let mut transition = DMatrix::zeros(n, n);
        for column in 0..n {
            let mut memory = DVector::zeros(n);
            memory[column] = 1.0;
            let stepped = step(&memory, 0.0);
            transition.set_column(column, &stepped.memory);
            found.push(stepped.found);
            unexpected.push(stepped.innovation);
        }
        let Stepped {
            memory: input,
            found: found_through,
            innovation,
        } = step(&DVector::zeros(n), 1.0);
        // The command is part of the new memory.
        Self {
            output: transition.row(COMMAND).into_owned(),
            through: input[COMMAND],
            found: (RowDVector::from_vec(found), found_through),
            innovation: (RowDVector::from_vec(unexpected), innovation),
            transition,
            input,
        }
    }

    /// `A`, `b`, `c` and `d` of the drive; what the memory holds: position, m, and command, A, of the period before,
    /// eight memories of the force observers, the states of the state observer.
    #[must_use]
    pub fn matrices(&self) -> (&DMatrix<f64>, &DVector<f64>, &RowDVector<f64>, f64) {
        (&self.transition, &self.input, &self.output, self.through)
    }

    /// The rows of the disturbance found and of the innovation over the state of [`closed`](Self::closed), N.
    ///
    /// * `plant`: states of the plant
    #[must_use]
    pub fn watched(&self, plant: usize) -> [RowDVector<f64>; 2] {
        [&self.found, &self.innovation].map(|(row, through)| {
            let mut all = RowDVector::zeros(plant + row.len());
            all[0] = *through;
            all.columns_mut(plant, row.len()).copy_from(row);
            all
        })
    }

    /// Command per metre of position, ready to be asked at many frequencies.
    #[must_use]
    pub fn response(&self) -> DriveResponse {
        DriveResponse {
            of_memory: Response::new(
                &self.transition,
                &self.input,
                &DMatrix::from_rows(std::slice::from_ref(&self.output)),
            ),
            through: self.through,
        }
    }

    /// Transition of plant and drive together: states of the plant, then the memory.
    ///
    /// * `ad`, `bd`: the sampled plant, whose first state is the position
    #[must_use]
    pub fn closed(&self, ad: &DMatrix<f64>, bd: &DVector<f64>) -> DMatrix<f64> {
        let (plant, drive) = (bd.len(), self.input.len());
        let mut closed = DMatrix::zeros(plant + drive, plant + drive);
        closed.view_mut((0, 0), (plant, plant)).copy_from(ad);
        closed
            .view_mut((0, plant), (plant, drive))
            .copy_from(&(bd * &self.output));
        closed
            .view_mut((plant, plant), (drive, drive))
            .copy_from(&self.transition);
        let mut measured = closed.column_mut(0);
        measured += self.measured(bd);
        closed
    }

    /// What a metre of the measured position does to plant and drive.
    ///
    /// * `bd`: of the sampled plant
    #[must_use]
    pub fn measured(&self, bd: &DVector<f64>) -> DVector<f64> {
        let of_plant = bd * self.through;
        let both = of_plant.iter().chain(self.input.iter());
        DVector::from_iterator(bd.len() + self.input.len(), both.copied())
    }
}

/// The force observers of a design.
fn force_observers(design: &Design) -> (DisturbanceObserver<f64>, ReactionForceObserver<f64>) {
    let (actuator, control) = (&design.drive.actuator, &design.drive.control);
    let actuator = Actuator {
        mass: actuator.mass,
        force_constant: actuator.force_constant,
        mass_deviation: actuator.mass_deviation,
        force_constant_deviation: actuator.force_constant_deviation,
    };
    let (g_dist, g_reac) = (control.disturbance_cutoff, control.reaction_force_cutoff);
    let period = control.sample_time;
    (
        DisturbanceObserver::new(&actuator, g_dist, period),
        ReactionForceObserver::new(&actuator, g_dist, g_reac, period),
    )
}

/// What comes of a control period.
struct Stepped {
    memory: DVector<f64>,
    /// N.
    found: f64,
    /// N.
    innovation: f64,
}

/// One control period without limits and reference.
fn step(
    design: &Design,
    compensation: Compensation,
    memory: &DVector<f64>,
    position: f64,
) -> Stepped {
    let (disturbance_observer, reaction_force_observer) = force_observers(design);
    let m = |element: usize| memory[FORCES + element];
    let mut of_disturbance = disturbance::Memory {
        motor_force: m(0),
        mean_velocity: m(1),
        velocity: m(2),
        acceleration: m(3),
    };
    let mut of_reaction_force = reaction_force::Memory {
        motor_force: m(4),
        acceleration: m(5),
        current: m(6),
        mean_acceleration: m(7),
    };
    let current = Current(memory[COMMAND]);
    let displacement = position - memory[POSITION];
    let disturbance = disturbance_observer.step(&mut of_disturbance, displacement, current);
    let force = reaction_force_observer.step(&mut of_reaction_force, &disturbance, current);

    // z⁺ = F z + g u, then z += L (f − c z)
    let (observer, variant) = (&design.observer, design.observer_variant());
    let n = observer.input.len();
    let held = variant.input(disturbance.mean_velocity.0, current.0);
    let mut state = &observer.transition * memory.rows(OBSERVER, n) + &observer.input * held;
    let innovation = force.0 - (&observer.output * &state).x;
    state.axpy(innovation, &observer.correction, 1.0);

    let (motion, found) = variant.estimate(&state, [position, disturbance.velocity.0]);
    let compensated = match compensation {
        Compensation::Follows => found,
        Compensation::Held => 0.0,
    };
    let command = compensated / design.drive.actuator.actual_force_constant()
        - (&design.regulator * motion).x;

    let disturbance::Memory {
        motor_force,
        mean_velocity,
        velocity,
        acceleration,
    } = of_disturbance;
    let reaction_force::Memory {
        motor_force: twice,
        acceleration: filtered,
        current: lagged,
        mean_acceleration,
    } = of_reaction_force;
    let head = [
        position,
        command,
        motor_force,
        mean_velocity,
        velocity,
        acceleration,
        twice,
        filtered,
        lagged,
        mean_acceleration,
    ];
    let memory =
        DVector::from_iterator(memory.len(), head.into_iter().chain(state.iter().copied()));
    Stepped {
        memory,
        found,
        innovation,
    }
}
