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
//! The memory `s` is what the control step keeps from one period to the next; the matrices are its
//! answers to unit memories, which is all there is to know of a linear step. The observers are fed with
//! the command of the period before, as in the drive.

use super::Design;
use arso_core::observer::Form;
use nalgebra::{Complex, DMatrix, DVector, RowDVector};

/// The drive as `s⁺ = A s + b x_a`, `i = c s + d x_a`.
#[derive(Clone, Debug)]
pub struct DriveLoop {
    transition: DMatrix<f64>,
    input: DVector<f64>,
    output: RowDVector<f64>,
    through: f64,
}

/// What the memory holds, before the states of the observer.
const POSITION: usize = 0;
const RAW_VELOCITY: usize = 1;
const VELOCITY: usize = 2;
const ACCELERATION: usize = 3;
const RAW_ACCELERATION: usize = 4;
const MOTOR_ONCE: usize = 5;
const MOTOR_TWICE: usize = 6;
const DEVIATION: usize = 7;
const COMMAND: usize = 8;
const OBSERVER: usize = 9;

impl DriveLoop {
    /// The drive of a design.
    #[must_use]
    pub fn new(design: &Design) -> Self {
        let n = OBSERVER + design.observer.input.len();
        let mut transition = DMatrix::zeros(n, n);
        for column in 0..n {
            let mut memory = DVector::zeros(n);
            memory[column] = 1.0;
            transition.set_column(column, &step(design, &memory, 0.0));
        }
        let input = step(design, &DVector::zeros(n), 1.0);
        // The command is part of the new memory.
        Self {
            output: transition.row(COMMAND).into_owned(),
            through: input[COMMAND],
            transition,
            input,
        }
    }

    /// Command per metre of position at `z`; none at a pole.
    #[must_use]
    pub fn response(&self, z: Complex<f64>) -> Option<Complex<f64>> {
        let n = self.input.len();
        let matrix = DMatrix::identity(n, n) * z - self.transition.map(Complex::from);
        let memory = matrix.lu().solve(&self.input.map(Complex::from))?;
        let products = self.output.iter().zip(memory.iter()).map(|(c, s)| s * *c);
        Some(products.sum::<Complex<f64>>() + self.through)
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
        let mut through = closed.view_mut((0, 0), (plant, 1));
        through += bd * self.through;
        closed
            .view_mut((plant, 0), (drive, 1))
            .copy_from(&self.input);
        closed
    }
}

/// One control step without limits and reference: the new memory.
fn step(design: &Design, memory: &DVector<f64>, position: f64) -> DVector<f64> {
    let drive = &design.drive;
    let (actuator, control) = (&drive.actuator, &drive.control);
    let period = control.sample_time;
    let (g_dist, g_reac) = (control.disturbance_cutoff, control.reaction_force_cutoff);
    let (a_dist, a_reac) = ((-g_dist * period).exp(), (-g_reac * period).exp());
    let lag = |pole: f64, before: f64, input: f64| pole * before + (1.0 - pole) * input;
    let mut next = DVector::zeros(memory.len());

    next[POSITION] = position;
    next[RAW_VELOCITY] = (position - memory[POSITION]) / period;
    next[VELOCITY] = lag(a_dist, memory[VELOCITY], next[RAW_VELOCITY]);
    let difference = |element: usize| (next[element] - memory[element]) / period;
    let (acceleration, raw) = (difference(VELOCITY), difference(RAW_VELOCITY));
    next[ACCELERATION] = lag(a_reac, memory[ACCELERATION], acceleration);
    next[RAW_ACCELERATION] = lag(a_reac, memory[RAW_ACCELERATION], raw);

    // (19) and (18) as the core has them: two exact lags on the held current, the deviations
    // filtered once.
    let current = memory[COMMAND];
    let motor = actuator.force_constant * current;
    let apart = (g_reac - g_dist) * period;
    let ratio = if apart == 0.0 {
        1.0
    } else {
        apart.exp_m1() / apart
    };
    let cascade = g_reac * period * a_reac * ratio;
    next[MOTOR_ONCE] = lag(a_dist, memory[MOTOR_ONCE], motor);
    next[MOTOR_TWICE] = a_reac * memory[MOTOR_TWICE]
        + cascade * memory[MOTOR_ONCE]
        + (1.0 - a_reac - cascade) * motor;
    next[DEVIATION] = lag(a_reac, memory[DEVIATION], current);
    let force = next[MOTOR_TWICE] - actuator.mass * next[ACCELERATION]
        + actuator.force_constant_deviation * next[DEVIATION]
        - actuator.mass_deviation * next[RAW_ACCELERATION];

    // z⁺ = F z + g u, then z += L (f − c z)
    let observer = &design.observer;
    let n = observer.input.len();
    let held = match design.form() {
        Form::Anchored => next[RAW_VELOCITY],
        Form::Reaction => current,
    };
    let mut state = &observer.transition * memory.rows(OBSERVER, n) + &observer.input * held;
    let innovation = force - (&observer.output * &state).x;
    state.axpy(innovation, &observer.correction, 1.0);
    next.rows_mut(OBSERVER, n).copy_from(&state);

    let gain = &design.regulator;
    next[COMMAND] = match design.form() {
        Form::Anchored => {
            let mut command = -gain[0] * position - gain[1] * next[VELOCITY];
            for load in 0..design.loads() {
                command -= gain[2 * load + 2] * (state[2 * load] + position)
                    + gain[2 * load + 3] * state[2 * load + 1];
            }
            command + state[n - 1] / actuator.actual_force_constant()
        }
        Form::Reaction => -(gain * state).x,
    };
    next
}
