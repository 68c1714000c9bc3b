//! The corridor: one control step from encoder count to current command.
//!
//! `Controller` owns the coefficients ([`Gains`]) and the state of every room; the firmware's
//! interrupt and the simulation both call [`Controller::step`] once per period and nothing else
//! between two steps but [`Controller::request`].
//!
//! The command is `i = i_ff − K (x_hat − x_ref) + d / k_f`, limited; a value that is not finite
//! anywhere ends in a fault and zero current.

use crate::commissioning::{self, Action, Commissioning};
use crate::disturbance::{self, ForceObservers};
use crate::encoder::{self, Encoder};
use crate::excitation::{self, Excitation};
use crate::gains::{Gains, GainsError};
use crate::limits::Limits;
use crate::observer::{self, ActuatorMotion, Estimate, Observer};
use crate::reference::{self, Generator};
use crate::regulator::Regulator;
use crate::supervisor::{Fault, State, Supervisor};
use crate::telemetry::Telemetry;
use crate::units::{Counts, Current, Force, Position, Velocity};

/// What the drive measures once per period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Encoder counter.
    pub count: Counts,
    /// Current that was applied over the period that ends now, as the output really made it.
    pub current: Current,
}

/// What the drive has to do over the next period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Current to apply, within the limit and a whole number of the output's steps.
    pub current: Current,
    /// Whether the amplifier is to be enabled.
    pub enable: bool,
    /// Whether the current limit acted.
    pub limited: bool,
}

/// What can be asked of the drive. A request takes effect with the next step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Prove the signs of encoder and current by a small motion; idle or ready drives only.
    Commission,
    /// Play a current profile in open loop; idle or ready drives only.
    Excite(Excitation),
    /// Close the loop where the actuator stands; ready drives only.
    Start,
    /// Open the loop; acknowledges a fault.
    Stop,
    /// Put the reference there at once; running drives only.
    Step(Position),
    /// Move the reference there within the limits of motion, after the move under way if there
    /// is one; running drives only.
    Move(Position),
}

/// The control corridor of a drive with `N` load masses and an observer of `S` states.
#[derive(Clone, Debug)]
pub struct Controller<const N: usize, const S: usize> {
    encoder: Encoder,
    forces: ForceObservers,
    observer: Observer<N, S>,
    regulator: Regulator<N>,
    limits: Limits,
    generator: Generator,
    commissioning: Commissioning,
    /// `1 / k_f`, A/N.
    current_per_force: f32,
    memory: Memory<N, S>,
}

/// All that changes from step to step.
#[derive(Clone, Debug)]
struct Memory<const N: usize, const S: usize> {
    supervisor: Supervisor,
    encoder: encoder::State,
    forces: disturbance::State,
    observer: observer::State<S>,
    reference: reference::State,
    commissioning: commissioning::State,
    /// What is being played, and how far it has come.
    excitation: (Excitation, excitation::State),
    /// The next step initialises the observers at the measured position.
    starting: bool,
    pending: Option<Request>,
    telemetry: Telemetry<N>,
}

impl<const N: usize, const S: usize> Controller<N, S> {
    /// An idle controller.
    ///
    /// # Errors
    /// When the gains cannot be run, see [`Gains::check`].
    pub fn new(gains: &Gains<N, S>) -> Result<Self, GainsError> {
        gains.check()?;
        let force_constant = gains.actuator.actual_force_constant();
        let observer = Observer::new(&gains.observer, gains.sample_time);
        Ok(Self {
            encoder: Encoder::new(gains.encoder.resolution, gains.encoder.counter_bits),
            forces: ForceObservers::new(
                gains.actuator,
                gains.disturbance_cutoff,
                gains.reaction_force_cutoff,
                gains.sample_time,
            ),
            regulator: gains.regulator,
            limits: gains.limits,
            generator: Generator::new(gains.motion, force_constant, gains.sample_time),
            commissioning: Commissioning::new(
                &gains.limits,
                gains.encoder.resolution,
                gains.sample_time,
            ),
            current_per_force: 1.0 / force_constant,
            memory: Memory {
                supervisor: Supervisor::default(),
                encoder: encoder::State::default(),
                forces: disturbance::State::default(),
                observer: observer.at_rest(Position(0.0)),
                reference: reference::State::default(),
                commissioning: commissioning::State::default(),
                excitation: Default::default(),
                starting: false,
                pending: None,
                telemetry: Telemetry::default(),
            },
            observer,
        })
    }

    /// Asks something of the drive; what the present state does not allow is ignored.
    pub fn request(&mut self, request: Request) {
        let memory = &mut self.memory;
        match request {
            Request::Commission => {
                if memory.supervisor.commission() {
                    memory.commissioning = commissioning::State::default();
                    memory.starting = true;
                    memory.pending = None;
                }
            }
            Request::Excite(excitation) => {
                if memory.supervisor.excite() {
                    memory.commissioning = commissioning::State::default();
                    memory.starting = true;
                    memory.excitation = (excitation, excitation::State::default());
                    memory.pending = None;
                }
            }
            Request::Start => {
                if memory.supervisor.start() {
                    memory.starting = true;
                    memory.pending = None;
                }
            }
            Request::Stop => {
                memory.supervisor.stop();
                memory.pending = None;
            }
            Request::Step(_) | Request::Move(_) => {
                if memory.supervisor.state() == State::Running {
                    memory.pending = Some(request);
                }
            }
        }
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> State {
        self.memory.supervisor.state()
    }

    /// Record of the last step.
    #[must_use]
    pub fn telemetry(&self) -> &Telemetry<N> {
        &self.memory.telemetry
    }

    /// One control period: the whole corridor.
    ///
    /// The same path is taken in every running period; its cost does not depend on the values,
    /// apart from the one period in which a move is planned (two square roots and a cube root
    /// more). A drive that excites does less. Idle and faulted drives get zero current and a disabled
    /// amplifier.
    pub fn step(&mut self, measurement: Measurement) -> Command {
        let memory = &mut self.memory;
        let reading = self.encoder.step(&mut memory.encoder, measurement.count);
        memory.telemetry.step = memory.telemetry.step.wrapping_add(1);
        memory.telemetry.count = measurement.count.0;
        memory.telemetry.position = reading.position.0;

        // The record of a fault still has what was estimated before it.
        if memory.supervisor.state() != State::Running
            && matches!(memory.telemetry.state, State::Running | State::Fault(_))
        {
            memory.telemetry.forget_estimates();
        }

        let result = match memory.supervisor.state() {
            State::Running => self.run(measurement, reading),
            State::Commissioning => self.commission(reading),
            State::Exciting => self.excite(measurement, reading),
            State::Idle | State::Ready | State::Fault(_) => Ok(Command::default()),
        };
        let command = result.unwrap_or_else(|fault| {
            self.memory.supervisor.trip(fault);
            Command::default()
        });

        let telemetry = &mut self.memory.telemetry;
        telemetry.state = self.memory.supervisor.state();
        telemetry.command = command.current.0;
        telemetry.limited = command.limited;
        if measurement.current.0.is_finite() {
            telemetry.applied_current = measurement.current.0;
        }
        command
    }

    /// Commissioning: open loop until the signs are proven, closed from then on.
    fn commission(&mut self, reading: encoder::Reading) -> Result<Command, Fault> {
        let memory = &mut self.memory;
        if reading.jump {
            return Err(Fault::EncoderJump);
        }
        let action = self
            .commissioning
            .step(&mut memory.commissioning, reading.position)?;
        match action {
            Action::Wait => Ok(Command::default()),
            Action::Push(current) => limited(self.limits, current),
            Action::Brake(origin) => {
                let mut displacement = reading.displacement;
                if memory.starting {
                    memory.starting = false;
                    memory.forces = disturbance::State::default();
                    displacement = 0.0;
                }
                let forces = self
                    .forces
                    .step(&mut memory.forces, displacement, Current(0.0));
                let rigid = Estimate {
                    position: reading.position,
                    velocity: forces.velocity,
                    deflection: [0.0; N],
                    load_velocity: [forces.velocity.0; N],
                    disturbance: Force(0.0),
                };
                let current = self.regulator.step(&rigid, origin, Velocity(0.0));
                limited(self.limits, current)
            }
            Action::Done => {
                memory.supervisor.commissioned();
                Ok(Command::default())
            }
        }
    }

    /// Excitation: from rest, as commissioning; then open loop from the first period to the last, within
    /// the travel allowed.
    fn excite(
        &mut self,
        measurement: Measurement,
        reading: encoder::Reading,
    ) -> Result<Command, Fault> {
        if reading.jump {
            return Err(Fault::EncoderJump);
        }
        plausible(self.limits, measurement.current)?;
        let memory = &mut self.memory;
        if memory.starting {
            let action = self
                .commissioning
                .step(&mut memory.commissioning, reading.position)?;
            if action == Action::Wait {
                return Ok(Command::default());
            }
            memory.starting = false;
        }
        let (excitation, state) = &mut memory.excitation;
        let least_motion = self.commissioning.least_motion();
        if let Some(current) = excitation.step(state, reading.position, least_motion)? {
            limited(self.limits, current)
        } else {
            memory.supervisor.excited();
            Ok(Command::default())
        }
    }

    fn run(
        &mut self,
        measurement: Measurement,
        reading: encoder::Reading,
    ) -> Result<Command, Fault> {
        let memory = &mut self.memory;
        let mut displacement = reading.displacement;
        let mut current = measurement.current;
        if memory.starting {
            memory.starting = false;
            memory.forces = disturbance::State::default();
            memory.observer = self.observer.at_rest(reading.position);
            self.generator
                .step_to(&mut memory.reference, reading.position);
            // What was before the start is not the observers' to know.
            displacement = 0.0;
            current = Current(0.0);
        } else if reading.jump {
            return Err(Fault::EncoderJump);
        }
        plausible(self.limits, current)?;

        let forces = self.forces.step(&mut memory.forces, displacement, current);
        let actuator = ActuatorMotion {
            position: reading.position,
            displacement,
            velocity: forces.velocity,
        };
        let estimate = self.observer.step(
            &mut memory.observer,
            actuator,
            current,
            forces.reaction_force,
        );

        match memory.pending {
            Some(Request::Step(position)) => {
                if !position.0.is_finite() {
                    return Err(Fault::Target);
                }
                self.generator.step_to(&mut memory.reference, position);
                memory.pending = None;
            }
            Some(Request::Move(position)) if !self.generator.moving(&memory.reference) => {
                if !self.generator.move_to(&mut memory.reference, position) {
                    return Err(Fault::Target);
                }
                memory.pending = None;
            }
            _ => {}
        }
        let setpoint = self.generator.step(&mut memory.reference);

        let feedback = self
            .regulator
            .step(&estimate, setpoint.position, setpoint.velocity);
        let current =
            setpoint.feed_forward.0 + feedback.0 + estimate.disturbance.0 * self.current_per_force;
        let command = limited(self.limits, Current(current))?;

        let telemetry = &mut memory.telemetry;
        telemetry.reference = setpoint.position.0;
        telemetry.velocity = estimate.velocity.0;
        telemetry.disturbance = forces.disturbance.0;
        telemetry.reaction_force = forces.reaction_force.0;
        telemetry.disturbance_state = estimate.disturbance.0;
        telemetry.load_velocity = estimate.load_velocity;
        for (position, deflection) in telemetry.load_position.iter_mut().zip(&estimate.deflection) {
            *position = estimate.position.0 + deflection;
        }
        Ok(command)
    }
}

/// Whether a current can have been applied by this drive.
fn plausible(limits: Limits, applied: Current) -> Result<(), Fault> {
    if !applied.0.is_finite() {
        return Err(Fault::NonFinite);
    }
    // A step of the output for its rounding.
    if applied.0.abs() > limits.current_limit + limits.current_resolution {
        return Err(Fault::AppliedCurrent);
    }
    Ok(())
}

/// The command that applies a current as far as the limits allow.
fn limited(limits: Limits, current: Current) -> Result<Command, Fault> {
    let limited = limits.step(current).ok_or(Fault::NonFinite)?;
    Ok(Command {
        current: limited.current,
        enable: true,
        limited: limited.limited,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::disturbance::Actuator;
    use crate::gains::{EncoderGains, ObserverGains};
    use crate::observer::Form;
    use crate::reference::MotionLimits;
    use crate::regulator::MassGain;
    use proptest::prelude::*;

    /// One load that follows the actuator rigidly, no correction: PD control on the encoder.
    fn gains() -> Gains<1, 5> {
        Gains {
            sample_time: 1e-3,
            encoder: EncoderGains {
                resolution: 1e-6,
                counter_bits: 16,
            },
            actuator: Actuator {
                mass: 0.059,
                force_constant: 6.43,
                mass_deviation: 0.0,
                force_constant_deviation: 0.0,
            },
            disturbance_cutoff: 628.0,
            reaction_force_cutoff: 628.0,
            observer: ObserverGains {
                form: Form::Anchored,
                transition: [[0.0; 5]; 5],
                input: [0.0, 1.0, 0.0, 0.0, 0.0],
                output: [0.0, 0.0, 0.0, 1.0, 0.0],
                correction: [0.0; 5],
            },
            regulator: Regulator {
                actuator: MassGain {
                    position: 30.0,
                    velocity: 1.0,
                },
                loads: [MassGain {
                    position: 0.0,
                    velocity: 0.0,
                }],
            },
            limits: Limits {
                current_limit: 2.0,
                current_resolution: 1e-3,
            },
            motion: MotionLimits {
                velocity: 0.5,
                acceleration: 20.0,
                jerk: 1000.0,
                total_mass: 0.116,
            },
        }
    }

    fn measured(count: u32, current: f32) -> Measurement {
        Measurement {
            count: Counts(count),
            current: Current(current),
        }
    }

    /// Proves the signs on a rigid actuator that follows the current.
    fn commission(controller: &mut Controller<1, 5>) {
        controller.request(Request::Commission);
        let mut position = controller.telemetry().position;
        let (mut velocity, mut current) = (0.0_f32, 0.0_f32);
        for _ in 0..2000 {
            let count = (position / 1e-6) as i32 as u32;
            current = controller.step(measured(count, current)).current.0;
            velocity += 6.43 * current / 0.116 * 1e-3;
            position += velocity * 1e-3;
        }
        assert_eq!(controller.state(), State::Ready);
    }

    fn running() -> Controller<1, 5> {
        let mut controller = Controller::new(&gains()).unwrap();
        commission(&mut controller);
        controller.request(Request::Start);
        controller
    }

    #[test]
    fn an_idle_drive_gives_no_current_and_follows_the_encoder() {
        let mut controller = Controller::new(&gains()).unwrap();
        controller.request(Request::Step(Position(0.03)));
        assert_eq!(controller.step(measured(100, 0.0)), Command::default());
        assert_eq!(controller.step(measured(350, 0.0)), Command::default());
        assert!((controller.telemetry().position - 350e-6).abs() < 1e-9);
    }

    #[test]
    fn no_loop_is_closed_before_the_signs_are_proven() {
        let mut controller = Controller::new(&gains()).unwrap();
        controller.request(Request::Start);
        assert_eq!(controller.step(measured(0, 0.0)), Command::default());
        assert_eq!(controller.state(), State::Idle);
    }

    /// The encoder runs backwards: the drive stops while it has moved by a few counts only.
    #[test]
    fn a_wrong_sign_is_a_fault() {
        let mut controller = Controller::new(&gains()).unwrap();
        controller.request(Request::Commission);
        let (mut position, mut velocity, mut current) = (0.0_f32, 0.0_f32, 0.0_f32);
        for _ in 0..500 {
            let count = (-position / 1e-6) as i32 as u32;
            current = controller.step(measured(count, current)).current.0;
            velocity += 6.43 * current / 0.116 * 1e-3;
            position += velocity * 1e-3;
            if controller.state() == State::Fault(Fault::Direction) {
                break;
            }
        }
        assert_eq!(controller.state(), State::Fault(Fault::Direction));
        assert_eq!(current, 0.0);
        assert!(position < 100e-6);
    }

    #[test]
    fn starting_holds_the_position_and_a_step_commands_the_gain() {
        let mut controller = running();
        let command = controller.step(measured(0xFFFF, 0.0));
        assert_eq!((command.current.0, command.enable), (0.0, true));
        controller.request(Request::Step(Position(0.02)));
        let command = controller.step(measured(0xFFFF, 0.0));
        assert!((command.current.0 - 0.6).abs() < 1e-6);
        controller.request(Request::Step(Position(1.0)));
        let command = controller.step(measured(0xFFFF, 0.6));
        assert_eq!((command.current.0, command.limited), (2.0, true));
    }

    #[test]
    fn faults_stop_in_the_same_period_and_stay() {
        for (count, current, fault) in [
            (30_000, 0.0, Fault::EncoderJump),
            (0, f32::NAN, Fault::NonFinite),
            (0, f32::INFINITY, Fault::NonFinite),
            (0, 2.5, Fault::AppliedCurrent),
        ] {
            let mut controller = running();
            controller.step(measured(0, 0.0));
            assert_eq!(
                controller.step(measured(count, current)),
                Command::default()
            );
            assert_eq!(controller.state(), State::Fault(fault));
            controller.request(Request::Start);
            controller.request(Request::Step(Position(0.01)));
            assert_eq!(controller.step(measured(count, 0.0)), Command::default());
            controller.request(Request::Stop);
            controller.request(Request::Start);
            assert!(!controller.step(measured(count, 0.0)).enable);
            commission(&mut controller);
        }
    }

    #[test]
    fn targets_that_are_not_finite_are_faults() {
        for request in [
            Request::Step(Position(f32::NAN)),
            Request::Move(Position(f32::NAN)),
            Request::Move(Position(f32::INFINITY)),
        ] {
            let mut controller = running();
            controller.request(request);
            assert_eq!(controller.step(measured(0, 0.0)), Command::default());
            assert_eq!(controller.state(), State::Fault(Fault::Target));
        }
    }

    #[test]
    fn a_move_waits_for_the_one_under_way() {
        let mut controller = running();
        controller.request(Request::Move(Position(0.01)));
        controller.step(measured(0, 0.0));
        controller.request(Request::Move(Position(-0.01)));
        let mut highest = 0.0_f32;
        for _ in 0..400 {
            // The simulated actuator follows its reference.
            let reference = controller.telemetry().reference;
            let count = (reference * 1e6) as i32;
            controller.step(measured(count as u32 & 0xFFFF, 0.0));
            highest = highest.max(reference);
        }
        assert_eq!(highest, 0.01);
        assert_eq!(controller.telemetry().reference, -0.01);
    }

    const EXCITATION: Excitation = Excitation {
        // The last is beyond the limit of 2 A.
        profile: &[100, -350, 9000],
        unit: 1e-3,
        repetitions: 3,
        travel: 1e-3,
    };

    fn exciting(excitation: Excitation) -> Controller<1, 5> {
        let mut controller = Controller::new(&gains()).unwrap();
        controller.step(measured(500, 0.0));
        controller.request(Request::Excite(excitation));
        controller
    }

    /// Waits at rest until the first current flows, or nothing ever will; that period's command.
    fn begun(controller: &mut Controller<1, 5>, count: u32) -> Command {
        for waited in 0..100 {
            let command = controller.step(measured(count, 0.0));
            if command.enable || controller.state() != State::Exciting {
                assert!(waited >= 50, "{waited}");
                return command;
            }
            assert_eq!(command, Command::default());
        }
        panic!("it does not begin");
    }

    /// Every current of every repetition through the limiter, then nothing, with unproven signs;
    /// the same from a drive that was ready, and once more.
    #[test]
    fn an_excitation_is_its_profile_through_the_limiter() {
        let mut ready = Controller::new(&gains()).unwrap();
        commission(&mut ready);
        ready.request(Request::Excite(EXCITATION));
        for mut controller in [exciting(EXCITATION), ready] {
            let Telemetry {
                count, position, ..
            } = *controller.telemetry();
            for again in 0..2 {
                let mut applied = 0.0;
                for k in 0..9_u32 {
                    let (current, limited) =
                        [(0.1, false), (-0.35, false), (2.0, true)][k as usize % 3];
                    let moved = 60 * k;
                    let command = match k {
                        0 => begun(&mut controller, count),
                        _ => controller.step(measured(count.wrapping_add(moved), applied)),
                    };
                    assert!((command.current.0 - current).abs() < 1e-6, "step {k}");
                    assert_eq!((command.enable, command.limited), (true, limited));
                    let record = *controller.telemetry();
                    assert_eq!(record.state, State::Exciting);
                    assert_eq!(record.count, count.wrapping_add(moved));
                    assert!((record.position - position - moved as f32 * 1e-6).abs() < 1e-9);
                    assert_eq!(record.applied_current, applied);
                    assert_eq!(
                        (record.command, record.limited),
                        (command.current.0, limited)
                    );
                    applied = command.current.0;
                }
                assert_eq!(
                    controller.step(measured(count, applied)),
                    Command::default()
                );
                let record = *controller.telemetry();
                assert_eq!((record.state, record.applied_current), (State::Idle, 2.0));
                controller.request(Request::Start);
                assert!(!controller.step(measured(count, 0.0)).enable);
                assert_eq!(controller.state(), State::Idle);
                if again == 0 {
                    controller.request(Request::Excite(EXCITATION));
                }
            }
        }
    }

    #[test]
    fn an_excitation_that_goes_wrong_is_a_fault() {
        for (count, current, fault) in [
            (500 + 1001, 0.0, Fault::Travel),
            (0xFFFF & (500 - 1001_i32) as u32, 0.0, Fault::Travel),
            (30_000, 0.0, Fault::EncoderJump),
            (500, f32::NAN, Fault::NonFinite),
            (500, -2.1, Fault::AppliedCurrent),
        ] {
            let mut controller = exciting(EXCITATION);
            assert!(begun(&mut controller, 500).enable);
            assert!(controller.step(measured(500 + 999, 0.1)).enable);
            let command = controller.step(measured(count, current));
            assert_eq!(command, Command::default());
            assert_eq!(controller.state(), State::Fault(fault));
            // It stays, and is left as any fault.
            controller.request(Request::Excite(EXCITATION));
            assert!(!controller.step(measured(count, 0.0)).enable);
            controller.request(Request::Stop);
            controller.request(Request::Excite(EXCITATION));
            assert!(begun(&mut controller, count).enable);
        }
        assert_eq!(Fault::Travel.number(), 8);
        for (unit, travel) in [
            (f32::NAN, 1.0),
            (f32::INFINITY, 1.0),
            // A step times this is no number.
            (f32::MAX, 1.0),
            (1e-3, f32::NAN),
            (1e-3, f32::INFINITY),
        ] {
            let mut controller = exciting(Excitation {
                unit,
                travel,
                ..EXCITATION
            });
            assert_eq!(begun(&mut controller, 500), Command::default());
            assert_eq!(controller.state(), State::Fault(Fault::NonFinite));
        }
        // An encoder that shows nothing, and a machine that is not at rest.
        let mut controller = exciting(EXCITATION);
        assert!(begun(&mut controller, 500).enable);
        assert_eq!(controller.step(measured(500, 0.1)), Command::default());
        assert_eq!(controller.state(), State::Fault(Fault::NoMotion));
        let mut controller = exciting(EXCITATION);
        for k in 0..2100 {
            let count = 500 + 4 * k;
            assert_eq!(controller.step(measured(count, 0.0)), Command::default());
        }
        assert_eq!(controller.state(), State::Fault(Fault::NotAtRest));
    }

    /// What was estimated is not shown when nothing is estimated any more.
    #[test]
    fn estimates_are_those_of_a_running_drive() {
        let mut controller = running();
        controller.request(Request::Step(Position(0.01)));
        for k in 0..20 {
            controller.step(measured(40 * k, 0.1));
        }
        let record = *controller.telemetry();
        assert!(record.velocity != 0.0 && record.reference != 0.0);
        controller.request(Request::Stop);
        controller.step(measured(800, 0.0));
        let record = *controller.telemetry();
        assert_eq!((record.velocity, record.reference), (0.0, 0.0));
        assert_eq!((record.count, record.load_position), (800, [0.0]));
        assert!((record.position - 800e-6).abs() < 1e-9);
    }

    #[test]
    fn an_excitation_can_be_stopped_and_does_not_interrupt() {
        let mut controller = exciting(EXCITATION);
        assert!(begun(&mut controller, 500).enable);
        controller.request(Request::Commission);
        controller.request(Request::Start);
        controller.request(Request::Step(Position(0.01)));
        controller.step(measured(600, 0.0));
        assert_eq!(controller.state(), State::Exciting);
        controller.request(Request::Stop);
        assert_eq!(controller.step(measured(500, 0.0)), Command::default());
        assert_eq!(controller.state(), State::Idle);

        let mut controller = running();
        controller.step(measured(0, 0.0));
        controller.request(Request::Excite(EXCITATION));
        controller.step(measured(0, 0.0));
        assert_eq!(controller.state(), State::Running);
        let mut controller = Controller::new(&gains()).unwrap();
        controller.request(Request::Commission);
        controller.request(Request::Excite(EXCITATION));
        controller.step(measured(0, 0.0));
        assert_eq!(controller.state(), State::Commissioning);
    }

    #[test]
    fn gains_that_cannot_be_run_are_refused() {
        let refused = |change: fn(&mut Gains<1, 5>)| {
            let mut gains = gains();
            change(&mut gains);
            Controller::new(&gains).err()
        };
        assert_eq!(refused(|_| ()), None);
        assert_eq!(
            refused(|g| g.sample_time = 0.0),
            Some(GainsError::NotPositive("sample_time"))
        );
        assert_eq!(
            refused(|g| g.encoder.counter_bits = 1),
            Some(GainsError::CounterBits)
        );
        assert_eq!(
            refused(|g| g.observer.form = Form::Reaction),
            Some(GainsError::ObserverStates)
        );
        assert_eq!(
            refused(|g| g.actuator.mass_deviation = -0.06),
            Some(GainsError::Deviation)
        );
        assert_eq!(
            refused(|g| g.observer.transition[2][3] = f32::NAN),
            Some(GainsError::NotFinite("observer.transition"))
        );
        assert_eq!(
            refused(|g| g.limits.current_resolution = -1.0),
            Some(GainsError::Negative("limits.current_resolution"))
        );
    }

    proptest! {
        /// Whatever is measured and asked, what is no number included: the command is finite, within
        /// the limit, and zero unless the drive runs.
        #[test]
        fn every_command_is_safe(
            inputs in prop::collection::vec(
                (any::<u32>(), prop::num::f32::ANY, 0..25_u8, prop::num::f32::ANY),
                1..200,
            ),
        ) {
            let mut controller = running();
            for (count, current, action, position) in inputs {
                match action {
                    0 => controller.request(Request::Start),
                    1 => controller.request(Request::Stop),
                    2 => controller.request(Request::Step(Position(position))),
                    3 => controller.request(Request::Move(Position(position))),
                    4 => controller.request(Request::Commission),
                    5 => controller.request(Request::Excite(Excitation {
                        profile: &[i16::MAX, 10, i16::MIN, -200],
                        unit: position,
                        repetitions: 20,
                        travel: current,
                    })),
                    6 => controller.request(Request::Excite(EXCITATION)),
                    _ => {}
                }
                // Plausible measurements mostly, so that the drive keeps running for a while.
                let measurement = if action > 7 && current.is_finite() {
                    measured(count % 2000, (current % 2.0) * 0.5)
                } else {
                    measured(count, current)
                };
                let command = controller.step(measurement);
                prop_assert!(command.current.0.abs() <= 2.0);
                let may_act = matches!(
                    controller.state(),
                    State::Running | State::Commissioning | State::Exciting
                );
                prop_assert!(may_act || !command.enable);
                prop_assert!(command.enable || command.current.0 == 0.0);
                let record = controller.telemetry();
                prop_assert!(record.command.is_finite() && record.applied_current.is_finite());
            }
        }
    }
}
