//! The planned moves against what is known without them: the least time of a motion, and the plant of the
//! reference implementation under the currents that the core plays.

use arso_core::moves::plans::Plan;
use arso_core::moves::{Memory, Moves, Reference};
use arso_core::{Place, Request, Velocity};
use arso_tests::drives;
use arso_tests::reference::{ReferenceDrive, ReferencePlant};
use host_sim::chain::controlled_mass;
use host_sim::chain::minimum_time::{Task, minimum_time};
use host_sim::chain::transfer::{Kind, PathLimits, Prepared};
use host_sim::design::Design;
use host_sim::design::plans::path_limits;
use host_sim::drive::Drive;
use host_sim::simulate::scenario::SCENARIOS;

fn design(drive: &Drive) -> Design {
    Design::new(drive).unwrap()
}

/// Within one period and 3 % of the shortest move under the same limits from 1 µm to 0.2 m, as far as the table has
/// plans. Beyond, it cruises between two changes of velocity, and the shortest move may swing meanwhile: 0.3 m and 1 m
/// within 10 %.
#[test]
fn moves_of_every_distance_are_nearly_the_shortest() {
    let design = design(&Drive::default_drive());
    let period = design.drive.control.sample_time;
    let table = design.plans().unwrap();
    let limits = path_limits(&design).unwrap();
    let prepared = Prepared::new(&design.chain, limits.current).unwrap();
    let plans = table.plans();
    let farthest = f64::from(plans.displacements.last().unwrap().reach);
    assert!(farthest > 0.2 && table.bytes() <= design.motion.table);
    let mut missed = Vec::new();
    for distance in [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 3e-2, 0.1, 0.14, 0.2, 0.3, 1.0] {
        let taken = table.duration(distance, period);
        let allowed = if distance > farthest { 1.1 } else { 1.03 };
        let least = ((taken - 1.0) / allowed - 1e-9).ceil() as usize;
        // One period less than what would do does not do.
        let task = prepared.task(Kind::Displacement, &limits, (least - 1, period));
        let reached = task.farthest().unwrap();
        if reached >= distance {
            missed.push((distance, taken, reached));
        }
    }
    assert_eq!(missed, []);
}

/// Where the current alone binds, so says the programme of the bound.
#[test]
fn moves_that_only_the_current_limits_are_nearly_the_bound() {
    let design = design(&Drive::default_drive());
    let period = design.drive.control.sample_time;
    let table = design.plans().unwrap();
    let limits = path_limits(&design).unwrap();
    for distance in [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 3e-2] {
        let bound = minimum_time(&Task {
            chain: &design.chain,
            start: &SCENARIOS[0].initial_state(&design.chain),
            target: distance,
            current_limit: limits.current,
            period,
            controlled: controlled_mass(design.loads()),
            band: 0.02,
        });
        let least = (bound.unwrap().rest / period).round();
        let taken = table.duration(distance, period);
        assert!(
            (least - 1.0..=1.03 * least + 1.0).contains(&taken),
            "{distance} m: {taken} periods, bound {least}"
        );
    }
}

/// State after one, two, … steps of a plant that a current of 1 A moved in the first.
fn responses(drive: &ReferenceDrive, steps: usize, step: f64) -> Vec<Vec<f64>> {
    let mut plant = ReferencePlant::new(drive, &vec![0.0; 2 * drive.loads() + 2]);
    let each = (0..steps).map(|number| {
        plant.advance(if number == 0 { 1.0 } else { 0.0 }, step, 1);
        plant.state.clone()
    });
    each.collect()
}

/// What is limited, of a state and those of the two steps before: velocity, acceleration and jerk of the
/// actuator, deflections.
fn limited(states: [&[f64]; 3], step: f64) -> Vec<f64> {
    let [now, before, earlier] = states.map(|state| state[1]);
    let mut values = vec![
        now,
        (now - before) / step,
        (now - 2.0 * before + earlier) / step.powi(2),
    ];
    let places: Vec<f64> = states[0].iter().step_by(2).copied().collect();
    values.extend(places.windows(2).map(|pair| pair[1] - pair[0]));
    values
}

/// The limits of what [`limited`] gives.
fn bounds(limits: &PathLimits) -> Vec<f64> {
    let kinematic = [limits.velocity, limits.acceleration, limits.jerk];
    let all = kinematic.iter().chain(&limits.deflection);
    all.map(|limit| limit.unwrap_or(f64::INFINITY)).collect()
}

/// Moves as the core plays them, and the plant under their current alone.
struct Played<'d, const N: usize> {
    moves: Moves<'d>,
    memory: Memory<N>,
    asked: Option<Request>,
    target: Place,
    plant: ReferencePlant,
    design: &'d Design,
    /// Periods of a step of the plans.
    stride: usize,
    /// At the beginning of each step, and the current in each period.
    states: Vec<Vec<f64>>,
    currents: Vec<f64>,
    /// Largest distance from the reference, of the actuator and of a deflection, m.
    off: (f64, f64),
}

impl<'d, const N: usize> Played<'d, N> {
    fn new(design: &'d Design) -> Self {
        let drive = &design.drive;
        let plans = design.plans().unwrap().plans();
        let (period, resolution) = (drive.control.sample_time, drive.encoder.resolution);
        Self {
            moves: Moves::new(plans, period as f32, resolution as f32),
            memory: Memory::default(),
            asked: None,
            target: Place(0),
            plant: ReferencePlant::new(&drives::reference(design).0, &vec![0.0; 2 * N + 2]),
            design,
            stride: plans.stride.into(),
            states: Vec::new(),
            currents: Vec::new(),
            off: (0.0, 0.0),
        }
    }

    fn step(&mut self) -> bool {
        self.advance().0
    }

    /// One period: whether all rests, and the reference.
    fn advance(&mut self) -> (bool, Reference<N>) {
        let drive = &self.design.drive;
        let directed = self
            .moves
            .direct(&mut self.memory, &mut self.asked, self.target, None);
        self.target = directed.unwrap();
        let reference = self.moves.step(&mut self.memory);
        // Between its steps a plan is not exact.
        if self.currents.len().is_multiple_of(self.stride) {
            let state = self.plant.state.clone();
            let place = self.target.0 as f64 * drive.encoder.resolution;
            let off = state[0] - place - f64::from(reference.position.0);
            self.off.0 = self.off.0.max(off.abs());
            for (load, deflection) in reference.deflection.iter().enumerate() {
                let off = state[2 * load + 2] - state[0] - f64::from(*deflection);
                self.off.1 = self.off.1.max(off.abs());
            }
            self.states.push(state);
        }
        let current = f64::from(reference.feed_forward.0);
        self.currents.push(current);
        self.plant.advance(current, drive.control.sample_time, 1);
        (reference.rests, reference)
    }

    /// Plays a request to its end, and two periods more.
    fn play(&mut self, request: Request) {
        self.asked = Some(request);
        while !self.step() {
            assert!(self.currents.len() < 10_000, "{request:?} does not end");
        }
        self.step();
    }

    /// No limit is broken, and the machine rests at the target, but for what rounding the table explains.
    ///
    /// * `plan`, `scale`: of which the currents are rounded
    fn check(&self, what: &str, plan: &Plan, scale: f64) {
        let (reference, _, _) = drives::reference(self.design);
        let limits = path_limits(self.design).unwrap();
        let step = reference.sample_time * self.stride as f64;
        let largest = self.currents.iter().fold(0.0_f64, |a, i| a.max(i.abs()));
        // Half a unit of the table, and the products in f32.
        let each = 0.5 * scale.abs() * f64::from(plan.feed_forward)
            + largest * 4.0 * f64::from(f32::EPSILON);
        assert!(largest <= limits.current + each, "{what}: {largest} A");

        let responses = responses(&reference, self.states.len(), step);
        let rest = vec![0.0; 2 * N + 2];
        let at = |states: &[Vec<f64>], k: usize, back: usize| -> Vec<f64> {
            k.checked_sub(back)
                .map_or(rest.clone(), |k| states[k].clone())
        };
        let values = |states: &[Vec<f64>], k: usize| {
            let [now, before, earlier] = [0, 1, 2].map(|back| at(states, k, back));
            limited([&now, &before, &earlier], step)
        };
        let bounds = bounds(&limits);
        let mut explained = vec![0.0; bounds.len()];
        let mut explained_state = vec![0.0; rest.len()];
        for k in 0..self.states.len() {
            for (number, value) in values(&self.states, k).iter().enumerate() {
                let most = bounds[number] + explained[number];
                assert!(value.abs() <= most, "{what}: {number} is {value} > {most}");
            }
            for (sum, value) in explained.iter_mut().zip(values(&responses, k)) {
                *sum += each * value.abs();
            }
            for (sum, value) in explained_state.iter_mut().zip(&responses[k]) {
                *sum += each * value.abs();
            }
        }
        let place = self.target.0 as f64 * self.design.drive.encoder.resolution;
        // Scale and products in f32; a jog's line is kept in 256ths of a count.
        let scale_rounded = 4.0 * f64::from(f32::EPSILON) * place.abs()
            + self.design.drive.encoder.resolution / 256.0;
        for (element, value) in self.plant.state.iter().enumerate() {
            let off = value - if element % 2 == 0 { place } else { 0.0 };
            let most = explained_state[element] + scale_rounded;
            assert!(
                off.abs() <= most,
                "{what}: {element} is off by {off} > {most}"
            );
        }
        let rounded = |unit: f32| scale.abs() * f64::from(unit);
        let most = explained_state[0] + scale_rounded + rounded(plan.position);
        assert!(self.off.0 <= most, "{what}: {} > {most}", self.off.0);
        let stretched: f64 = explained[3..].iter().sum();
        let most = stretched + rounded(plan.deflection) + scale_rounded;
        assert!(self.off.1 <= most, "{what}: {} > {most}", self.off.1);
    }
}

/// Plays every plan of a drive as far as it reaches, a cruise, and a jog that is stopped.
fn plays_every_plan<const N: usize>(drive: &Drive) {
    let design = design(drive);
    let plans = design.plans().unwrap().plans();
    let resolution = drive.encoder.resolution;
    let mut before = 0;
    for plan in plans.displacements {
        let counts = ((f64::from(plan.reach) * (1.0 - 1e-6) / resolution) as i64).max(1);
        if counts == before {
            // Of whole counts the plan before reaches as many.
            continue;
        }
        before = counts;
        let mut played = Played::<N>::new(&design);
        played.play(Request::Move(Place(-counts)));
        let periods = usize::from(plan.knots) * usize::from(plans.stride);
        assert_eq!(played.currents.len(), periods + 3);
        let what = format!("{counts} counts in {} periods", plan.knots);
        played.check(&what, plan, counts as f64 * resolution);
    }
    if plans.stride > 1 {
        // Its changes of velocity begin between the steps of one another.
        return;
    }
    let change = &plans.change;
    let velocity = f64::from(change.reach);
    let far = plans.displacements.last().unwrap();
    let counts = (3.0 * f64::from(far.reach) / resolution) as i64;
    let mut played = Played::<N>::new(&design);
    played.play(Request::Move(Place(counts)));
    played.check("cruise", change, velocity);

    let mut played = Played::<N>::new(&design);
    played.asked = Some(Request::Jog(Velocity(change.reach)));
    for _ in 0..200 {
        played.step();
    }
    played.play(Request::Halt);
    played.check("jog", change, velocity);
}

#[test]
fn every_plan_of_the_default_drive_ends_at_rest_within_its_limits() {
    plays_every_plan::<3>(&Drive::default_drive());
}

#[test]
fn every_plan_with_all_limits_stated_ends_at_rest_within_them() {
    let mut drive = Drive::default_drive();
    drive.motion.velocity = Some(1.0);
    drive.motion.acceleration = Some(60.0);
    drive.motion.jerk = Some(2e4);
    drive.motion.deflection = Some(vec![6e-3, 4e-3, 2e-3]);
    plays_every_plan::<3>(&drive);
}

#[test]
fn every_plan_of_other_chains_ends_at_rest_within_its_limits() {
    plays_every_plan::<1>(&drives::drive_with_loads(1));
    let mut heavy = drives::drive_with_loads(2);
    for load in &mut heavy.loads {
        load.mass = 3.0 * heavy.actuator.mass;
    }
    plays_every_plan::<2>(&heavy);
}

/// A table of rows several periods apart: between them the actuator is where the plant's is under the same current,
/// and so is each load, to a hundredth of what it moves in a step.
#[test]
fn between_its_rows_a_plan_is_where_the_machine_is() {
    let mut drive = Drive::default_drive();
    drive.motion.table = Some(4_000);
    let design = design(&drive);
    let plans = design.plans().unwrap().plans();
    assert!(plans.stride > 1, "{}", plans.stride);
    let mut played = Played::<3>::new(&design);
    played.asked = Some(Request::Move(Place(30_000)));
    let mut places = vec![[0.0; 4]; plans.stride.into()];
    let (mut farthest, mut largest) = ([0.0_f64; 4], [0.0_f64; 4]);
    loop {
        let machine = played.plant.state.clone();
        let (rests, reference) = played.advance();
        let target = played.target.0 as f64 * drive.encoder.resolution;
        let actuator = target + f64::from(reference.position.0);
        let place = |mass: usize| match mass {
            0 => actuator,
            load => actuator + f64::from(reference.deflection[load - 1]),
        };
        let now: [f64; 4] = std::array::from_fn(place);
        let before = places[places.len() - usize::from(plans.stride)];
        for mass in 0..4 {
            farthest[mass] = farthest[mass].max((now[mass] - machine[2 * mass]).abs());
            largest[mass] = largest[mass].max((now[mass] - before[mass]).abs());
        }
        places.push(now);
        if rests {
            break;
        }
    }
    for (off, moves) in farthest.iter().zip(largest) {
        assert!(*off < 0.01 * moves, "{farthest:?} of {largest:?}");
    }
}
