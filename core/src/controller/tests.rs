//! The corridor in all its modes.

extern crate std;

mod homing;

use super::*;
use crate::actuator::Actuator;
use crate::amplifier::Amplifier;
use crate::friction::FrictionFeedForward;
use crate::limits::Limits;
use crate::moves::plans::Plans;
use crate::observer::{Anchored, LinearObserver};
use crate::protection::{ModelError, ProtectionLimits};
use crate::regulator::MassGain;
use crate::units::Travel;
use proptest::prelude::*;
use std::vec::Vec;

type Drive = Controller<'static, 1, Anchored<1, 5>>;

/// Change over a period after which nothing of the state is left.
const FORGETS: [[f32; 5]; 5] = [
    [-1.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, -1.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, -1.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, -1.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, -1.0],
];

/// One load that follows the actuator rigidly, no correction: PD control on the encoder.
pub(crate) fn settings() -> Settings<1, Anchored<1, 5>> {
    Settings {
        sample_time: 1e-3,
        encoder: Encoder {
            resolution: 1e-6,
            counter_bits: 16,
        },
        actuator: Actuator {
            mass: 0.059,
            force_constant: 6.43,
            mass_deviation: 0.0,
            force_constant_deviation: 0.0,
        },
        amplifier: Amplifier {
            step: 1e-3,
            zero_code: 2048,
            inverted: false,
        },
        disturbance_cutoff: 628.0,
        reaction_force_cutoff: 628.0,
        observer: Anchored::new(LinearObserver::new(
            FORGETS,
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0; 5],
        )),
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
        total_mass: 0.116,
        friction: FrictionFeedForward {
            coulomb: 0.0,
            viscous: 0.0,
            smoothing: 1e-3,
        },
        standstill: Standstill {
            tolerance: 50e-6,
            settling: 100,
            quiet: 50,
            least_velocity: 1e-3,
            // The velocity itself.
            intention: Regulator {
                actuator: MassGain {
                    position: 0.0,
                    velocity: -1.0,
                },
                loads: [MassGain {
                    position: 0.0,
                    velocity: 0.0,
                }],
            },
            rate: 0.01,
            urgent: 1.0,
            averaging: 0.01,
            learning: crate::standstill::FrictionLearning {
                gain: 0.0,
                rise: 0.0,
                push: 0.0,
                most: 1.0,
                stands: 1e-6,
                patience: 3,
                standing: 6,
            },
        },
        holding_force: 0.0,
        // So wide that the tests of the corridor see nothing of them.
        protection: ProtectionLimits {
            encoder_step: 1.0,
            velocity: 1e3,
            following_error: 10.0,
            reaction_force: 1e6,
            disturbance: 1e6,
            innovation: 1e6,
            tracking_error: 10.0,
            model_error: ModelError {
                disturbance: 0.0,
                innovation: 0.0,
                tracking_error: 0.0,
                remembered: 0.0,
            },
            deflection: [1e3],
            stiction: 1e3,
            saturation_time: 1e3,
            continuous_current: 10.0,
            thermal_time: 10.0,
            travel: None,
        },
    }
}

/// A rigid machine of 0.116 kg: from rest to rest over 20 mm by 1.8 A, 9.8 ms each way and as long again for
/// the rest, and to 0.5 m/s in 5 ms, in closed form.
static PLANS: Plans<'static> = crate::moves::tests::RIGID;

fn drive(settings: &Settings<1, Anchored<1, 5>>) -> Drive {
    Controller::new(settings, PLANS).unwrap()
}

/// A drive that has something to play.
fn new() -> Drive {
    Controller::new(&settings(), PLANS)
        .unwrap()
        .with_excitation(EXCITATION)
}

fn measured(count: u32, current: f32) -> Measurement {
    Measurement {
        count: Counts(count),
        current: Current(current),
        home: false,
    }
}

/// Proves the signs on a rigid actuator that follows the current.
fn commission(controller: &mut Drive) {
    controller.request(Request::Commission).unwrap();
    let mut position = controller.telemetry().position;
    let (mut velocity, mut current) = (0.0_f32, 0.0_f32);
    for _ in 0..2000 {
        let count = (position / 1e-6) as i32 as u32;
        current = controller.step(measured(count, current)).current.0;
        if controller.mode() == Mode::Ready {
            return;
        }
        velocity += 6.43 * current / 0.116 * 1e-3;
        position += velocity * 1e-3;
    }
    panic!("{:?}", controller.mode());
}

fn running() -> Drive {
    let mut controller = new();
    commission(&mut controller);
    controller.request(Request::Start).unwrap();
    controller
}

#[test]
fn an_idle_drive_gives_no_current_and_follows_the_encoder() {
    let mut controller = new();
    controller.request(Request::Step(Place(30000))).unwrap_err();
    assert_eq!(controller.step(measured(100, 0.0)), Command::default());
    assert_eq!(controller.step(measured(350, 0.0)), Command::default());
    assert!((controller.telemetry().position - 350e-6).abs() < 1e-9);
}

#[test]
fn no_loop_is_closed_before_the_signs_are_proven() {
    let mut controller = new();
    controller.request(Request::Start).unwrap_err();
    assert_eq!(controller.step(measured(0, 0.0)), Command::default());
    assert_eq!(controller.mode(), Mode::Idle);
}

/// The encoder runs backwards: the drive stops while it has moved by a few counts only.
#[test]
fn a_wrong_sign_is_a_fault() {
    let mut controller = new();
    controller.request(Request::Commission).unwrap();
    let (mut position, mut velocity, mut current) = (0.0_f32, 0.0_f32, 0.0_f32);
    for _ in 0..500 {
        let count = (-position / 1e-6) as i32 as u32;
        current = controller.step(measured(count, current)).current.0;
        velocity += 6.43 * current / 0.116 * 1e-3;
        position += velocity * 1e-3;
        if controller.mode() == Mode::Fault(Fault::Direction) {
            break;
        }
    }
    assert_eq!(controller.mode(), Mode::Fault(Fault::Direction));
    assert_eq!(current, 0.0);
    assert!(position < 450e-6);
}

#[test]
fn starting_holds_the_position_and_a_step_commands_the_gain() {
    let mut controller = running();
    let command = controller.step(measured(0xFFFF, 0.0));
    assert_eq!((command.current.0, command.enable), (0.0, true));
    controller.request(Request::Step(Place(20000))).unwrap();
    let command = controller.step(measured(0xFFFF, 0.0));
    assert!((command.current.0 - 0.6).abs() < 1e-6);
    controller.request(Request::Step(Place(1000000))).unwrap();
    let command = controller.step(measured(20, 0.6));
    assert_eq!((command.current.0, command.limited), (2.0, true));
}

/// Who records moves sees each in the period in which it begins, and no start for one.
#[test]
fn the_course_is_what_is_asked() {
    let mut controller = new();
    commission(&mut controller);
    assert_eq!(controller.doing().course, Course::Free);
    controller.request(Request::Start).unwrap();
    controller.step(measured(0, 0.0));
    let Course::Held(here) = controller.doing().course else {
        panic!("{:?}", controller.doing().course);
    };
    controller.request(Request::Move(here)).unwrap();
    controller.step(measured(0, 0.0));
    assert_eq!(controller.doing().course, Course::Held(here));
    let there = Place(here.0 + 1000);
    controller.request(Request::Step(there)).unwrap();
    controller.step(measured(0, 0.0));
    assert_eq!(controller.doing().course, Course::Held(there));
    controller.request(Request::Move(here)).unwrap();
    controller.step(measured(0, 0.0));
    assert_eq!(controller.doing().course, Course::Moved);
    controller.request(Request::Stop).unwrap();
    controller.step(measured(0, 0.0));
    assert_eq!(controller.doing().course, Course::Free);
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
        assert_eq!(controller.mode(), Mode::Fault(fault));
        controller.request(Request::Start).unwrap_err();
        controller.request(Request::Step(Place(10000))).unwrap_err();
        assert_eq!(controller.step(measured(count, 0.0)), Command::default());
        controller.request(Request::Stop).unwrap();
        controller.request(Request::Start).unwrap_err();
        assert!(!controller.step(measured(count, 0.0)).enable);
        commission(&mut controller);
    }
}

#[test]
fn what_no_move_leads_to_is_refused_and_changes_nothing() {
    for request in [
        Request::Move(Place(i64::MIN)),
        Request::Move(Place(i64::MAX)),
        Request::MoveBy(i64::MIN),
        Request::Step(Place(i64::MAX)),
        Request::Jog(Velocity(f32::NAN)),
        Request::Jog(Velocity(f32::NEG_INFINITY)),
    ] {
        let mut controller = running();
        let refusal = controller.request(request).unwrap_err();
        assert_eq!(refusal.reason, Reason::Unreachable);
        for _ in 0..10 {
            controller.step(measured(0, 0.0));
        }
        assert_eq!(controller.mode(), Mode::Running);
        assert_eq!(controller.doing().course, Course::Held(Place(0)));
    }
}

#[test]
fn a_move_by_counts_goes_on_from_the_last_target() {
    let mut controller = running();
    controller.request(Request::Move(Place(20_000))).unwrap();
    controller.request(Request::MoveBy(-5000)).unwrap();
    controller.step(measured(0, 0.0));
    // Under way, and at rest.
    controller.request(Request::MoveBy(1000)).unwrap();
    let follow = |controller: &mut Drive, periods| {
        for _ in 0..periods {
            let count = (controller.telemetry().reference * 1e6) as i32;
            controller.step(measured(count as u32 & 0xFFFF, 0.0));
        }
    };
    follow(&mut controller, 400);
    assert_eq!(controller.doing().course, Course::Held(Place(16_000)));
    controller.request(Request::MoveBy(-16_000)).unwrap();
    follow(&mut controller, 400);
    assert_eq!(controller.doing().course, Course::Held(Place(0)));
}

#[test]
fn a_move_waits_for_the_one_under_way() {
    let mut controller = running();
    // All that the plans may use.
    controller.request(Request::Move(Place(39000))).unwrap();
    controller.step(measured(0, 0.0));
    controller.request(Request::Move(Place(-10000))).unwrap();
    let mut highest = 0.0_f32;
    for _ in 0..400 {
        // The simulated actuator follows its reference.
        let reference = controller.telemetry().reference;
        let count = (reference * 1e6) as i32;
        controller.step(measured(count as u32 & 0xFFFF, 0.0));
        highest = highest.max(reference);
    }
    assert!((highest - 0.039).abs() < 1e-7, "{highest}");
    assert_eq!(controller.telemetry().reference, -0.01);
}

const EXCITATION: Excitation = Excitation {
    // The last is beyond the limit of 2 A.
    profile: &[100, -350, 9000],
    unit: 1e-3,
    repetitions: 3,
    travel: 1e-3,
};

fn exciting(excitation: Excitation) -> Drive {
    let mut controller = new().with_excitation(excitation);
    controller.step(measured(500, 0.0));
    controller.request(Request::Excite).unwrap();
    controller
}

/// Waits at rest until the first current flows, or nothing ever will; that period's command.
fn begun(controller: &mut Drive, count: u32) -> Command {
    for waited in 0..100 {
        let command = controller.step(measured(count, 0.0));
        if command.enable || controller.mode() != Mode::Exciting {
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
    let mut ready = new();
    commission(&mut ready);
    ready.request(Request::Excite).unwrap();
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
                assert_eq!(record.mode, Mode::Exciting);
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
            assert_eq!((record.mode, record.applied_current), (Mode::Idle, 2.0));
            controller.request(Request::Start).unwrap_err();
            assert!(!controller.step(measured(count, 0.0)).enable);
            assert_eq!(controller.mode(), Mode::Idle);
            if again == 0 {
                controller.request(Request::Excite).unwrap();
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
        assert_eq!(controller.mode(), Mode::Fault(fault));
        // It stays, and is left as any fault.
        controller.request(Request::Excite).unwrap_err();
        assert!(!controller.step(measured(count, 0.0)).enable);
        controller.request(Request::Stop).unwrap();
        controller.request(Request::Excite).unwrap();
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
        assert_eq!(controller.mode(), Mode::Fault(Fault::NonFinite));
    }
    // An encoder that shows nothing, and a machine that is not at rest.
    let mut controller = exciting(EXCITATION);
    assert!(begun(&mut controller, 500).enable);
    assert_eq!(controller.step(measured(500, 0.1)), Command::default());
    assert_eq!(controller.mode(), Mode::Fault(Fault::NoMotion));
    let mut controller = exciting(EXCITATION);
    for k in 0..2100 {
        let count = 500 + 4 * k;
        assert_eq!(controller.step(measured(count, 0.0)), Command::default());
    }
    assert_eq!(controller.mode(), Mode::Fault(Fault::NotAtRest));
}

/// What was estimated is not shown when nothing is estimated any more.
#[test]
fn estimates_are_those_of_a_running_drive() {
    let mut controller = running();
    controller.request(Request::Step(Place(10000))).unwrap();
    for k in 0..20 {
        controller.step(measured(40 * k, 0.1));
    }
    let record = *controller.telemetry();
    assert!(record.velocity != 0.0 && record.reference != 0.0);
    controller.request(Request::Stop).unwrap();
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
    controller.request(Request::Commission).unwrap_err();
    controller.request(Request::Start).unwrap_err();
    controller.request(Request::Step(Place(10000))).unwrap_err();
    controller.step(measured(600, 0.0));
    assert_eq!(controller.mode(), Mode::Exciting);
    controller.request(Request::Stop).unwrap();
    assert_eq!(controller.step(measured(500, 0.0)), Command::default());
    assert_eq!(controller.mode(), Mode::Idle);

    let mut controller = running();
    controller.step(measured(0, 0.0));
    controller.request(Request::Excite).unwrap_err();
    controller.step(measured(0, 0.0));
    assert_eq!(controller.mode(), Mode::Running);
    let mut controller = new();
    controller.request(Request::Commission).unwrap();
    controller.request(Request::Excite).unwrap_err();
    controller.step(measured(0, 0.0));
    assert_eq!(controller.mode(), Mode::Commissioning);
}

#[test]
fn settings_that_cannot_be_run_are_refused() {
    let refused = |change: fn(&mut Settings<1, Anchored<1, 5>>)| {
        let mut settings = settings();
        change(&mut settings);
        Controller::new(&settings, PLANS).err()
    };
    assert_eq!(refused(|_| ()), None);
    assert_eq!(
        refused(|s| s.sample_time = 0.0),
        Some(SettingsError::NotPositive("sample_time"))
    );
    assert_eq!(
        refused(|s| s.encoder.counter_bits = 1),
        Some(SettingsError::CounterBits)
    );
    assert_eq!(
        refused(|s| s.actuator.mass_deviation = -0.06),
        Some(SettingsError::Deviation)
    );
    assert_eq!(
        refused(|s| {
            let mut change = [[0.0; 5]; 5];
            change[2][3] = f32::NAN;
            s.observer = Anchored::new(LinearObserver::new(change, [0.0; 5], [0.0; 5], [0.0; 5]));
        }),
        Some(SettingsError::NotFinite("observer.change"))
    );
    assert_eq!(
        refused(|s| s.regulator.loads[0].velocity = f32::INFINITY),
        Some(SettingsError::NotFinite("regulator"))
    );
    assert_eq!(
        refused(|s| s.limits.current_resolution = -1.0),
        Some(SettingsError::Negative("limits.current_resolution"))
    );
    assert_eq!(
        refused(|s| s.protection.deflection = [0.0]),
        Some(SettingsError::NotPositive("protection.deflection"))
    );
}

/// The settings are one type for wire, file and memory, of any size; a wrong size is refused.
#[test]
fn settings_survive_a_wire() {
    let settings = settings();
    let bytes = postcard::to_allocvec(&settings).unwrap();
    assert_eq!(postcard::from_bytes(&bytes), Ok(settings));
    assert!(postcard::from_bytes::<Settings<2, Anchored<2, 7>>>(&bytes).is_err());
}

#[test]
fn a_drive_without_a_profile_refuses_to_excite() {
    let mut controller = drive(&settings());
    let refusal = controller.request(Request::Excite).unwrap_err();
    assert_eq!(
        (refusal.mode, refusal.reason),
        (Mode::Idle, Reason::NoExcitation)
    );
    assert_eq!(controller.mode(), Mode::Idle);
}

/// A running drive with limits of its own.
fn protected(change: impl FnOnce(&mut ProtectionLimits<1>)) -> Drive {
    let mut settings = settings();
    change(&mut settings.protection);
    let mut controller = drive(&settings);
    commission(&mut controller);
    controller.request(Request::Start).unwrap();
    controller
}

/// Runs a rigid machine, seen and driven as `seen(k, count)` and `driven(k, current)` make of it, until the
/// drive stops or half a second is over: the fault, its value, and the modes that it went through.
fn stopped(
    mut controller: Drive,
    target: f32,
    seen: impl Fn(u32, i32) -> i32,
    driven: impl Fn(u32, f32) -> f32,
) -> (Option<(Fault, f32)>, u32, bool) {
    let mut position = controller.telemetry().position;
    let (mut velocity, mut current, mut braked) = (0.0_f32, 0.0_f32, false);
    for k in 0..500 {
        let count = seen(k, libm::roundf(position / 1e-6) as i32);
        current = controller
            .step(measured(count as u32 & 0xFFFF, current))
            .current
            .0;
        if k == 0 {
            controller
                .request(Request::Step(Place((target / 1e-6) as i64)))
                .unwrap();
        }
        braked |= matches!(controller.mode(), Mode::Stopping(_));
        if let Mode::Fault(fault) = controller.mode() {
            return (Some((fault, controller.telemetry().fault_value)), k, braked);
        }
        // The current is held over the period.
        let acceleration = 6.43 * driven(k, current) / 0.116;
        position += velocity * 1e-3 + 0.5 * acceleration * 1e-6;
        velocity += acceleration * 1e-3;
    }
    (None, 500, braked)
}

/// Each limit stops a drive that is beyond it, with the value that was; one that is within goes on.
#[test]
fn every_limit_stops_the_drive() {
    type Change = fn(&mut ProtectionLimits<1>);
    let limits: [(Fault, Change, f32); 6] = [
        (Fault::Velocity, |p| p.velocity = 0.05, 0.05),
        (Fault::ReactionForce, |p| p.reaction_force = 0.5, 0.5),
        (Fault::Unexpected, |p| p.innovation = 0.5, 0.5),
        (Fault::Saturated, |p| p.saturation_time = 0.01, 0.01),
        (Fault::FollowingError, |p| p.following_error = 0.05, 0.05),
        (
            Fault::Thermal,
            |p| (p.continuous_current, p.thermal_time) = (0.3, 0.1),
            0.3,
        ),
    ];
    let seen = |_, count| count;
    let driven = |_, current| current;
    assert_eq!(stopped(protected(|_| ()), 0.3, seen, driven).0, None);
    for (expected, change, limit) in limits {
        let (found, _, braked) = stopped(protected(change), 0.3, seen, driven);
        let (fault, value) = found.unwrap();
        assert_eq!(fault, expected);
        assert!(value.abs() >= limit, "{fault:?}: {value}");
        assert_eq!(braked, fault.reaction() == Reaction::Brake, "{fault:?}");
    }
}

/// A target that a disturbed memory moves away, however far, stops the drive where it is.
#[test]
fn a_target_that_is_far_away_at_once_is_not_run_to() {
    for bit in 16..64 {
        let mut controller = protected(|p| p.following_error = 0.05);
        closed_loop(&mut controller, 0, 0.0, 100);
        let Activity::Running(running) = &mut controller.activity else {
            panic!("{:?}", controller.mode());
        };
        running.memory.as_mut().unwrap().target.0 ^= 1 << bit;
        let commands = closed_loop(&mut controller, 0, 0.0, 500);
        assert_eq!(controller.mode(), Mode::Fault(Fault::FollowingError));
        let largest = commands.iter().map(|command| command.current.0.abs());
        assert!(largest.fold(0.0, f32::max) < 0.05, "bit {bit}");
    }
}

/// A drive that brakes shows its estimates, one that was stopped then does not.
#[test]
fn estimates_end_with_the_braking() {
    let mut controller = protected(|p| p.following_error = 0.005);
    controller.step(measured(0, 0.0));
    controller.request(Request::Step(Place(10000))).unwrap();
    for k in 0..5 {
        controller.step(measured(40 * k, 0.1));
    }
    assert_eq!(controller.mode(), Mode::Stopping(Fault::FollowingError));
    assert!(controller.telemetry().velocity != 0.0);
    controller.request(Request::Stop).unwrap();
    controller.step(measured(200, 0.0));
    let record = controller.telemetry();
    assert_eq!((record.velocity, record.reference), (0.0, 0.0));
}

/// A move that waits for another to end is forgotten when a fault brakes the drive: the reference stands
/// until the machine does.
#[test]
fn no_move_begins_while_the_drive_brakes() {
    let mut controller = protected(|p| (p.continuous_current, p.thermal_time) = (0.1, 0.1));
    let mut position = controller.telemetry().position;
    let (mut velocity, mut current) = (0.0_f32, 0.0_f32);
    let mut references = std::vec::Vec::new();
    for k in 0..1000 {
        let count = libm::roundf(position / 1e-6) as i32 as u32 & 0xFFFF;
        current = controller.step(measured(count, current)).current.0;
        if k < 2 {
            let target = [0.1, -0.1][k];
            controller
                .request(Request::Move(Place((target / 1e-6) as i64)))
                .unwrap();
        }
        if matches!(controller.mode(), Mode::Stopping(Fault::Thermal)) {
            references.push(controller.telemetry().reference);
        }
        if let Mode::Fault(_) = controller.mode() {
            break;
        }
        let acceleration = 6.43 * current / 0.116;
        position += velocity * 1e-3 + 0.5 * acceleration * 1e-6;
        velocity += acceleration * 1e-3;
    }
    assert_eq!(controller.mode(), Mode::Fault(Fault::Thermal));
    assert!(references.len() > 10, "{references:?}");
    assert!(
        references
            .iter()
            .all(|reference| *reference == references[0])
    );
}

/// The heat of the motor outlives the run and its mode, and fades as `exp(−t/τ)` without current: started
/// too early, the drive stops again.
#[test]
fn a_hot_motor_stays_hot() {
    let started_after = |cooling: u32| {
        let mut settings = settings();
        let protection = &mut settings.protection;
        (protection.continuous_current, protection.thermal_time) = (0.3, 0.1);
        let mut controller = drive(&settings);
        commission(&mut controller);
        let count = controller.telemetry().count;
        // 2 A until the mean square is 4 A² but for e⁻¹⁰.
        for _ in 0..1000 {
            controller.step(measured(count, 2.0));
        }
        for _ in 0..cooling {
            controller.step(measured(count, 0.0));
        }
        controller.request(Request::Start).unwrap();
        controller.step(measured(count, 0.0));
        controller.mode()
    };
    // 0.1 s ln(2² / 0.3²) = 379 ms.
    assert_eq!(started_after(370), Mode::Stopping(Fault::Thermal));
    assert_eq!(started_after(388), Mode::Running);
}

/// The encoder dies in motion, or the actuator is held: found long before the drive has gone far.
#[test]
fn a_dead_encoder_is_found() {
    let tight = |p: &mut ProtectionLimits<1>| (p.encoder_step, p.stiction) = (1e-4, 0.1);
    let driven = |_, current| current;
    let dies = |k: u32, count: i32| if k < 20 { count } else { 7000 };
    let (found, k, _) = stopped(protected(tight), 0.03, dies, driven);
    assert_eq!((found.unwrap().0, k), (Fault::EncoderStep, 20));
    let (found, k, _) = stopped(protected(tight), 0.001, |_, _| 40, driven);
    assert_eq!(found.unwrap().0, Fault::Stalled);
    assert!(k < 30, "{k}");
}

/// A fault that is found outside of the controller stops it at once; the first one stays.
#[test]
fn a_fault_from_outside_stops_the_drive() {
    let mut controller = protected(|_| ());
    assert!(controller.step(measured(40, 0.0)).enable);
    controller.trip(Fault::Timing);
    controller.trip(Fault::Amplifier);
    assert_eq!(controller.step(measured(40, 0.0)), Command::default());
    assert_eq!(controller.mode(), Mode::Fault(Fault::Timing));
}

/// The loop is not closed while the machine coasts: the drive waits for rest, and does not wait for ever.
#[test]
fn the_loop_is_not_closed_in_motion() {
    let mut controller = new();
    commission(&mut controller);
    let begin = controller.telemetry().count;
    let coast = |k: u32| begin.wrapping_add(3 * k) & 0xFFFF;
    for k in 0..100 {
        controller.step(measured(coast(k), 0.0));
    }
    controller.request(Request::Start).unwrap();
    for k in 100..2200 {
        assert_eq!(controller.step(measured(coast(k), 0.0)), Command::default());
    }
    assert_eq!(controller.mode(), Mode::Fault(Fault::NotAtRest));
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
            controller.excitation = Some(Excitation {
                profile: &[i16::MAX, 10, i16::MIN, -200],
                unit: position,
                repetitions: 20,
                travel: current,
            });
            let request = match action {
                0 => Some(Request::Start),
                1 => Some(Request::Stop),
                2 => Some(Request::Step(Place((position / 1e-6) as i64))),
                3 => Some(Request::Move(Place((position / 1e-6) as i64))),
                4 => Some(Request::Commission),
                5 => Some(Request::Excite),
                6 => {
                    controller.excitation = Some(EXCITATION);
                    Some(Request::Excite)
                }
                _ => None,
            };
            if let Some(request) = request {
                // Taken, or refused with the mode it was in, which then stands.
                let mode = controller.mode();
                if let Err(refusal) = controller.request(request) {
                    prop_assert_eq!((refusal.mode, controller.mode()), (mode, mode));
                }
            }
            // Plausible measurements mostly, so that the drive keeps running for a while.
            let measurement = if action > 7 && current.is_finite() {
                measured(count % 2000, (current % 2.0) * 0.5)
            } else {
                measured(count, current)
            };
            let command = controller.step(measurement);
            prop_assert!(command.current.0.abs() <= 2.0);
            let may_act = controller.mode().energised();
            prop_assert!(may_act || !command.enable);
            prop_assert!(command.enable || command.current.0 == 0.0);
            let record = controller.telemetry();
            prop_assert!(record.command.is_finite() && record.applied_current.is_finite());
        }
    }
}

/// The rigid actuator of `commission` under the drive's own current, with a constant force; what is commanded
/// in each period.
fn closed_loop(controller: &mut Drive, start: i64, force: f32, periods: u32) -> Vec<Command> {
    let (mut position, mut velocity, mut current) = (0.0_f64, 0.0_f64, 0.0_f32);
    let commands = (0..periods).map(|_| {
        let count = start + (position / 1e-6).round() as i64;
        let command = controller.step(measured(count as u32, current));
        current = command.current.0;
        if command.enable {
            let acceleration = f64::from(6.43 * current + force) / 0.116;
            position += velocity * 1e-3 + 0.5 * acceleration * 1e-6;
            velocity += acceleration * 1e-3;
        } else {
            // Its brake holds it.
            velocity = 0.0;
        }
        command
    });
    commands.collect()
}

/// Bit for bit the same at zero and a million million counts away, where `f32` metres tell 0.1 m apart.
#[test]
fn the_place_on_the_axis_costs_no_accuracy() {
    let run = |zero: i64| {
        let mut controller = new();
        let set = Request::SetPosition(Place(zero));
        controller.step(measured(0, 0.0));
        controller.request(set).unwrap();
        controller.request(Request::Commission).unwrap();
        let mut commands = closed_loop(&mut controller, 0, 0.0, 1500);
        assert_eq!(controller.mode(), Mode::Ready);
        let start = controller.encoder.place();
        controller.request(Request::Start).unwrap();
        let target = Place(zero + 20_000);
        controller.request(Request::Step(target)).unwrap();
        commands.extend(closed_loop(&mut controller, start.0 - zero, 0.0, 500));
        controller.request(Request::Move(Place(zero))).unwrap();
        commands.extend(closed_loop(&mut controller, 20_000, 0.0, 1000));
        commands
    };
    let near = run(1000);
    assert!(near.iter().any(|command| command.current.0 > 0.5));
    assert!(near == run(1 << 40));
    assert!(near == run(-(1 << 50)));
}

fn with_travel() -> Drive {
    let mut settings = settings();
    settings.protection.travel = Some(Travel {
        lowest: Place(-10_000),
        highest: Place(20_000),
    });
    drive(&settings)
}

#[test]
fn the_travel_counts_once_zero_is_known() {
    let mut controller = with_travel();
    controller.step(measured(0, 0.0));
    commission(&mut controller);
    controller.request(Request::Start).unwrap();
    controller.request(Request::Step(Place(25_000))).unwrap();
    controller.step(measured(10_000, 0.0));
    controller.step(measured(21_000, 0.0));
    assert!(!controller.telemetry().position_set);
    assert_eq!(controller.mode(), Mode::Running);
    controller
        .request(Request::SetPosition(Place(0)))
        .unwrap_err();

    controller.request(Request::Stop).unwrap();
    controller
        .request(Request::SetPosition(Place(5_000)))
        .unwrap();
    for _ in 0..100 {
        controller.step(measured(21_000, 0.0));
    }
    assert!(controller.telemetry().position_set);
    assert!((controller.telemetry().position - 0.005).abs() < 1e-9);
    controller.request(Request::Start).unwrap();
    controller.step(measured(21_000, 0.0));
    let refusal = controller
        .request(Request::Move(Place(20_001)))
        .unwrap_err();
    assert_eq!(refusal.reason, Reason::Travel);
    controller.request(Request::Step(Place(20_000))).unwrap();
    controller.step(measured(36_000, 0.0));
    assert_eq!(controller.mode(), Mode::Running);
    // Beyond it: the loop brakes, and the value is in metres.
    controller.step(measured(36_001, 0.0));
    assert_eq!(controller.mode(), Mode::Stopping(Fault::Travel));
    assert!((controller.telemetry().fault_value - 0.020_001).abs() < 1e-9);
}

/// Gravity of 1 N: without a word it pulls the drive away, with it the current is there from the first period
/// on and nothing moves.
#[test]
fn a_holding_force_carries_the_machine() {
    let mut settings = settings();
    settings.holding_force = 1.0;
    // A disturbance state that stays, behind both lags.
    let mut change = FORGETS;
    for row in &mut change[2..] {
        row[4] += 1.0;
    }
    let [none, input, output] = [
        [0.0; 5],
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0, 0.0],
    ];
    settings.observer = Anchored::new(LinearObserver::new(change, input, output, none));
    let mut controller = drive(&settings);
    controller.request(Request::Commission).unwrap();
    let commands = closed_loop(&mut controller, 0, -1.0, 1500);
    let first = commands.iter().find(|command| command.enable).unwrap();
    assert!((first.current.0 - 1.0 / 6.43).abs() <= 1e-3);
    assert_eq!(controller.mode(), Mode::Ready);
    assert!(controller.telemetry().position.abs() < 60e-6);
    let start = controller.encoder.place().0;
    controller.request(Request::Start).unwrap();
    for command in closed_loop(&mut controller, start, -1.0, 500) {
        assert!((command.current.0 - 1.0 / 6.43).abs() < 3e-3, "{command:?}");
    }
    assert!((controller.encoder.place().0 - start).abs() < 100);
    let record = controller.telemetry();
    assert!((record.reaction_force - 1.0).abs() < 0.1, "{record:?}");
}

type Change<'a> = &'a dyn Fn(&mut Parts<'_, 1, Anchored<1, 5>>);

/// Any bit of any number of the gains that flips is found within as many periods as there are parts.
#[test]
fn changed_settings_are_found() {
    let protection = |change: fn(&mut Settings<1, Anchored<1, 5>>)| {
        let mut settings = settings();
        change(&mut settings);
        let Settings {
            protection,
            actuator,
            encoder,
            limits,
            ..
        } = &settings;
        Protection::new(
            protection,
            (actuator, encoder, limits),
            (0.116, 0.0),
            (628.0, 1e-3),
        )
    };
    let changes: [Change<'_>; 17] = [
        &|parts| parts.protection = protection(|settings| settings.protection.velocity = 1.0),
        &|parts| parts.protection = protection(|settings| settings.protection.encoder_step = 2.0),
        &|parts| parts.protection = protection(|settings| settings.protection.stiction = 2.0),
        &|parts| parts.protection = protection(|settings| settings.protection.thermal_time = 2.0),
        &|parts| parts.current_per_force *= -1.0,
        &|parts| {
            let actuator = &settings().actuator;
            parts.reaction_force = ReactionForceObserver::new(actuator, 300.0, 628.0, 1e-3);
        },
        &|parts| {
            parts.direction_check =
                DirectionCheck::new(&settings().limits, &settings().actuator, parts.rest, 2e-3);
        },
        &|parts| parts.regulator.actuator.position += 1.0,
        &|parts| parts.limiter = parts.limiter.with_limit(20.0),
        &|parts| parts.sample_time = 0.0,
        &|parts| parts.holding_force.0 = -1.0,
        &|parts| parts.encoder.resolution *= 2.0,
        &|parts| parts.moves = Moves::new(PLANS, 1.0, 1e-6),
        &|parts| parts.friction.coulomb = 1.0,
        &|parts| parts.standstill.tolerance = 1.0,
        &|parts| {
            parts.rest = Rest::new(
                &parts.encoder,
                &settings().actuator,
                &settings().limits,
                1.0,
            );
        },
        &|parts| {
            parts.disturbance = DisturbanceObserver::new(&settings().actuator, 300.0, 1e-3);
        },
    ];
    for change in changes {
        for copy in [false, true] {
            let mut controller = running();
            controller.step(measured(0, 0.0));
            let parts = if copy {
                &mut controller.copy
            } else {
                &mut controller.parts
            };
            change(parts);
            for _ in 0..64 {
                controller.step(measured(0, 0.0));
            }
            assert_eq!(controller.mode(), Mode::Fault(Fault::Settings));
            assert_eq!(controller.step(measured(0, 0.0)), Command::default());
        }
    }
}

proptest! {
    /// The same for every number of the state observer.
    #[test]
    fn changed_observers_are_found(
        row in 0_usize..5, column in 0_usize..5, which in 0..4_u8, bit in 0_u32..32,
    ) {
        let mut linear = LinearObserver::new([[0.5; 5]; 5], [0.1; 5], [0.2; 5], [0.3; 5]);
        let before = Anchored::<1, 5>::new(linear.clone());
        let number = match which {
            0 => &mut linear.change[(row, column)],
            1 => &mut linear.input[row],
            2 => &mut linear.output[row],
            _ => &mut linear.correction[row],
        };
        *number = f32::from_bits(number.to_bits() ^ 1 << bit);
        let after = Anchored::<1, 5>::new(linear);
        prop_assert!((0..5).any(|part| !after.same(&before, part)));
        prop_assert!((7..12).all(|part| before.same(&before, part)));
    }
}

/// Runs a drive for some periods, the actuator at rest at a place; the last command.
fn hold(controller: &mut Drive, count: u32, periods: u32) -> Command {
    let mut command = Command::default();
    for _ in 0..periods {
        command = controller.step(measured(count, command.current.0));
    }
    command
}

fn other(
    alter: impl FnOnce(&mut Settings<1, Anchored<1, 5>>),
) -> change::Change<'static, 1, Anchored<1, 5>> {
    let mut settings = settings();
    alter(&mut settings);
    change::Change::new(&settings, PLANS).unwrap()
}

fn reason(result: Result<(), Refusal>) -> Reason {
    result.unwrap_err().reason
}

/// Held at its target, a drive takes another gain between two periods: the command goes on, and 20 um off the
/// new gain answers, not the old one.
#[test]
fn a_gain_is_changed_without_a_leap() {
    let mut controller = running();
    let count = controller.telemetry().count;
    let before = hold(&mut controller, count, 50);
    assert!(matches!(controller.doing().course, Course::Held(_)));
    let stiffer = other(|settings| settings.regulator.actuator.position = 60.0);
    controller.change(&stiffer).unwrap();
    assert_eq!(hold(&mut controller, count, 1), before);
    let off = |controller: &mut Drive| {
        hold(controller, count.wrapping_add(20), 20).current.0 - before.current.0
    };
    let mut unchanged = running();
    hold(&mut unchanged, count, 50);
    let (softly, stiffly) = (off(&mut unchanged), off(&mut controller));
    assert!((softly + 30.0 * 20e-6).abs() < 1e-3, "{softly}");
    assert!((stiffly + 60.0 * 20e-6).abs() < 1e-3, "{stiffly}");
    // The copy that the memory is held against changed with it.
    hold(&mut controller, count, 200);
    assert_eq!(controller.mode(), Mode::Running);
}

#[test]
fn what_would_leap_or_means_something_else_is_refused() {
    static SLOWER: Plans<'static> = Plans {
        stride: 2,
        ..crate::moves::tests::RIGID
    };
    let mut controller = running();
    let count = controller.telemetry().count;
    // It waits for rest.
    let same = other(|_| {});
    assert_eq!(reason(controller.change(&same)), Reason::Moving);
    hold(&mut controller, count, 50);
    controller.change(&same).unwrap();
    // Another meaning of counts, periods and currents, and another filter, whose memory would be another's.
    for other in [
        other(|settings| settings.encoder.resolution = 2e-6),
        other(|settings| settings.sample_time = 2e-3),
        other(|settings| settings.actuator.force_constant = 7.0),
        other(|settings| settings.disturbance_cutoff = 500.0),
        other(|settings| settings.reaction_force_cutoff = 500.0),
    ] {
        assert_eq!(reason(controller.change(&other)), Reason::Restart);
    }
    let slower = change::Change::new(&settings(), SLOWER).unwrap();
    assert_eq!(reason(controller.change(&slower)), Reason::Restart);
    // 2 mm off, a gain twice as large is 60 mA more, of which 20 mA may be.
    hold(&mut controller, count.wrapping_add(2000), 5);
    assert_eq!(controller.mode(), Mode::Running);
    let stiffer = other(|settings| settings.regulator.actuator.position = 60.0);
    assert_eq!(reason(controller.change(&stiffer)), Reason::Leap);
    // Nor may the limit cut what is commanded.
    let narrow = other(|settings| settings.limits.current_limit = 0.01);
    assert_eq!(reason(controller.change(&narrow)), Reason::Leap);
    // A move.
    hold(&mut controller, count, 50);
    controller.request(Request::MoveBy(10_000)).unwrap();
    assert_eq!(reason(controller.change(&same)), Reason::Moving);
    hold(&mut controller, count, 3);
    assert_eq!(reason(controller.change(&same)), Reason::Moving);
    controller.request(Request::Stop).unwrap();
    assert_eq!(reason(controller.change(&same)), Reason::Mode);
    // By itself it says nothing.
    let mut controller = running();
    assert_eq!(
        reason(controller.request(Request::Change)),
        Reason::NoSettings
    );
}

/// A drive that stores has no current, and heeds nothing until its reset.
#[test]
fn a_drive_that_stores_stays_off() {
    let mut controller = new();
    commission(&mut controller);
    controller.request(Request::Store).unwrap();
    for request in [
        Request::Stop,
        Request::Start,
        Request::Commission,
        Request::SetPosition(Place(0)),
    ] {
        assert_eq!(reason(controller.request(request)), Reason::Mode);
    }
    // The processor stood still, and the encoder went on.
    for count in [0, 30_000, 60_000, 7] {
        assert_eq!(controller.step(measured(count, 0.0)), Command::default());
        assert_eq!(controller.mode(), Mode::Storing);
    }
    let mut running = running();
    assert_eq!(reason(running.request(Request::Store)), Reason::Mode);
}
