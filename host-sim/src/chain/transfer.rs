//! Currents that take a chain from rest to rest, or to a steady velocity, within limits.
//!
//! The chain is sampled exactly, the current `i_k` held over a step. A [`Task`] fixes the number of steps `n`
//! and what the chain does at their end:
//!
//! ```text
//! z_0 = 0,  z_{k+1} = F z_k + G i_k
//! displacement   every mass rests at the scale s, m
//! change         every mass moves with the scale s, m/s, every spring at rest
//! ```
//!
//! [`Task::farthest`] is the largest scale within the limits, a linear programme. [`Task::currents`] are those
//! for a scale below it, the solution of
//!
//! ```text
//! least  sum (x_c,k / s - 1)^2 + r sum i_k^2 + r sum (i_k - i_{k-1})^2 / 10      (currents over their limit)
//! ```
//!
//! which brings the controlled mass to its target early with a current that is no rougher than it must be; of
//! a change of velocity only the currents count. States are modal, over what the current does to them, and
//! unknowns of their own: the effort grows with the steps and no faster.

use super::Chain;
use super::modal::Modal;
use super::rows::Rows;
use crate::error::NoSolution;
use crate::linear::Result;
use crate::linear::zoh::zero_order_hold;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, SolverError, SolverStatus, SupportedConeT,
};
use nalgebra::{DMatrix, DVector, RowDVector};

/// What a plan must keep, SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct PathLimits {
    /// A.
    pub current: f64,
    /// Of the actuator, m/s.
    pub velocity: Option<f64>,
    /// Of the actuator, mean over a step, m/s².
    pub acceleration: Option<f64>,
    /// Change of that from one step to the next, over the step, m/s³.
    pub jerk: Option<f64>,
    /// Of each spring, m.
    pub deflection: Vec<Option<f64>>,
}

/// Where a transfer leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// From rest to rest.
    Displacement,
    /// From rest to a steady velocity.
    Change,
}

/// Weight `r`: between 1e-3, whose currents are at their limit most of the time, and 1, which gives away two
/// samples of the settling time.
const SMOOTHNESS: f64 = 0.01;
/// Of the differences.
const ROUGHNESS: f64 = 0.1;

/// Tried one after the other: rounding keeps some programmes from being solved with the first.
const REGULARIZATIONS: [f64; 3] = [1e-7, 1e-6, 1e-8];
/// Residual of the motion, in states over what full current does to them, that currents may have over the scale
/// that they lead to: it is taken away, at the cost of so much more current. Between these bounds.
const ARRIVES: f64 = 1e-4;
const COARSE: f64 = 1e-6;
const EXACT: f64 = 1e-8;
/// Share by which the optimum may be missed where the solver comes no nearer. Where it does, it is to: what is only
/// near the optimum has rougher currents.
const NEAR: f64 = 1e-3;
/// Its steps: what takes more comes no nearer.
const ITERATIONS: u32 = 100;

/// A transfer in a number of steps.
pub struct Task<'a> {
    modal: &'a Modal,
    kind: Kind,
    steps: usize,
    limits: &'a PathLimits,
    /// Of each state.
    scale: DVector<f64>,
    f: DMatrix<f64>,
    g: DVector<f64>,
    step: f64,
}

/// The chain in the form that all its transfers share.
pub struct Prepared(Modal);

impl Prepared {
    /// * `current`: limit, A
    ///
    /// # Errors
    /// [`NoSolution`] when the modes cannot be computed.
    pub fn new(chain: &Chain, current: f64) -> Result<Self> {
        Ok(Self(Modal::new(chain, current)?))
    }

    /// A transfer.
    ///
    /// * `limits`: its current must be the one this was prepared for
    /// * `steps`: how many, of `step` seconds each
    #[must_use]
    pub fn task<'a>(
        &'a self,
        kind: Kind,
        limits: &'a PathLimits,
        (steps, step): (usize, f64),
    ) -> Task<'a> {
        let scale = self.0.scale(0.5 * steps as f64 * step);
        let (a, b) = self.0.scaled(&scale);
        let (f, g) = zero_order_hold(&a, &b, step);
        Task {
            modal: &self.0,
            kind,
            steps,
            limits,
            scale,
            f,
            g,
            step,
        }
    }
}

impl Task<'_> {
    /// Largest scale within the limits; m or m/s.
    ///
    /// # Errors
    /// [`NoSolution`] when the solver fails.
    pub fn farthest(&self) -> Result<f64> {
        Ok(self.extreme()?.0)
    }

    /// The same, and its currents over their limit.
    fn extreme(&self) -> Result<(f64, Vec<f64>)> {
        // The last unknown is the scale, over what the current does.
        let unknowns = self.unknowns() + 1;
        let scale = self.end_scale();
        let mut rows = self.motion();
        let equalities = rows.count();
        self.limits(&mut rows);
        let mut objective = vec![0.0; unknowns];
        objective[unknowns - 1] = -1.0;
        let quadratic = CscMatrix::zeros((unknowns, unknowns));
        let mut solution = solve(&quadratic, &objective, unknowns, rows, equalities, EXACT)?;
        let farthest = solution[unknowns - 1] * scale;
        solution.truncate(self.steps);
        Ok((farthest, solution))
    }

    /// Currents that lead to a scale, A, and there exactly. Where the smooth ones are not found, since the
    /// limits leave hardly any choice, those of the largest scale, scaled.
    ///
    /// * `controlled`: mass that is to be at its target early
    ///
    /// # Errors
    /// [`NoSolution`] when the solver fails.
    pub fn currents(&self, scale: f64, controlled: usize) -> Result<Vec<f64>> {
        let currents = self.smooth(scale, controlled).or_else(|_| {
            let (farthest, currents) = self.extreme()?;
            Ok(currents.iter().map(|i| i * scale / farthest).collect())
        });
        let arriving = self.arriving(currents?, scale)?;
        Ok(arriving.iter().map(|i| i * self.limits.current).collect())
    }

    /// The least change of currents, over their limit, that takes the solver's residual at the end away.
    fn arriving(&self, currents: Vec<f64>, scale: f64) -> Result<DVector<f64>> {
        let n = self.scale.len();
        // The centre of mass's position after a change is free.
        let (first, reached) = match self.kind {
            Kind::Displacement => (0, 0),
            Kind::Change => (1, n / 2 - 1),
        };
        let mut responses = DMatrix::zeros(self.steps, n);
        let mut response = self.g.clone();
        for step in (0..self.steps).rev() {
            responses.set_row(step, &response.transpose());
            response = &self.f * response;
        }
        let responses = responses.columns(first, n - first).into_owned();
        let currents = DVector::from_vec(currents);
        let mut missing = -responses.tr_mul(&currents);
        missing[reached] += scale / self.end_scale();
        let (q, r) = responses.qr().unpack();
        let change = r.transpose().solve_lower_triangular(&missing);
        let change = change.ok_or_else(|| NoSolution("no current moves every mode".into()))?;
        Ok(currents + q * change)
    }

    /// Smooth currents, over their limit, that lead to a scale.
    fn smooth(&self, scale: f64, controlled: usize) -> Result<Vec<f64>> {
        let mass = match self.kind {
            Kind::Displacement => Some(self.row(&self.modal.position(controlled)) / scale),
            Kind::Change => None,
        };
        // Distances of the controlled mass, then differences of the current, behind the states.
        let distances = self.unknowns() + 1;
        let differences = distances + if mass.is_some() { self.steps } else { 0 };
        let unknowns = differences + self.steps - 1;
        let fixed = distances - 1;
        let mut rows = self.motion();
        rows.add([(fixed, 1.0)], scale / self.end_scale());
        if let Some(mass) = &mass {
            for step in 0..self.steps {
                let mut entries = self.times(mass, step + 1);
                entries.push((distances + step, -1.0));
                rows.add(entries, 1.0);
            }
        }
        for step in 1..self.steps {
            let entries = [
                (step, 1.0),
                (step - 1, -1.0),
                (differences + step - 1, -1.0),
            ];
            rows.add(entries, 0.0);
        }
        let equalities = rows.count();
        self.limits(&mut rows);
        let mut diagonal = vec![0.0; unknowns];
        diagonal[..self.steps].fill(SMOOTHNESS);
        diagonal[distances..differences].fill(1.0);
        diagonal[differences..].fill(SMOOTHNESS * ROUGHNESS);
        let quadratic = CscMatrix::new(
            unknowns,
            unknowns,
            (0..=unknowns).collect(),
            (0..unknowns).collect(),
            diagonal,
        );
        let objective = vec![0.0; unknowns];
        let residual = (ARRIVES * scale / self.end_scale()).clamp(EXACT, COARSE);
        let mut solution = solve(&quadratic, &objective, unknowns, rows, equalities, residual)?;
        solution.truncate(self.steps);
        Ok(solution)
    }

    /// Currents, then states after each step but the last; a displacement's last state is its scale, and of a
    /// change's the position of the centre of mass is free.
    fn unknowns(&self) -> usize {
        let free = usize::from(self.kind == Kind::Change);
        self.steps + self.scale.len() * (self.steps - 1) + free
    }

    fn state(&self, step: usize, element: usize) -> usize {
        self.steps + (step - 1) * self.scale.len() + element
    }

    /// Scale of the centre of mass's position, or velocity.
    fn end_scale(&self) -> f64 {
        let n = self.scale.len() / 2;
        self.scale[match self.kind {
            Kind::Displacement => 0,
            Kind::Change => n,
        }]
    }

    /// A row for modal states as one for their scaled values.
    fn row(&self, row: &RowDVector<f64>) -> RowDVector<f64> {
        row.component_mul(&self.scale.transpose())
    }

    /// A row times the state after so many steps, one at least; after the last it is in terms of the scale.
    fn times(&self, row: &RowDVector<f64>, step: usize) -> Vec<(usize, f64)> {
        if step < self.steps {
            let elements = row.iter().enumerate();
            return elements
                .map(|(element, value)| (self.state(step, element), *value))
                .collect();
        }
        let n = self.scale.len() / 2;
        let free = self.steps + self.scale.len() * (self.steps - 1);
        match self.kind {
            Kind::Displacement => vec![(free, row[0])],
            Kind::Change => vec![(free, row[0]), (free + 1, row[n])],
        }
    }

    /// What the current does.
    fn motion(&self) -> Rows {
        let mut rows = Rows::default();
        let n = self.scale.len();
        for step in 0..self.steps {
            for element in 0..n {
                let mut unit = RowDVector::zeros(n);
                unit[element] = 1.0;
                let mut entries = vec![(step, self.g[element])];
                if step > 0 {
                    entries.extend(self.times(&self.f.row(element).into_owned(), step));
                }
                let after = self.times(&unit, step + 1);
                entries.extend(after.into_iter().map(|(column, value)| (column, -value)));
                rows.add(entries, 0.0);
            }
        }
        rows
    }

    fn limits(&self, rows: &mut Rows) {
        for step in 0..self.steps {
            rows.within(&[(step, 1.0)], 1.0);
        }
        let n = self.scale.len() / 2;
        let velocity = |mass: usize| {
            let position = self.modal.position(mass);
            self.row(&RowDVector::from_fn(2 * n, |_, column| {
                if column < n {
                    0.0
                } else {
                    position[column - n]
                }
            }))
        };
        let actuator = velocity(0);
        if let Some(limit) = self.limits.velocity {
            for step in 1..=self.steps {
                let entries = self.times(&(&actuator / limit), step);
                rows.within(&entries, 1.0);
                if self.kind == Kind::Change {
                    // Backwards from the limit, what dips below zero would be beyond it.
                    rows.add(
                        entries.into_iter().map(|(column, value)| (column, -value)),
                        0.0,
                    );
                }
            }
        }
        // A combination of the velocities at the end of this step and before.
        let mut differences = |limit: f64, weights: &[f64]| {
            let row = &actuator / limit;
            for step in 1..self.steps + weights.len() - 1 {
                let before = weights.iter().enumerate().filter(|(back, _)| *back < step);
                let entries = before.flat_map(|(back, weight)| {
                    self.times(&(&row * *weight), (step - back).min(self.steps))
                });
                rows.within(&entries.collect::<Vec<_>>(), 1.0);
            }
        };
        if let Some(limit) = self.limits.acceleration {
            differences(limit * self.step, &[1.0, -1.0]);
        }
        if let Some(limit) = self.limits.jerk {
            differences(limit * self.step.powi(2), &[1.0, -2.0, 1.0]);
        }
        for (spring, limit) in self.limits.deflection.iter().enumerate() {
            let Some(limit) = limit else { continue };
            let ends = self.modal.position(spring + 1) - self.modal.position(spring);
            let row = self.row(&ends) / *limit;
            for step in 1..self.steps {
                rows.within(&self.times(&row, step), 1.0);
            }
        }
    }
}

/// The unknowns of a programme, the equalities first.
///
/// * `residual`: that will do
fn solve(
    quadratic: &CscMatrix<f64>,
    objective: &[f64],
    unknowns: usize,
    rows: Rows,
    equalities: usize,
    residual: f64,
) -> Result<Vec<f64>> {
    let failed = |why: String| {
        NoSolution(format!(
            "the programme of a planned move was not solved: {why}"
        ))
    };
    let (a, right) = rows.into_matrix(unknowns);
    let cones = [
        SupportedConeT::ZeroConeT(equalities),
        SupportedConeT::NonnegativeConeT(right.len() - equalities),
    ];
    let mut status = SolverStatus::Unsolved;
    for static_regularization_constant in REGULARIZATIONS {
        let settings = DefaultSettings {
            verbose: false,
            max_threads: 1,
            static_regularization_constant,
            max_iter: ITERATIONS,
            tol_feas: residual,
            // More are a third of its time, and make no step better.
            iterative_refinement_max_iter: 1,
            ..DefaultSettings::default()
        };
        let solver = DefaultSolver::new(quadratic, objective, &a, &right, &cones, settings);
        let mut solver = solver.map_err(|error: SolverError| failed(error.to_string()))?;
        solver.solve();
        let solution = solver.solution;
        let gap = (solution.obj_val - solution.obj_val_dual).abs();
        // What is not quite the best is as good a plan, if it arrives.
        let good = solution.r_prim < residual && gap < NEAR * solution.obj_val.abs();
        if solution.status == SolverStatus::Solved || good {
            return Ok(solution.x);
        }
        status = solution.status;
    }
    Err(failed(format!("{status:?}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(current: f64) -> PathLimits {
        PathLimits {
            current,
            velocity: None,
            acceleration: None,
            jerk: None,
            deflection: vec![None; 3],
        }
    }

    /// Another program's distances for the default drive at 2 A.
    #[test]
    fn distances_are_those_computed_elsewhere() {
        let chain = Chain::of_table_1(300.0, 0.1);
        let limits = limits(2.0);
        let prepared = Prepared::new(&chain, 2.0).unwrap();
        for (steps, distance) in [
            (40, 0.09e-3),
            (50, 0.599e-3),
            (60, 3.09e-3),
            (70, 12.52e-3),
            (78, 32.5e-3),
            (80, 40.1e-3),
            (100, 170e-3),
            (200, 1.0743),
        ] {
            let task = prepared.task(Kind::Displacement, &limits, (steps, 1e-3));
            let found = task.farthest().unwrap();
            let currents = task.currents(0.9 * found, 2).unwrap();
            assert!((found / distance - 1.0).abs() < 0.06, "{steps}: {found}");
            assert!(currents.iter().all(|i| i.abs() <= 2.0 + 1e-6));
        }
    }

    /// A stiff chain is nearly one body, whose shortest moves are known: all current one way, then the other,
    /// or a trapezium of velocity. A chain is slower, by some periods of its mode.
    #[test]
    fn a_stiff_chain_is_nearly_a_rigid_body() {
        let (mass, force, frequency, step) = ([0.06, 0.05], 6.43, 800.0, 0.25e-3);
        let reduced = mass[0] * mass[1] / (mass[0] + mass[1]);
        let angular = std::f64::consts::TAU * frequency;
        let chain = Chain {
            mass: mass.to_vec(),
            stiffness: vec![reduced * angular * angular],
            damping: vec![0.02 * reduced * angular],
            force_constant: force,
            viscous: 0.0,
            ground: Vec::new(),
        };
        let acceleration = 2.0 * force / (mass[0] + mass[1]);
        let prepared = Prepared::new(&chain, 2.0).unwrap();
        for (steps, velocity) in [(200, None), (400, None), (400, Some(1.5))] {
            let limits = PathLimits {
                velocity,
                deflection: vec![None],
                ..limits(2.0)
            };
            let rigid = |steps: f64| {
                let time = steps * step;
                let peak = 0.5 * acceleration * time;
                match velocity {
                    Some(limit) if limit < peak => limit * (time - limit / acceleration),
                    _ => 0.5 * peak * time,
                }
            };
            let task = prepared.task(Kind::Displacement, &limits, (steps, step));
            let found = task.farthest().unwrap();
            let lost = 2.0 / (frequency * step);
            let (least, most) = (rigid(steps as f64 - lost), rigid(steps as f64));
            assert!(
                found > least && found < 1.001 * most,
                "{found} {least} {most}"
            );
        }
    }

    /// A change of velocity: the impulse of all current is the most there is.
    #[test]
    fn a_change_of_velocity_is_nearly_all_current() {
        let chain = Chain::of_table_1(300.0, 0.1);
        let limits = limits(2.0);
        let prepared = Prepared::new(&chain, 2.0).unwrap();
        let total: f64 = chain.mass.iter().sum();
        for steps in [100, 200, 400] {
            let task = prepared.task(Kind::Change, &limits, (steps, 1e-3));
            let found = task.farthest().unwrap();
            let impulse = |steps: f64| 2.0 * chain.force_constant / total * steps * 1e-3;
            // To bring the springs to rest costs less than two periods of the slowest mode.
            let slowest = 1e3 / chain.modes()[0].frequency_hz;
            let least = impulse(steps as f64 - 2.0 * slowest);
            assert!(
                found < 1.001 * impulse(steps as f64) && found > least,
                "{steps}: {found}"
            );
        }
    }
}
