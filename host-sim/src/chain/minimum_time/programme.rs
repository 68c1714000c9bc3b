//! The linear programme: how far a horizon reaches.
//!
//! With `z` the distance of every state from where it is to be, `i` the current over its limit and `r` the
//! reach,
//!
//! ```text
//! largest r    z_0 = r z_start,  z_{k+1} = F z_k + G i_k,  z_end = 0,  |i_k| <= 1
//!              |x_k| <= r band    in every period from settling on
//! ```
//!
//! The chain is linear, so the task itself can be done where `r` is 1 or more. Asked this way there is always
//! an answer (nothing moves, `r = 0`), which there is not where it is asked whether the task can be done. The
//! states are unknowns of their own: the programme is long and thin, its effort grows with the horizon and no
//! faster, and no power of `F` is formed.

use crate::chain::modal::Modal;
use crate::chain::rows::Rows;
use crate::error::NoSolution;
use crate::linear::Result;
use crate::linear::zoh::zero_order_hold;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{DMatrix, DVector, RowDVector};

/// More reach than this is not told apart.
const MOST: f64 = 4.0;

/// How often the band is looked at in a hold at most.
const LOOKS: usize = 8;

/// Regularisations of the solver's equations that are tried in turn. Its own of 1e-8 is too little for these
/// long and thin programmes, which it then gives up one in six times.
const REGULARIZATIONS: [f64; 2] = [1e-7, 1e-6];

/// How well a reach near one must be known where the solver gives up, over the reach.
const ROUGH: f64 = 0.02;

/// The holds of the current.
pub(super) struct Horizon {
    /// Length of each, control periods.
    holds: Vec<usize>,
    /// After which of them the band must be kept.
    settled: usize,
}

impl Horizon {
    /// * `time`: to rest, periods; `hold`: length of all holds but the first, which takes what is left over
    pub(super) fn to_rest(time: usize, hold: usize) -> Self {
        let first = time % hold;
        let mut holds = vec![hold; time / hold + usize::from(first > 0)];
        if first > 0 {
            holds[0] = first;
        }
        let settled = holds.len();
        Self { holds, settled }
    }

    /// * `time`: to settling, periods; `free`: from there to rest
    pub(super) fn to_settle(time: usize, hold: usize, free: usize) -> Self {
        let mut horizon = Self::to_rest(time, hold);
        let after = free.div_ceil(hold);
        horizon.holds.extend(std::iter::repeat_n(hold, after));
        horizon
    }

    /// Control periods until the band must be kept.
    fn settled_after(&self) -> usize {
        self.holds[..self.settled].iter().sum()
    }
}

/// A task in modal coordinates.
pub(super) struct Programme<'a> {
    pub(super) modal: &'a Modal,
    /// Distance from the target.
    pub(super) start: DVector<f64>,
    /// The controlled mass's position from the state.
    pub(super) output: RowDVector<f64>,
    /// Half width of its band, m.
    pub(super) band: f64,
    /// What it moves by, m.
    pub(super) span: f64,
    /// s.
    pub(super) period: f64,
}

/// What one hold of the current does.
struct Hold {
    periods: usize,
    f: DMatrix<f64>,
    g: DVector<f64>,
    /// Output in each period within it, from state and current at its beginning.
    within: Vec<(RowDVector<f64>, f64)>,
}

impl Programme<'_> {
    /// How much of the task can be done within a horizon: 1 is all of it, more than [`MOST`] is [`MOST`].
    ///
    /// # Errors
    /// [`NoSolution`] when the solver fails.
    pub(super) fn reach(&self, horizon: &Horizon) -> Result<f64> {
        Ok(self.solve(horizon)?.0)
    }

    /// The same, and the current over its limit in each period that reaches so far.
    pub(super) fn solve(&self, horizon: &Horizon) -> Result<(f64, Vec<f64>)> {
        let steps = horizon.holds.len();
        let scale = self
            .modal
            .scale(horizon.settled_after() as f64 * self.period);
        let start = self.start.component_div(&scale);
        let output = RowDVector::from_fn(scale.len(), |_, state| {
            self.output[state] * scale[state] / self.span
        });
        let band = self.band / self.span;
        let holds = self.holds(horizon, &scale, &output);
        let of = |step: usize| {
            let periods = horizon.holds[step];
            holds.iter().find(|hold| hold.periods == periods)
        };

        // Unknowns: reach, currents, states after each hold but the last (zero) and before the first (the
        // start times the reach).
        let n = scale.len();
        let current = |step: usize| 1 + step;
        let state = |step: usize, element: usize| 1 + steps + (step - 1) * n + element;
        let unknowns = 1 + steps + n * (steps - 1);
        let at_start = start.as_slice();
        // A row of a matrix times the state before a hold.
        let times_state = |row: &mut dyn Iterator<Item = f64>, step: usize| -> Vec<(usize, f64)> {
            if step == 0 {
                let sum: f64 = row.zip(at_start).map(|(value, z)| value * z).sum();
                vec![(0, sum)]
            } else {
                row.enumerate()
                    .map(|(element, value)| (state(step, element), value))
                    .collect()
            }
        };

        let mut rows = Rows::default();
        for step in 0..steps {
            let Some(hold) = of(step) else { continue };
            for element in 0..n {
                let mut entries = times_state(&mut hold.f.row(element).iter().copied(), step);
                entries.push((current(step), hold.g[element]));
                if step + 1 < steps {
                    entries.push((state(step + 1, element), -1.0));
                }
                rows.add(entries, 0.0);
            }
        }
        let equalities = rows.count();
        rows.add([(0, 1.0)], MOST);
        for step in 0..steps {
            rows.add([(current(step), 1.0)], 1.0);
            rows.add([(current(step), -1.0)], 1.0);
        }
        for step in horizon.settled..steps {
            let Some(hold) = of(step) else { continue };
            for (row, input) in &hold.within {
                for sign in [1.0, -1.0] {
                    let mut entries = times_state(&mut row.iter().map(|value| sign * value), step);
                    entries.push((current(step), sign * input));
                    entries.push((0, -band));
                    // Counted in bands: in spans the solver would lose figures.
                    let entries = entries.into_iter();
                    rows.add(entries.map(|(column, value)| (column, value / band)), 0.0);
                }
            }
        }

        let inequalities = rows.count() - equalities;
        let (a, right) = rows.into_matrix(unknowns);
        let mut objective = vec![0.0; unknowns];
        objective[0] = -1.0;
        let (reach, solution) = solve(
            &objective,
            &a,
            &right,
            &[
                SupportedConeT::ZeroConeT(equalities),
                SupportedConeT::NonnegativeConeT(inequalities),
            ],
        )?;
        let held = horizon.holds.iter().enumerate();
        let currents =
            held.flat_map(|(step, periods)| std::iter::repeat_n(solution[current(step)], *periods));
        Ok((reach, currents.collect()))
    }

    /// Every kind of hold that a horizon has.
    fn holds(
        &self,
        horizon: &Horizon,
        scale: &DVector<f64>,
        output: &RowDVector<f64>,
    ) -> Vec<Hold> {
        let (a, b) = self.modal.scaled(scale);
        let mut lengths = horizon.holds.clone();
        lengths.sort_unstable();
        lengths.dedup();
        let each = lengths.into_iter().map(|periods| {
            let (f, g) = zero_order_hold(&a, &b, periods as f64 * self.period);
            // Where the band is looked at: in every period of a short hold, evenly spread in a long one.
            let apart = periods.div_ceil(LOOKS);
            let (f1, g1) = zero_order_hold(&a, &b, apart as f64 * self.period);
            let mut within = vec![(output.clone(), 0.0)];
            for _ in 1..periods.div_ceil(apart) {
                let Some((row, input)) = within.last() else {
                    break;
                };
                within.push((row * &f1, input + (row * &g1).x));
            }
            Hold {
                periods,
                f,
                g,
                within,
            }
        });
        each.collect()
    }
}

/// The reach and the unknowns of a cone programme.
fn solve(
    objective: &[f64],
    a: &CscMatrix<f64>,
    right: &[f64],
    cones: &[SupportedConeT<f64>],
) -> Result<(f64, Vec<f64>)> {
    let failed = |why: String| {
        let what = "the linear programme of the least time was not solved";
        NoSolution(format!("{what}: {why}"))
    };
    let quadratic = CscMatrix::zeros((objective.len(), objective.len()));
    let mut status = SolverStatus::Unsolved;
    for regularization in REGULARIZATIONS {
        let settings = DefaultSettings {
            verbose: false,
            max_threads: 1,
            static_regularization_constant: regularization,
            ..DefaultSettings::default()
        };
        let solver = DefaultSolver::new(&quadratic, objective, a, right, cones, settings);
        let mut solver = solver.map_err(|error| failed(error.to_string()))?;
        solver.solve();
        let solution = solver.solution;
        if solution.status == SolverStatus::Solved {
            return Ok((-solution.obj_val, solution.x));
        }
        // Rounding keeps some programmes from being solved to the last figure. The reach lies between what the
        // solution and its dual say; where that is known well enough, the least of it is taken.
        let (primal, dual) = (-solution.obj_val, -solution.obj_val_dual);
        let residual = solution.r_prim.max(solution.r_dual);
        let error = 3.0 * (primal - dual).abs() + 100.0 * residual;
        let reach = primal.min(dual) - error;
        let far = primal.max(dual) + error < 0.5 || reach > 2.0;
        if far || error < ROUGH * reach {
            return Ok((reach, solution.x));
        }
        status = solution.status;
    }
    Err(failed(format!("{status:?}")))
}
