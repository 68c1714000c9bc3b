//! The planned moves of a drive: which there are, how long they take, and the table the core plays.
//!
//! ```text
//! limits of the drive file -> grid of durations -> transfers (chain::transfer) -> columns, rounded -> Plans
//! ```
//!
//! **The grid.** A plan of `n` steps serves every distance up to its reach, scaled. A distance gets the first
//! plan that reaches it, so what is lost against the shortest possible move is the way from one duration to
//! the next: one step and [`LOSS`] of the duration. Of that a step is the plan's own: it is made for the
//! distance that one step less would reach, which leaves it room to be smooth.
//!
//! **Limits.** The current is `share` of the drive's, less what friction takes at the velocity limit and what
//! carries the machine. Plans go to the travel, or as far as the table has room, but at least to where a change of
//! velocity to the velocity limit and back no longer overlap. Beyond, the drive cruises between such a pair. The
//! shortest move would swing while it cruises and end when that swing helps it to brake, so what the pair loses
//! rises and falls with the distance: [`PlanTable::cruise_loss`] says how much it is at the first such distance.
//!
//! **Steps.** A step is as many control periods as the fastest mode can be seen with (`PER_PERIOD` a
//! period), and as it takes to keep the table within its size.
//!
//! What friction takes is fed forward beside the plan, viscous friction as well, so plans are made for the
//! chain without it.

use super::Design;
use crate::chain::controlled_mass;
use crate::chain::transfer::{Kind, PathLimits, Prepared, Task};
use crate::error::{Error, NoSolution, Result};
use crate::linear::zoh::zero_order_hold;
use arso_core::moves::plans::{Plan, Plans, row_words};
use crc::{CRC_32_ISO_HDLC, Crc};
use nalgebra::{DMatrix, DVector};
use std::cell::RefCell;
use std::collections::BTreeMap;

/// Checksum of the rows, and of what the firmware logs in serialised form.
pub const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What a move may take longer than the shortest possible one, beside one step: a share of it.
pub const LOSS: f64 = 0.03;
/// Steps in a period of the fastest mode, at least.
const PER_PERIOD: f64 = 20.0;
/// Most steps of a plan.
const LONGEST: usize = 2000;
/// A change of velocity is as long as it takes to come this near to the velocity limit.
const NEARLY: f64 = 0.995;

/// The plans of a drive, as the core takes them, with what is to be said of them.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanTable {
    stride: u16,
    displacements: Vec<Plan>,
    change: Plan,
    run: f32,
    bend: f32,
    rows: Vec<i16>,
    checksum: u32,
    /// Largest loss of duration against the shortest possible move, as a share of it, from one step on.
    pub loss: f64,
    /// What a move just beyond the plans loses, with a cruise between two changes of velocity, as a share; none where
    /// there is no such move.
    pub cruise_loss: Option<f64>,
}

impl PlanTable {
    /// As the core takes them.
    #[must_use]
    pub fn plans(&self) -> Plans<'_> {
        Plans {
            stride: self.stride,
            displacements: &self.displacements,
            change: self.change,
            run: self.run,
            bend: self.bend,
            rows: &self.rows,
            checksum: self.checksum,
        }
    }

    /// Bytes of the table in the drive's memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.rows[..]) + (self.displacements.len() + 1) * size_of::<Plan>()
    }

    /// Duration of a move from rest to rest, control periods.
    #[must_use]
    pub fn duration(&self, distance: f64, sample_time: f64) -> f64 {
        let stride = f64::from(self.stride);
        let displacement = self
            .displacements
            .iter()
            .find(|plan| f64::from(plan.reach) >= distance.abs());
        if let Some(plan) = displacement {
            return f64::from(plan.knots) * stride;
        }
        cruising(
            distance,
            f64::from(self.change.reach) * sample_time,
            f64::from(self.change.knots) * stride,
        )
    }
}

/// Duration of a move by a change of velocity and the opposite one, which do not overlap; control periods.
///
/// * `displacement`: in a period of the cruise
/// * `change`: duration of one
fn cruising(distance: f64, displacement: f64, change: f64) -> f64 {
    (distance.abs() / displacement).ceil().max(change) + change
}

/// The limits that plans keep.
///
/// # Errors
/// [`Error::Design`] when friction and holding force leave no current.
pub fn path_limits(design: &Design) -> Result<PathLimits> {
    let (drive, motion) = (&design.drive, &design.motion);
    let actuator = &drive.actuator;
    let friction = drive.friction.coulomb + drive.viscous() * motion.velocity;
    let taken = (friction + actuator.holding_force.abs()) / design.chain.force_constant;
    let current = motion.current_share * actuator.current_limit - taken;
    if current <= 0.0 {
        return Err(Error::Design(format!(
            "friction at the velocity limit of planned moves and the holding force take {taken:.3} A, all \
             that move.current_share leaves of the current limit: a lower move.velocity leaves more"
        )));
    }
    Ok(PathLimits {
        current,
        velocity: Some(motion.velocity),
        acceleration: motion.acceleration,
        jerk: motion.jerk,
        deflection: match &motion.deflection {
            Some(deflection) => deflection.iter().map(|limit| Some(*limit)).collect(),
            None => vec![None; design.loads()],
        },
    })
}

/// A plan before it is rounded.
struct Made {
    currents: Vec<f64>,
    scale: f64,
    /// Scale at which the first of the limits is reached.
    reach: f64,
}

/// Which plans there are to be.
struct Grid {
    /// Durations in steps, and the distance each is made for.
    plans: Vec<(usize, f64)>,
    /// See [`PlanTable::cruise_loss`].
    cruise_loss: Option<f64>,
}

/// What all plans of a drive are made from.
struct Maker<'a> {
    design: &'a Design,
    prepared: Prepared,
    limits: PathLimits,
    step: f64,
    /// Over a step, without viscous friction.
    ad: DMatrix<f64>,
    bd: DVector<f64>,
    /// Farthest displacements already found, by their steps; none where there is none.
    farthest: RefCell<BTreeMap<usize, Option<f64>>>,
}

/// The plans of a design.
///
/// # Errors
/// [`Error::Design`] when there are none within the limits, or the solver fails.
pub fn plan_table(design: &Design) -> Result<PlanTable> {
    let limits = path_limits(design)?;
    let period = design.drive.control.sample_time;
    let fastest = design.modes().last().map_or(0.0, |mode| mode.frequency_hz);
    let mut stride = (1.0 / (PER_PERIOD * fastest * period))
        .floor()
        .clamp(1.0, 1e4) as u16;
    let row = size_of::<i16>() * row_words(design.loads());
    loop {
        let maker = Maker::new(design, limits.clone(), f64::from(stride) * period)?;
        let change = maker.change()?;
        let change_bytes = change.currents.len() * row + size_of::<Plan>();
        let room = design.motion.table.saturating_sub(change_bytes);
        // A coarser grid costs less than coarser steps, up to a point.
        for loss in [LOSS, 2.0 * LOSS, 4.0 * LOSS] {
            if let Some(grid) = maker.grid(&change, loss, (room, stride))? {
                return Ok(maker.table(stride, &grid, &change));
            }
        }
        stride = stride.checked_mul(2).ok_or_else(|| too_small(design))?;
        if f64::from(stride) * period * fastest > 0.25 {
            return Err(too_small(design));
        }
    }
}

fn too_small(design: &Design) -> Error {
    Error::Design(format!(
        "move.table = {}: its planned moves do not fit into so many bytes",
        design.motion.table
    ))
}

fn failed(error: NoSolution) -> Error {
    Error::Design(error.0)
}

impl<'a> Maker<'a> {
    fn new(design: &'a Design, limits: PathLimits, step: f64) -> Result<Self> {
        let chain = design.chain.without_ground();
        let (ad, bd) = zero_order_hold(&chain.a(), &chain.b(), step);
        Ok(Self {
            design,
            prepared: Prepared::new(&chain, limits.current).map_err(failed)?,
            limits,
            step,
            ad,
            bd,
            farthest: RefCell::default(),
        })
    }

    fn task(&self, kind: Kind, steps: usize) -> Task<'_> {
        self.prepared.task(kind, &self.limits, (steps, self.step))
    }

    /// Steps that a plan has more than the shortest to its distance.
    fn slack(steps: usize) -> usize {
        // What is lost may be one step and a share; half of the share is the plan's own.
        ((0.5 * LOSS * steps as f64 + 0.5) as usize).max(usize::from(steps > 33))
    }

    /// A plan of so many steps.
    fn made(&self, kind: Kind, steps: usize, scale: f64) -> Result<Made> {
        let controlled = controlled_mass(self.design.loads());
        let task = self.task(kind, steps);
        let currents = task.currents(scale, controlled).map_err(failed)?;
        let used = self.used(&currents);
        Ok(Made {
            reach: scale / used,
            currents,
            scale,
        })
    }

    /// The largest share of a limit that currents use, until the actuator no longer accelerates.
    fn used(&self, currents: &[f64]) -> f64 {
        let limits = &self.limits;
        let mut state = DVector::zeros(self.bd.len());
        let mut used = 0.0_f64;
        let (mut velocity, mut acceleration) = (0.0, 0.0);
        // Two steps more: what the last acceleration ends with is a jerk as well.
        for current in currents.iter().copied().chain([0.0, 0.0]) {
            state = &self.ad * &state + &self.bd * current;
            used = used.max(current.abs() / limits.current);
            let mut hold = |value: f64, limit: Option<f64>| {
                used = used.max(limit.map_or(0.0, |limit| value.abs() / limit));
            };
            let new = (state[1] - velocity) / self.step;
            hold(state[1], limits.velocity);
            hold(new, limits.acceleration);
            hold((new - acceleration) / self.step, limits.jerk);
            for (spring, limit) in limits.deflection.iter().enumerate() {
                hold(state[2 * spring + 2] - state[2 * spring], *limit);
            }
            (velocity, acceleration) = (state[1], new);
        }
        used
    }

    /// The change of velocity: the shortest that comes near to the velocity limit.
    fn change(&self) -> Result<Made> {
        let limit = self.design.motion.velocity;
        // What rounding keeps from being solved is taken for too short.
        let farthest = |steps| self.task(Kind::Change, steps).farthest().unwrap_or(0.0);
        let mut enough = self.design.chain.states();
        while farthest(enough) < NEARLY * limit {
            enough *= 2;
            if enough > LONGEST {
                return Err(Error::Design(format!(
                    "no planned move of {LONGEST} steps of {:.2e} s reaches the velocity limit of \
                     {limit}: state a lower move.velocity",
                    self.step
                )));
            }
        }
        let mut short = enough / 2;
        while enough - short > 1 {
            let middle = usize::midpoint(enough, short);
            if farthest(middle) < NEARLY * limit {
                short = middle;
            } else {
                enough = middle;
            }
        }
        let steps = enough + Self::slack(enough);
        self.made(Kind::Change, steps, NEARLY * limit)
    }

    /// How far so many steps reach within the limits; none for what rounding keeps from being solved.
    fn farthest(&self, steps: usize) -> Option<f64> {
        let mut found = self.farthest.borrow_mut();
        *found
            .entry(steps)
            .or_insert_with(|| self.task(Kind::Displacement, steps).farthest().ok())
    }

    /// Which plans there are to be; none when they do not fit.
    ///
    /// * `room`: bytes that the table has for them
    /// * `stride`: control periods of a step
    fn grid(&self, change: &Made, loss: f64, (room, stride): (usize, u16)) -> Result<Option<Grid>> {
        let drive = &self.design.drive;
        let change_steps = change.currents.len() as f64;
        let overlapping = change.reach * change_steps * self.step;
        let stride = f64::from(stride);
        let cruising = |distance: f64| {
            let displacement = change.reach * self.step / stride;
            cruising(distance, displacement, change_steps * stride) / stride
        };
        let travel = drive.protection.travel;
        let travel = travel.map_or(f64::INFINITY, |[low, high]| high - low);
        let count = drive.encoder.resolution;
        let mut plans: Vec<(usize, f64)> = Vec::new();
        let row = size_of::<i16>() * row_words(self.design.loads());
        let needed = |steps: usize| steps * row + size_of::<Plan>();
        let (mut bytes, mut cruise_loss) = (0, None);
        let mut steps = self.design.chain.states();
        loop {
            let farthest = plans.last().map_or(0.0, |(_, farthest)| *farthest);
            let fits = bytes + needed(steps) <= room;
            let far_enough = farthest >= overlapping && (!fits || steps > LONGEST);
            if farthest >= travel || far_enough {
                break;
            }
            if !fits {
                return Ok(None);
            }
            if steps > LONGEST {
                return Err(Error::Design(format!(
                    "no planned move of {LONGEST} steps of {:.2e} s gets as far as its limits would have it",
                    self.step
                )));
            }
            let own = Self::slack(steps);
            // What is too short for a count is no plan.
            if let Some(distance) = self.farthest(steps - own)
                && distance >= count
            {
                plans.push((steps, distance));
                bytes += needed(steps);
                cruise_loss = Some(cruising(distance) / (steps - own) as f64 - 1.0);
                let room = (1.0 + loss * steps as f64).floor() as usize;
                steps += room.saturating_sub(own).max(1);
            } else {
                steps += 1;
            }
        }
        let cruises = plans.last().is_none_or(|(_, farthest)| *farthest < travel);
        Ok(Some(Grid {
            plans,
            cruise_loss: cruise_loss.filter(|_| cruises),
        }))
    }

    fn table(&self, stride: u16, grid: &Grid, change: &Made) -> PlanTable {
        let mut rows = Vec::new();
        let mut displacements: Vec<Plan> = Vec::new();
        let mut loss = 0.0_f64;
        let mut shortest = None;
        for (steps, distance) in &grid.plans {
            // Without it the next one serves.
            let Ok(made) = self.made(Kind::Displacement, *steps, *distance) else {
                continue;
            };
            // Just beyond the plan before, a distance could be done in that one's own shortest time.
            if let Some(shortest) = shortest {
                loss = loss.max((*steps - 1) as f64 / shortest as f64 - 1.0);
            }
            shortest = Some(*steps - Self::slack(*steps));
            if displacements
                .last()
                .is_none_or(|plan| plan.reach < reach(&made))
            {
                displacements.push(self.columns(&made, Kind::Displacement, &mut rows).0);
            }
        }
        let (change, run) = self.columns(change, Kind::Change, &mut rows);
        let bytes: Vec<u8> = rows.iter().flat_map(|word| word.to_le_bytes()).collect();
        PlanTable {
            checksum: CHECKSUM.checksum(&bytes),
            stride,
            displacements,
            change,
            run: run as f32,
            bend: (0.25 * self.design.chain.b()[1] * self.step * self.step) as f32,
            rows,
            loss,
            cruise_loss: grid.cruise_loss,
        }
    }

    /// The rows of a plan, for a scale of one, and how far a mass comes in it.
    fn columns(&self, made: &Made, kind: Kind, rows: &mut Vec<i16>) -> (Plan, f64) {
        let n = self.bd.len();
        let loads = n / 2 - 1;
        let steps = made.currents.len();
        let mut states = vec![DVector::zeros(n)];
        for current in &made.currents {
            let unit = current / made.scale;
            let last = states
                .last()
                .map_or_else(|| DVector::zeros(n), |state| &self.ad * state);
            states.push(last + &self.bd * unit);
        }
        let run = states.last().map_or(0.0, |state| state[0]);
        let position = |step: usize| {
            let to_come = (steps - step) as f64 * self.step;
            match kind {
                Kind::Displacement => states[step][0] - 1.0,
                Kind::Change => states[step][0] - run + to_come,
            }
        };
        let deflection = |step: usize, load: usize| states[step][2 * load + 2] - states[step][0];
        let unit = |values: &mut dyn Iterator<Item = f64>, most: f64| {
            let largest = values.fold(0.0_f64, |most, value| most.max(value.abs()));
            (largest / most).max(f64::from(f32::MIN_POSITIVE)) as f32
        };
        let word = f64::from(i16::MAX);
        let units = [
            unit(
                &mut made.currents.iter().map(|current| current / made.scale),
                word,
            ),
            unit(
                &mut (0..steps).map(position),
                f64::from(i32::MAX - (1 << 16)),
            ),
            unit(
                &mut (0..steps * loads).map(|i| deflection(i / loads, i % loads)),
                word,
            ),
        ];
        let [feed_forward, of_position, of_deflection] = units.map(f64::from);
        let first = (rows.len() / row_words(loads)) as u32;
        for (step, current) in made.currents.iter().enumerate() {
            let places = (position(step) / of_position).round() as i32;
            rows.push((current / made.scale / feed_forward).round() as i16);
            rows.extend([(places >> 16) as i16, places as i16]);
            let deflections = (0..loads).map(|load| deflection(step, load) / of_deflection);
            rows.extend(deflections.map(|words| words.round() as i16));
        }
        let [feed_forward, position, deflection] = units;
        let plan = Plan {
            first,
            knots: steps as u16,
            reach: reach(made),
            feed_forward,
            position,
            deflection,
        };
        (plan, run)
    }
}

/// As the core takes it: no rounding makes it more than the limit.
fn reach(made: &Made) -> f32 {
    (made.reach * (1.0 - 1e-6)) as f32
}
