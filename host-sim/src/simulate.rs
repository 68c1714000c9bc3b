//! The closed loop: plant and control core, one control period after the other.
//!
//! ```text
//! plant --count--> core --current--> plant      (the core also gets the current it commanded)
//! ```
//!
//! Before each experiment the core is commissioned on the same plant, as on the machine, under the forces that
//! are always there. Beside it runs, on a plant of its own, the same gain `K` on the true state: what the
//! drive would do if it knew the motion of every mass. That is no bound: errors of an observer can happen to
//! make a motion settle sooner.

pub mod benefit;
pub mod bound;
pub mod corridor;
pub mod ending;
pub mod experiment;
pub mod metrics;
pub mod plant;
pub mod proposal;
pub mod scenario;
pub mod sequence;
pub mod stillness;
pub mod watch;

use crate::design::plans::PlanTable;
use crate::design::player::{Play, player};
use crate::design::protection::Protection;
use crate::design::{Design, settling_tolerance};
use crate::drive::PlantFile;
use crate::error::{Error, Result};
use crate::linear::product::dot;
use arso_core::friction::FrictionFeedForward;
use arso_core::limits::Limiter;
use arso_core::{Counts, Current, Fault, Measurement, Mode, Place, Refusal, Request};
use corridor::{Corridor, Found, Record, corridor_with};
use metrics::{Frame, Meter, Metrics, Seen};
use nalgebra::DVector;
use plant::Plant;
use scenario::Scenario;
use std::collections::VecDeque;

/// Which control law was simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// The control core with the drive's observer.
    Core,
    /// `K` on the true state.
    FullState,
    /// One of the rivals in [`compare`](crate::compare).
    Rival(&'static str),
}

/// One control period.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Start of the period, s.
    pub time: f64,
    /// Encoder counter.
    pub count: u32,
    /// True state `x_a v_a x_1 v_1 …`, m and m/s.
    pub truth: DVector<f64>,
    /// True reaction force, N.
    pub true_reaction_force: f64,
    /// Reference position, m.
    pub reference: f64,
    /// Current applied over the period before, A.
    pub applied_current: f64,
    /// Current commanded for this period, A.
    pub command: f64,
    /// Whether the current limit acted.
    pub limited: bool,
    /// What the core found; nothing for feedback of the true state.
    pub record: Option<Record>,
}

/// One simulated experiment.
#[derive(Clone, Debug)]
pub struct Run {
    /// Linear or rotary.
    pub kind: crate::machine::Kind,
    /// Which experiment.
    pub scenario: Scenario,
    /// Which control law.
    pub law: Law,
    /// What the plant's encoder can tell apart, m.
    pub resolution: f64,
    /// How far from the target counts as there, m.
    pub settling_tolerance: f64,
    /// Every control period.
    pub samples: Vec<Sample>,
    /// The fault that stopped the drive, and when (s).
    pub fault: Option<(f64, Fault)>,
}

impl Run {
    /// Refuses a run in which the drive stopped itself.
    ///
    /// # Errors
    /// [`Error::Fault`], which names the fault and when.
    pub(crate) fn require_no_fault(&self) -> Result<()> {
        require_no_fault(self.scenario.name, self.fault)
    }

    /// The same run, held against the tolerance of a design.
    pub(crate) fn with_tolerance(self, design: &Design) -> Self {
        Self {
            settling_tolerance: design.motion.settling_tolerance,
            ..self
        }
    }
}

/// Refuses a run of an experiment in which the drive stopped itself.
///
/// # Errors
/// [`Error::Fault`], which names the fault and when.
pub(crate) fn require_no_fault(
    experiment: &'static str,
    fault: Option<(f64, Fault)>,
) -> Result<()> {
    let Some((time, fault)) = fault else {
        return Ok(());
    };
    Err(Error::Fault {
        experiment,
        time,
        number: fault.number(),
        fault: format!("{fault:?}"),
    })
}

/// Simulates one experiment.
///
/// * `file`: the plant; with as many loads as the design
/// * `duration`: s
///
/// # Errors
/// [`Error::Simulation`] when the plant's motion is no longer finite, [`Error::Design`] when the
/// core refuses the gains.
pub fn simulate(
    design: &Design,
    file: &PlantFile,
    scenario: &Scenario,
    law: Law,
    duration: f64,
) -> Result<Run> {
    let mut control = control(design, file, scenario, law)?;
    let time = (design.drive.control.sample_time, duration);
    let run = close_loop(law, control.as_mut(), (file, 0), scenario, time)?;
    Ok(run.with_tolerance(design))
}

/// Simulates one experiment for its figures alone: those of [`Metrics::new`], without keeping a sample.
///
/// * `file`, `duration`: as for [`simulate`]
///
/// # Errors
/// As [`simulate`].
pub fn measure(
    design: &Design,
    file: &PlantFile,
    scenario: &Scenario,
    law: Law,
    duration: f64,
) -> Result<Metrics> {
    let mut control = control(design, file, scenario, law)?;
    let time = Time::new(design.drive.control.sample_time, duration);
    let frame = Frame::on(file, scenario, time);
    let mut meter = Meter::new(frame.with_tolerance(design.motion.settling_tolerance));
    let look = |instant: &Instant<'_>| meter.look(&instant.seen());
    let fault = follow(control.as_mut(), (file, 0), scenario, time, look)?;
    Ok(meter.metrics(fault))
}

fn control<'d>(
    design: &'d Design,
    file: &PlantFile,
    scenario: &Scenario,
    law: Law,
) -> Result<Box<dyn Control + 'd>> {
    Ok(match law {
        Law::Core => Box::new(Core::new(design, file, scenario)?),
        _ => Box::new(FullState::new(design, scenario)?),
    })
}

/// Simulates one experiment under any law; its tolerance is that of a drive which states none.
///
/// * `plant`: what is there, and the control periods by which the current comes late
/// * `time`: control period and duration, s
///
/// # Errors
/// [`Error::Simulation`] when the motion or a command is no longer finite.
pub(crate) fn close_loop(
    law: Law,
    control: &mut dyn Control,
    (file, late): (&PlantFile, usize),
    scenario: &Scenario,
    (period, duration): (f64, f64),
) -> Result<Run> {
    let time = Time::new(period, duration);
    let mut samples = Vec::with_capacity(time.periods);
    let keep = |instant: &Instant<'_>| samples.push(instant.sample());
    let fault = follow(control, (file, late), scenario, time, keep)?;
    Ok(Run {
        kind: file.kind,
        resolution: file.encoder.resolution,
        settling_tolerance: settling_tolerance(file.encoder.resolution),
        scenario: *scenario,
        law,
        samples,
        fault,
    })
}

/// A control period and how many of them are simulated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Time {
    /// s.
    pub(crate) period: f64,
    pub(crate) periods: usize,
}

impl Time {
    /// * `period`, `duration`: s
    pub(crate) fn new(period: f64, duration: f64) -> Self {
        let periods = (duration / period).round() as usize;
        Self { period, periods }
    }

    /// Start of the last period, s.
    pub(crate) fn last(&self) -> f64 {
        self.periods.saturating_sub(1) as f64 * self.period
    }
}

/// One control period as the loop lends it: what was true and what was said at its start.
pub(crate) struct Instant<'l> {
    /// s.
    pub(crate) time: f64,
    count: u32,
    applied_current: f64,
    plant: &'l Plant,
    /// What the core found, in full.
    record: &'l dyn Fn() -> Option<Record>,
    output: &'l ControlOutput,
    found: Option<Found<'l>>,
}

impl Instant<'_> {
    /// What figures are made of.
    #[inline]
    pub(crate) fn seen(&self) -> Seen<'_> {
        Seen {
            time: self.time,
            truth: self.plant.state().as_slice(),
            command: self.output.current,
            found: self.found,
        }
    }

    /// A copy to keep.
    fn sample(&self) -> Sample {
        Sample {
            time: self.time,
            count: self.count,
            truth: self.plant.state().clone(),
            true_reaction_force: self.plant.reaction_force(),
            reference: self.reference(),
            applied_current: self.applied_current,
            command: self.output.current,
            limited: self.output.limited,
            record: (self.record)(),
        }
    }

    /// m.
    fn reference(&self) -> f64 {
        let found = self.found.map(|found| f64::from(found.reference));
        self.output.reference.or(found).unwrap_or_default()
    }
}

/// Closes the loop for a while, without allocating in it; the fault that stopped the drive, and when (s).
///
/// * `control`: where its type is known, it is called without a detour
/// * `plant`: what is there, and the control periods by which the current comes late
/// * `look`: shown every control period
///
/// # Errors
/// [`Error::Simulation`] when the motion or a command is no longer finite.
pub(crate) fn follow(
    control: &mut (impl Control + ?Sized),
    (file, late): (&PlantFile, usize),
    scenario: &Scenario,
    time: Time,
    mut look: impl FnMut(&Instant<'_>),
) -> Result<Option<(f64, Fault)>> {
    let mut plant = Plant::new(file, time.period);
    plant.start_from(&scenario.initial_state(plant.chain()));
    let mut fault = None;
    let mut applied_current = 0.0;
    let mut on_the_way: VecDeque<f64> = std::iter::repeat_n(0.0, late).collect();
    for k in 0..time.periods {
        let time = k as f64 * time.period;
        let count = plant.count();
        let output = control.step(count, plant.state(), applied_current)?;
        let found = control.found();
        if let (None, Some(Mode::Fault(new))) = (fault, found.map(|found| found.mode)) {
            fault = Some((time, new));
        }
        look(&Instant {
            time,
            count,
            applied_current,
            plant: &plant,
            record: &|| control.record(),
            output: &output,
            found,
        });
        plant.enable(output.enable);
        let arrived = match on_the_way.pop_front() {
            None => output.current,
            Some(first) => {
                on_the_way.push_back(output.current);
                first
            }
        };
        plant.advance(arrived)?;
        applied_current = output.current;
    }
    Ok(fault)
}

/// What a control law says for one period.
pub(crate) struct ControlOutput {
    /// A.
    pub(crate) current: f64,
    /// Whether the amplifier is on.
    pub(crate) enable: bool,
    /// Whether the current limit acted.
    pub(crate) limited: bool,
    /// m; none where what was [found](Control::found) says it.
    pub(crate) reference: Option<f64>,
}

/// A control law in simulation.
pub(crate) trait Control {
    /// One period: encoder counter, true state, current that the law takes for applied.
    fn step(&mut self, count: u32, truth: &DVector<f64>, applied: f64) -> Result<ControlOutput>;

    /// What the core found in the last period, lent; nothing of another law.
    fn found(&self) -> Option<Found<'_>> {
        None
    }

    /// The same in full.
    fn record(&self) -> Option<Record> {
        None
    }
}

/// A control law that can be asked for something on its way.
pub(crate) trait Ask: Control {
    /// What is to be done from the next period on.
    ///
    /// # Errors
    /// [`Error::Simulation`] when it is refused.
    fn ask(&mut self, request: Request) -> Result<()>;
}

/// The control core as a law.
pub(crate) struct Core<'d>(Box<dyn Corridor + 'd>);

impl<'d> Core<'d> {
    /// A core that has proven its signs on this plant and is asked for the experiment.
    pub(crate) fn new(design: &'d Design, file: &PlantFile, scenario: &Scenario) -> Result<Self> {
        let plans = design.plans()?;
        Self::with_plans(design, plans, &design.protection(), file, scenario)
    }

    /// The same with plans of another design for the same machine, and with limits of its own.
    pub(crate) fn with_plans(
        design: &Design,
        plans: &'d PlanTable,
        protection: &Protection,
        file: &PlantFile,
        scenario: &Scenario,
    ) -> Result<Self> {
        let mut core = corridor_with(design, plans, protection, None)?;
        let place = commission(core.as_mut(), file, design.drive.control.sample_time)?;
        // The experiment's origin is the machine's.
        core.request(Request::SetPosition(place)).map_err(refused)?;
        core.request(Request::Start).map_err(refused)?;
        let request = scenario.request(design.drive.encoder.resolution);
        core.request(request).map_err(refused)?;
        Ok(Self(core))
    }
}

fn refused(refusal: Refusal) -> Error {
    Error::Simulation(refusal.to_string())
}

/// Longest commissioning: rest, ramp and return all at the end of their patience, s.
const COMMISSIONING: f64 = 5.0;

/// Commissions a core on a plant at rest, under the steady forces alone; where the encoder then is.
///
/// # Errors
/// [`Error::Simulation`] when that ends in a fault.
pub fn commission(core: &mut dyn Corridor, file: &PlantFile, period: f64) -> Result<Place> {
    let steady = file.forces.iter().filter(|force| force.steady());
    let before = PlantFile {
        forces: steady.cloned().collect(),
        ..file.clone()
    };
    let mut plant = Plant::new(&before, period);
    core.request(Request::Commission).map_err(refused)?;
    let mut current = Current(0.0);
    let mut time = 0.0;
    while time < COMMISSIONING {
        let count = Counts(plant.count());
        let command = core.step(Measurement {
            count,
            current,
            home: false,
        });
        current = command.current;
        plant.enable(command.enable);
        match core.found().mode {
            Mode::Ready => return Ok(Place(plant.place())),
            Mode::Fault(fault) => {
                let number = fault.number();
                let message = format!("commissioning ended with fault {number} ({fault:?})");
                return Err(Error::Simulation(message));
            }
            _ => {}
        }
        plant.advance(current.0.into())?;
        time += period;
    }
    Err(Error::Simulation("commissioning did not end".into()))
}

impl Ask for Core<'_> {
    fn ask(&mut self, request: Request) -> Result<()> {
        self.0.request(request).map_err(refused)
    }
}

impl Control for Core<'_> {
    #[inline]
    fn step(&mut self, count: u32, _: &DVector<f64>, applied: f64) -> Result<ControlOutput> {
        let command = self.0.step(Measurement {
            count: Counts(count),
            current: Current(applied as f32),
            home: false,
        });
        Ok(ControlOutput {
            current: command.current.0.into(),
            enable: command.enable,
            limited: command.limited,
            reference: None,
        })
    }

    #[inline]
    fn found(&self) -> Option<Found<'_>> {
        Some(self.0.found())
    }

    fn record(&self) -> Option<Record> {
        Some(self.0.record())
    }
}

/// `i = i_ff − K (x − x_ref)` on the true state, through the same moves and the same limiter.
pub(crate) struct FullState<'d> {
    gain: nalgebra::RowDVector<f64>,
    limiter: Limiter,
    player: Box<dyn Play + 'd>,
    friction: FrictionFeedForward,
    force_constant: f64,
}

impl<'d> FullState<'d> {
    pub(crate) fn new(design: &'d Design, scenario: &Scenario) -> Result<Self> {
        let mut player = player(design)?;
        player.ask(scenario.request(design.drive.encoder.resolution));
        Ok(Self {
            gain: design.regulator.clone(),
            limiter: design.limits().limiter(),
            player,
            friction: design.friction(),
            force_constant: design.chain.force_constant,
        })
    }
}

impl Ask for FullState<'_> {
    fn ask(&mut self, request: Request) -> Result<()> {
        self.player.ask(request);
        Ok(())
    }
}

impl Control for FullState<'_> {
    fn step(&mut self, _: u32, truth: &DVector<f64>, _: f64) -> Result<ControlOutput> {
        let reference = self.player.step()?;
        let friction = f64::from(self.friction.step(reference.velocity).0) / self.force_constant;
        let errors = truth.iter().zip(reference.state);
        let feedback = dot(
            &self.gain,
            errors.map(|(truth, reference)| truth - reference),
        );
        let current = reference.feed_forward + friction - feedback;
        let limited = self.limiter.step(Current(current as f32)).ok_or_else(|| {
            Error::Simulation("feedback of the true state is no longer finite".into())
        })?;
        Ok(ControlOutput {
            current: limited.current.0.into(),
            enable: true,
            limited: limited.limited,
            reference: Some(reference.state[0]),
        })
    }
}
