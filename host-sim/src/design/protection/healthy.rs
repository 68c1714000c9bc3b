//! What machines near the description show in planned moves, and when they are kicked: what no fault may be seen in.
//!
//! Springs 30 %, last load 30 % and force constant 10 % off, each way and all together, make eight machines; a ninth is
//! as described, but its current comes [`LATE`] periods after the command, as current loops are. How they
//! differ from the motion `x` of the model under a plan's current is linear, observers and feedback included:
//!
//! ```text
//! δ⁺ = A' δ + b' i + (A' − A) x + b' i'_ff − b i_ff          i = drive(δ_a + x_a − x_ref,a)
//! ```
//!
//! with `A', b'` of the machine, `A, b` of the model and `i'_ff` the plan's current as it flows (what the feedback gives
//! is small beside it, and taken as if it were in time); between the rows of the table the reference `x_ref` is not
//! quite the model's motion. Disturbance, innovation and distance from the plan are looked
//! at over some plans of the table at full size; by the largest of them, times a margin and less what is allowed at rest,
//! over the plan's force of late, the limits go further in a move ([`ModelError`](arso_core::protection::ModelError)).
//! Never further than [`MOST`], which a drive with a loop near the brink would need, and which protects it no more.

use crate::chain::Chain;
use crate::design::Design;
use crate::design::drive_loop::{Compensation, DriveLoop};
use crate::design::plans::PlanTable;
use crate::design::player::player;
use crate::error::Result;
use crate::linear::zoh::zero_order_hold;
use arso_core::{Place, Request, Velocity};
use nalgebra::{DMatrix, DVector, RowDVector};

/// By how much springs, last load and force constant differ.
const DIFFERENCES: [f64; 3] = [0.3, 0.3, 0.1];
/// By how many periods the current comes late.
const LATE: f64 = 0.5;
/// What is found is allowed so many times.
const MARGIN: f64 = 1.5;
/// Most by which disturbance and innovation may go further, over the plan's force.
const MOST: [f64; 2] = [0.5, 0.9];
/// Plans that are looked at, besides the change of velocity, and periods of the slowest mode after each.
const PLANS: usize = 6;
const AFTER: f64 = 3.0;
/// A kick on any mass: share of the motor's force, and s.
const KICK: (f64, f64) = (0.5, 5e-3);
/// How long is waited for its largest effect, in periods of the slowest mode.
const SEEN_WITHIN: f64 = 2.0;

/// What they need.
#[derive(Clone, Debug, PartialEq)]
pub struct Healthy {
    /// Distance from the plan at rest, m.
    pub tracking_error: f64,
    /// By how much disturbance, innovation and distance from the plan may be larger in a move, over the plan's
    /// force: 1, 1, m/N.
    pub model_error: [f64; 3],
}

/// A machine under the drive's loop, as it differs from its plan.
struct Machine {
    closed: DMatrix<f64>,
    /// What a plan leaves unexplained of states of the plant, per state and per A of it, and per A of the period before.
    by_state: DMatrix<f64>,
    by_current: DVector<f64>,
    by_last_current: DVector<f64>,
    /// Of the measured position, per m.
    measured: DVector<f64>,
    /// Per N on each mass.
    by_force: Vec<DVector<f64>>,
    /// Disturbance, innovation, distance.
    watched: [RowDVector<f64>; 3],
}

impl Healthy {
    /// Looks at the plans of a design; where it has none, only what a kick does is known.
    #[must_use]
    pub fn new(design: &Design) -> Self {
        let model = model(design);
        let machines = machines(design, &model);
        let mut healthy = Self::without_plans(design, &machines);
        let Ok(plans) = design.plans() else {
            return healthy;
        };
        let [disturbance, innovation] = super::forces(design);
        let tracking_error = design.drive.protection.tracking_error;
        let base = [
            disturbance,
            innovation,
            tracking_error.unwrap_or(healthy.tracking_error),
        ];
        let mut needed = [0.0_f64; 3];
        for (request, periods) in chosen(design, plans) {
            let Ok(plan) = Played::new(design, &model, request, periods) else {
                return healthy;
            };
            for machine in &machines {
                let more = machine.plays(&plan, base);
                for (needed, more) in needed.iter_mut().zip(more) {
                    *needed = needed.max(more);
                }
            }
        }
        let most = healthy.model_error;
        // Written so that what is no number becomes the most.
        healthy.model_error = std::array::from_fn(|i| {
            if needed[i] < most[i] {
                needed[i]
            } else {
                most[i]
            }
        });
        healthy
    }

    /// As wide as limits ever are.
    #[must_use]
    pub fn widest(design: &Design) -> Self {
        Self::without_plans(design, &machines(design, &model(design)))
    }

    fn without_plans(design: &Design, machines: &[Machine]) -> Self {
        let drive = &design.drive;
        let force = drive.actuator.largest_force();
        let kicked = machines.iter().map(|machine| machine.kicked(design, force));
        let kick = MARGIN * kicked.fold(0.0, f64::max);
        // What the feedback alone holds against the most friction that there may be.
        let gain = design.regulator[0] * design.chain.force_constant;
        let stuck = 2.0 * design.motion.most_friction / gain.abs();
        let tracking_error = kick + stuck + design.motion.settling_tolerance;
        let wide = super::velocity(design) * slowest(design);
        let tracking_error = if tracking_error < wide {
            tracking_error
        } else {
            wide
        };
        Self {
            tracking_error,
            model_error: [MOST[0], MOST[1], wide / force],
        }
    }
}

/// Period of the slowest mode, s.
fn slowest(design: &Design) -> f64 {
    let modes = design.modes();
    modes.first().map_or(1.0, |mode| 1.0 / mode.frequency_hz)
}

/// Some plans from the shortest to the longest and the change of velocity, all at full size: what they are asked for
/// by, and their periods.
fn chosen(design: &Design, plans: &PlanTable) -> Vec<(Request, usize)> {
    let table = plans.plans();
    let all = table.displacements;
    let last = all.len().saturating_sub(1);
    let mut numbers: Vec<usize> = (0..PLANS).map(|i| i * last / (PLANS - 1)).collect();
    numbers.dedup();
    let resolution = design.drive.encoder.resolution;
    let periods = |knots: u16| usize::from(knots) * usize::from(table.stride);
    let plans = numbers.into_iter().filter_map(|number| all.get(number));
    let mut chosen: Vec<(Request, usize)> = plans
        .map(|plan| {
            let place = Place((f64::from(plan.reach) / resolution) as i64);
            (Request::Move(place), periods(plan.knots))
        })
        .collect();
    let change = table.change;
    chosen.push((Request::Jog(Velocity(change.reach)), periods(change.knots)));
    chosen
}

/// The chain that plans are made for, sampled.
type Model = (Chain, DMatrix<f64>, DVector<f64>);

/// The one of a design: viscous friction is fed forward beside plans.
fn model(design: &Design) -> Model {
    let chain = design.chain.without_ground();
    let period = design.drive.control.sample_time;
    let (ad, bd) = zero_order_hold(&chain.a(), &chain.b(), period);
    (chain, ad, bd)
}

/// A plan period by period, and for some time after it.
struct Played {
    /// The model's state, and by how much its actuator is beyond the reference, m.
    motion: Vec<(DVector<f64>, f64)>,
    /// A.
    currents: Vec<f64>,
    /// The plan's force of late, N.
    planned: Vec<f64>,
}

impl Played {
    fn new(design: &Design, model: &Model, request: Request, periods: usize) -> Result<Self> {
        let (_, ad, bd) = model;
        let slowest = slowest(design) / design.drive.control.sample_time;
        let forgets = (-1.0 / slowest).exp();
        let mut player = player(design)?;
        player.ask(request);
        let (mut motion, mut currents, mut planned) = (Vec::new(), Vec::new(), Vec::new());
        let mut state = DVector::zeros(bd.len());
        let mut force = 0.0_f64;
        for _ in 0..periods + (AFTER * slowest) as usize {
            let instant = player.step()?;
            let current = instant.feed_forward;
            force = (forgets * force).max((design.chain.force_constant * current).abs());
            let next = ad * &state + bd * current;
            let beyond = state[0] - instant.state[0];
            motion.push((std::mem::replace(&mut state, next), beyond));
            currents.push(current);
            planned.push(force);
        }
        Ok(Self {
            motion,
            currents,
            planned,
        })
    }
}

/// The machines that are looked at.
fn machines(design: &Design, model: &Model) -> Vec<Machine> {
    let period = design.drive.control.sample_time;
    let drive = DriveLoop::new(design, Compensation::Follows);
    let (model, ad, bd) = model;
    let machine = |signs: [f64; 3], late: f64| {
        let [springs, last, force] = std::array::from_fn(|i| 1.0 + signs[i] * DIFFERENCES[i]);
        let mut chain = model.clone();
        for stiffness in &mut chain.stiffness {
            *stiffness *= springs;
        }
        if let Some(mass) = chain.mass.last_mut() {
            *mass *= last;
        }
        chain.force_constant *= force;
        let (other_ad, other_bd) = zero_order_hold(&chain.a(), &chain.b(), period);
        let by_force = (0..chain.mass.len())
            .map(|mass| zero_order_hold(&chain.a(), &chain.force_input(mass), period).1);
        let n = bd.len();
        let [found, innovation] = drive.watched(n);
        let mut distance = RowDVector::zeros(found.len());
        distance[0] = 1.0;
        Machine {
            closed: drive.closed(&other_ad, &other_bd),
            measured: drive.measured(&other_bd),
            by_state: &other_ad - ad,
            by_current: &other_bd * (1.0 - late) - bd,
            by_last_current: &other_bd * late,
            by_force: by_force.collect(),
            watched: [found, innovation, distance],
        }
    };
    let signs = [-1.0, 1.0];
    let mut machines = vec![machine([0.0; 3], LATE)];
    for springs in signs {
        for last in signs {
            for force in signs {
                machines.push(machine([springs, last, force], 0.0));
            }
        }
    }
    machines
}

impl Machine {
    /// By how much what is watched has to be allowed to go beyond `base`, over the plan's force, in a plan at full
    /// size and after it.
    fn plays(&self, plan: &Played, base: [f64; 3]) -> [f64; 3] {
        let mut state = DVector::zeros(self.closed.nrows());
        let mut after = state.clone();
        let (mut needed, mut last_current) = ([0.0_f64; 3], 0.0);
        let inputs = plan.currents.iter().zip(&plan.planned);
        for ((motion, beyond), (current, planned)) in plan.motion.iter().zip(inputs) {
            for (i, row) in self.watched.iter().enumerate() {
                let value = row.transpose().dot(&state) + row[0] * beyond;
                let more = MARGIN * value.abs() - base[i];
                if more > 0.0 {
                    needed[i] = needed[i].max(more / planned);
                }
            }
            after.gemv(1.0, &self.closed, &state, 0.0);
            after.axpy(*beyond, &self.measured, 1.0);
            let mut of_plant = after.rows_mut(0, motion.len());
            of_plant.gemv(1.0, &self.by_state, motion, 1.0);
            of_plant.axpy(*current, &self.by_current, 1.0);
            of_plant.axpy(last_current, &self.by_last_current, 1.0);
            last_current = *current;
            std::mem::swap(&mut state, &mut after);
        }
        needed
    }

    /// How far a kick on any of the masses takes it from where it stands, m.
    fn kicked(&self, design: &Design, force: f64) -> f64 {
        let period = design.drive.control.sample_time;
        let periods = (SEEN_WITHIN * slowest(design) / period) as usize;
        let mut farthest = 0.0_f64;
        for by_force in &self.by_force {
            let mut state = DVector::zeros(self.closed.nrows());
            let mut after = state.clone();
            for k in 0..periods {
                after.gemv(1.0, &self.closed, &state, 0.0);
                // What is left of the kick in this period.
                let share = (KICK.1 / period - k as f64).clamp(0.0, 1.0);
                let newton = share * KICK.0 * force;
                after
                    .rows_mut(0, by_force.len())
                    .axpy(newton, by_force, 1.0);
                std::mem::swap(&mut state, &mut after);
                farthest = farthest.max(state[0].abs());
            }
        }
        farthest
    }
}
