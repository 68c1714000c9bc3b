//! The excitation of the release ELF on the virtual board: what is played, logged and answered, and
//! what ends it.
#![cfg(feature = "virtual-board")]

use arso_core::{Counts, Current, Excitation, Fault, Measurement, Mode, Request};
use arso_tests::virtual_board::image::Image;
use arso_tests::virtual_board::rig::{Period, Switches};
use arso_tests::virtual_board::{Board, Rig};
use host_sim::capture::{Capture, read_defmt};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::excite::{ExcitationPlan, ExcitationRequest};
use host_sim::identify::{Columns, Experiment, Log, Parameters, identify};
use host_sim::machine::Friction;
use host_sim::output::unwatched;
use host_sim::report::log::csv;
use host_sim::simulate::corridor::{Record, corridor};
use host_sim::simulate::plant::Plant;
use host_sim::simulate::scenario::Scenario;

/// The default drive with a machine that has friction.
fn machine() -> (Drive, PlantFile) {
    let drive = Drive::default_drive();
    let plant = PlantFile {
        friction: Friction {
            coulomb: 0.1,
            viscous: 0.2,
            ..Friction::default()
        },
        ..PlantFile::from(&drive)
    };
    (drive, plant)
}

fn start(drive: &Drive, plant: &PlantFile) -> Rig {
    let image = Image::parse(&arso_tests::firmware()).unwrap();
    Rig::start(&image, drive, plant, |_| {}).unwrap()
}

fn decode(rig: &Rig) -> Capture {
    read_defmt(&arso_tests::firmware(), "firmware", &rig.log[..], |_| ()).unwrap()
}

/// What the firmware has, as `host-sim excite` forms it (`generated.rs` shows that it is the same).
fn play(drive: &Drive) -> ExcitationPlan {
    ExcitationPlan::new(drive, &ExcitationRequest::default()).unwrap()
}

/// Encoder counts of a play by the core on this machine, on a plant at rest at the origin.
fn host_counts(drive: &Drive, machine: &PlantFile, play: &ExcitationPlan) -> (Vec<u32>, Mode) {
    let design = Design::new(drive).unwrap();
    let excitation = Excitation {
        profile: Vec::leak(play.table.clone()),
        unit: play.unit as f32,
        repetitions: play.repetitions,
        travel: play.travel as f32,
    };
    let mut core = corridor(&design, Some(excitation)).unwrap();
    let mut plant = Plant::new(machine, drive.control.sample_time);
    core.request(Request::Excite).unwrap();
    let (mut counts, mut current) = (Vec::new(), Current(0.0));
    loop {
        let count = plant.count();
        let command = core.step(Measurement {
            count: Counts(count),
            current,
            home: false,
        });
        if !command.enable {
            // Waiting for rest, or at the end.
            if counts.is_empty() && core.record().mode == Mode::Exciting {
                continue;
            }
            return (counts, core.record().mode);
        }
        counts.push(count);
        current = command.current;
        plant.advance(current.0.into()).unwrap();
    }
}

fn counts(periods: &[Period]) -> Vec<u32> {
    periods.iter().map(|period| period.count).collect()
}

/// Positions behind the counts of a 16-bit counter that wraps, in counts from the first.
fn unwrapped(counts: &[u32]) -> Vec<i32> {
    let mut position = 0;
    let mut last = counts[0];
    let moved = counts.iter().map(|count| {
        position += i32::from(count.wrapping_sub(last) as u16 as i16);
        last = *count;
        position
    });
    moved.collect()
}

/// Every period of every repetition: the log's current is the table's, the count is that of the core
/// on this machine, and the converter makes what is logged.
#[test]
fn the_table_is_played_and_logged_to_the_last_step() {
    let (drive, plant) = machine();
    let play = play(&drive);
    let mut rig = start(&drive, &plant);
    let before = rig.board.interrupt_cost();
    let periods = rig.excite().unwrap();
    let after = rig.board.interrupt_cost();
    println!(
        "{} instructions per step, {} at most",
        (after.instructions - before.instructions) / (after.runs - before.runs),
        after.most_instructions
    );
    let steps: Vec<i16> = (0..play.repetitions)
        .flat_map(|_| play.table.clone())
        .collect();
    assert_eq!(periods.len(), steps.len());

    let (host, end) = host_counts(&drive, &plant, &play);
    assert_eq!(end, Mode::Idle);
    assert!(counts(&periods) == host, "the counts differ");
    // It is worth it: the actuator moves by thousands of counts.
    let positions = unwrapped(&host);
    let farthest = positions.iter().map(|p| p.unsigned_abs()).max().unwrap();
    println!("{farthest} counts travelled");
    assert!(farthest > 10_000 && f64::from(farthest) < play.travel / 1e-6);

    let capture = decode(&rig);
    assert_eq!((capture.lost, capture.malformed), (0, 0));
    let exciting = |record: &Record| record.mode == Mode::Exciting;
    let waiting = capture.records.iter().position(exciting).unwrap();
    // It waits until the encoder has stood still for 50 periods, and begins in the last of them.
    let first = waiting + 49;
    let (idle, rest) = capture.records.split_at(first);
    let (idle, waited) = idle.split_at(waiting);
    assert!(idle.iter().all(|record| record.mode == Mode::Idle));
    assert!(waited.iter().all(exciting));
    assert!(waited.iter().all(|record| record.command == 0.0));
    let (played, rest) = rest.split_at(steps.len());
    assert!(played.iter().all(exciting));
    assert!(rest.len() > 10 && rest.iter().all(|record| record.mode == Mode::Idle));
    for message in ["INFO exciting", "INFO idle"] {
        assert!(
            capture.messages.iter().any(|found| found == message),
            "{message}"
        );
    }
    // The current of a period is logged as applied in the next.
    let applied = capture.records[first + 1..]
        .iter()
        .map(|r| r.applied_current);
    let found = played.iter().zip(applied).zip(&periods).zip(&steps);
    for (k, (((record, applied), period), step)) in found.enumerate() {
        let in_steps = (f64::from(applied) / 1e-3).round();
        assert_eq!(in_steps, f64::from(*step), "step {k}");
        assert_eq!(record.command, applied, "step {k}");
        assert!(!record.limited, "step {k}");
        assert_eq!(record.count, period.count, "step {k}");
        assert_eq!(period.code, Some((2048 + step) as u16), "step {k}");
        let position = f64::from(positions[k]) * 1e-6;
        assert!(
            (f64::from(record.position) - position).abs() < 1e-7,
            "step {k}"
        );
    }
    assert!(rest[1..].iter().all(|record| record.applied_current == 0.0));
    assert!(rest.iter().all(|record| record.command == 0.0));
    let bus = rig.board.bus();
    assert!(!bus.ports[1].drives_high(12));
    assert_eq!(bus.current_reference(), Some(2048));
}

/// The switches: once per closing of the run switch, whatever the excite switch does meanwhile; a
/// bounce is none; opening stops at once; afterwards the drive commissions itself as ever.
#[test]
fn the_switches_begin_and_end_it() {
    let (drive, plant) = machine();
    let mut rig = start(&drive, &plant);
    let enabled = |periods: &[Period]| periods.iter().filter(|p| p.enabled).count();
    let excite_alone = Switches {
        excite: true,
        ..Switches::default()
    };
    rig.switches(excite_alone);
    assert_eq!(enabled(&rig.periods(50).unwrap()), 0);
    rig.switches(Switches::excite());
    assert_eq!(enabled(&rig.periods(9).unwrap()), 0);
    rig.switches(excite_alone);
    assert_eq!(enabled(&rig.periods(50).unwrap()), 0);

    // Stopped half way, the excite switch being opened before.
    rig.switches(Switches::excite());
    let begun = enabled(&rig.periods(500).unwrap());
    assert!((430..450).contains(&begun), "{begun}");
    rig.switches(Switches::run(0));
    assert_eq!(enabled(&rig.periods(500).unwrap()), 500);
    rig.switches(Switches::default());
    let stopping = rig.periods(50).unwrap();
    assert!(enabled(&stopping) < 15);
    assert!(!stopping.last().unwrap().enabled);

    // Played to its end it is not played again, and nothing else happens, until the run switch has
    // been opened and is closed again.
    let length = play(&drive).currents().count() as u32;
    rig.periods(1500).unwrap();
    rig.switches(Switches::excite());
    assert_eq!(
        enabled(&rig.periods(length + 200).unwrap()),
        length as usize
    );
    rig.switches(Switches::run(0));
    assert_eq!(enabled(&rig.periods(200).unwrap()), 0);
    rig.switches(Switches::default());
    rig.periods(500).unwrap();
    rig.commission().unwrap();
    let fig3 = Scenario::named("fig3").unwrap();
    rig.experiment(fig3, &plant, 500).unwrap();
    assert!((rig.plant().state()[0] - 0.03).abs() < 0.3e-3);

    // From a drive that is ready as well, and it then has to prove its signs anew.
    assert_eq!(rig.excite().unwrap().len(), length as usize);
    let capture = decode(&rig);
    let last: Vec<&str> = capture.messages.iter().rev().map(String::as_str).collect();
    let states = ["INFO idle", "INFO exciting", "INFO ready"];
    let last = last.into_iter().filter(|message| states.contains(message));
    assert_eq!(last.take(3).collect::<Vec<_>>(), states);
}

/// A motor six times as strong as the drive file says carries the actuator beyond its travel: stopped
/// in the period in which it is seen, and until the run switch is opened.
#[test]
fn an_actuator_that_leaves_its_travel_is_stopped() {
    let (drive, mut plant) = machine();
    plant.actuator.force_constant *= 6.0;
    let travel = play(&drive).travel;
    let mut rig = start(&drive, &plant);
    rig.periods(50).unwrap();
    rig.switches(Switches::excite());
    let mut enabled = 0;
    loop {
        let moved = rig.plant().state()[0].abs();
        let period = rig.period().unwrap();
        if !period.enabled && enabled > 0 {
            // Half a count of rounding.
            assert!(moved > travel - 1e-6, "{moved} {travel}");
            break;
        }
        assert!(moved < travel + 1e-6 && enabled < 8192, "{moved} {travel}");
        enabled += u32::from(period.enabled);
    }
    assert_eq!(rig.board.bus().current_reference(), Some(2048));
    let after = rig.periods(100).unwrap();
    assert!(after.iter().all(|period| !period.enabled));
    rig.switches(Switches::default());
    rig.periods(50).unwrap();
    let capture = decode(&rig);
    let fault = capture
        .records
        .iter()
        .find(|r| r.mode == Mode::Fault(Fault::Travel))
        .unwrap();
    assert!(f64::from(fault.position.abs()) > travel);
    assert_eq!(fault.command, 0.0);
    let expected = format!(
        "ERROR fault {}: Travel in period {}, value {}",
        Fault::Travel.number(),
        fault.period,
        fault.fault_value
    );
    assert!(
        capture.messages.contains(&expected),
        "{:?}",
        capture.messages
    );
    assert_eq!(capture.records.last().unwrap().mode, Mode::Idle);
}

/// An encoder that is not connected shows no travel: nothing is played beyond the first half of the
/// table, at the end of which it must have been seen to move.
#[test]
fn a_dead_encoder_ends_it() {
    let (drive, plant) = machine();
    let mut rig = start(&drive, &plant);
    rig.wiring.encoder_unplugged = true;
    let periods = rig.excite().unwrap();
    assert_eq!(periods.len(), play(&drive).table.len() / 2);
    let messages = decode(&rig).messages;
    assert!(
        messages
            .iter()
            .any(|text| text.starts_with("ERROR fault 6: NoMotion")),
        "{messages:?}"
    );
}

/// Whatever the switches say when the processor starts: nothing moves before the run switch has been
/// open.
#[test]
fn nothing_moves_after_a_reset_with_the_run_switch_closed() {
    let (drive, plant) = machine();
    for switches in [Switches::run(1), Switches::excite()] {
        let image = Image::parse(&arso_tests::firmware()).unwrap();
        let closed = |board: &mut Board| {
            let port = &mut board.bus_mut().ports[2];
            port.set_level(2, true);
            port.set_level(3, switches.excite);
        };
        let mut rig = Rig::start(&image, &drive, &plant, closed).unwrap();
        rig.switches(switches);
        assert!(
            rig.periods(3000)
                .unwrap()
                .iter()
                .all(|period| !period.enabled)
        );
        rig.switches(Switches::default());
        rig.periods(50).unwrap();
        rig.switches(switches);
        assert!(
            rig.periods(500)
                .unwrap()
                .iter()
                .any(|period| period.enabled)
        );
    }
}

/// A target switch that chatters does not keep the run switch from stopping the drive.
#[test]
fn a_chattering_switch_does_not_hold_the_drive() {
    let (drive, plant) = machine();
    let mut rig = start(&drive, &plant);
    rig.commission().unwrap();
    rig.switches(Switches::run(0));
    assert!(rig.periods(100).unwrap().last().unwrap().enabled);
    let mut last = None;
    for k in 0..30 {
        rig.switches(Switches {
            target: k / 4 % 4,
            ..Switches::default()
        });
        last = Some(rig.period().unwrap());
    }
    assert!(!last.unwrap().enabled);
}

/// From the board's log to the machine: a spring and a mass that the drive file has wrong, and friction
/// that it does not have, are found from what the firmware logged.
#[test]
fn the_machine_is_identified_from_the_boards_log() {
    let (drive, mut plant) = machine();
    plant.loads[0].stiffness = 350.0;
    plant.loads[2].mass = 0.023;
    let mut rig = start(&drive, &plant);
    rig.excite().unwrap();
    let csv = csv(&decode(&rig), drive.control.sample_time, drive.kind).unwrap();
    let log = Log::parse(&csv[..], "log.csv", &drive, &Columns::default()).unwrap();
    let hold = ["actuator.force_constant".to_owned()];
    let parameters = Parameters::new(&drive, Experiment::Excitation, &hold).unwrap();
    let found = identify(&drive, &[log], &parameters, &unwatched)
        .unwrap()
        .quantities;
    for (name, truth) in [
        ("actuator.mass", 0.059),
        ("load[1].stiffness", 350.0),
        ("load[2].stiffness", 300.0),
        ("load[3].mass", 0.023),
        ("load[3].damping", 0.1),
        ("friction.coulomb", 0.1),
        ("friction.viscous", 0.2),
    ] {
        let found = found.iter().find(|found| found.quantity.name() == name);
        let found = found.unwrap_or_else(|| panic!("{name} is not there"));
        let value = found.value;
        println!("{name}: {value} +- {}", found.std);
        assert!((value / truth - 1.0).abs() < 0.01, "{name}: {value}");
    }
}
