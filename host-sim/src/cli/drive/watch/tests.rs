//! What `watch` makes of records and statuses, and how it looks.

use super::draw::draw;
use super::model::{Mass, Model, Subject, WINDOW};
use crate::capture::Origin;
use crate::machine::Kind;
use crate::simulate::corridor::Record;
use arso_core::link::message::{PastFault, Status};
use arso_core::{Fault, Mode, Place, Telemetry};
use ratatui::Terminal;
use ratatui::backend::TestBackend;

const EVERY: u16 = 10;

fn model() -> Model {
    Model::new(Subject {
        port: "/dev/ttyACM0".into(),
        firmware: "0.1.0".into(),
        origin: Origin {
            kind: Kind::Linear,
            loads: 2,
            period: 1e-3,
            fingerprint: 0xAB,
        },
        resolution: 1e-6,
        every: EVERY,
    })
}

fn record(period: u32) -> Record {
    Telemetry {
        mode: Mode::Running,
        command: -1.25,
        reference: 0.02,
        position: 0.0201,
        velocity: 0.5,
        load_position: vec![0.019, 0.018],
        load_velocity: vec![0.4, 0.3],
        ..opened(period)
    }
}

/// While the loop is open.
fn opened(period: u32) -> Record {
    Telemetry::<[f32; 2]> {
        period,
        mode: Mode::Ready,
        position: 0.0201,
        ..Telemetry::default()
    }
    .map(|loads| loads.to_vec())
}

fn status(mode: Mode) -> Status {
    Status {
        period: 20_000,
        mode,
        run_switch: true,
        position_set: true,
        held: Some(Place(20_000)),
        command: -1.25,
        current_limit: 5.0,
        vibration: 1.5e-6,
        worst_cycles: 9_876,
        lost: 7,
        damaged: 3,
        ..Status::default()
    }
}

/// A drive that has run for a while.
fn running() -> Model {
    let mut model = model();
    for period in 0..200 {
        model.take(&record(period * 10));
    }
    model.report(status(Mode::Running));
    model
}

fn drawn(model: &Model, width: u16, height: u16) -> TestBackend {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, model)).unwrap();
    terminal.backend().clone()
}

/// All that a terminal of that size shows.
fn shown(model: &Model, width: u16, height: u16) -> String {
    drawn(model, width, height).to_string()
}

fn shows(text: &str, words: &[&str]) {
    for words in words {
        assert!(text.contains(words), "{words} in\n{text}");
    }
}

#[test]
fn curves_go_back_as_far_as_the_window() {
    let mut model = model();
    // The number of the period wraps on the way.
    let begin = u32::MAX - 5_000;
    for number in 0..3_000_u32 {
        let time = model.take(&record(begin.wrapping_add(number * 10)));
        assert!((time.unwrap() - f64::from(number) * 0.01).abs() < 1e-9);
    }
    assert_eq!((model.taken, model.missed), (3_000, 0));
    for curve in model.positions.iter().chain([&model.current]) {
        let first = curve.points.front().unwrap().0;
        assert!((first - (model.time - WINDOW)).abs() < 0.0101, "{first}");
        assert!(curve.points.len() <= 1_001);
    }
    assert_eq!(model.positions.len(), 4);
    assert_eq!(model.positions[3].points[5].1, f64::from(0.018_f32));
    assert_eq!(model.largest_current, 1.25);
}

#[test]
fn what_does_not_come_is_counted() {
    let mut model = model();
    for period in [0, 10, 40, 50, 100] {
        assert!(model.take(&record(period)).is_some());
    }
    assert_eq!((model.taken, model.missed), (5, 6));
    // One that comes twice is none.
    assert_eq!(model.take(&record(100)), None);
    assert_eq!((model.taken, model.missed), (5, 6));
    // A reset begins anew, and nothing was missed.
    let before = model.time;
    let time = model.take(&record(3)).unwrap();
    assert!((time - before - 0.01).abs() < 1e-9);
    assert_eq!((model.taken, model.missed), (6, 6));
}

#[test]
fn loads_are_known_while_the_loop_is_closed() {
    let mut model = model();
    assert!(model.masses().iter().all(|mass| mass.position.is_none()));
    model.take(&opened(0));
    let position = Some(f64::from(0.0201_f32));
    let masses = model.masses();
    assert_eq!(masses[0].position, position);
    assert_eq!((masses[0].deviation, masses[1].position), (None, None));
    assert_eq!(model.positions[0].points.len(), 0);
    assert_eq!(model.positions[1].points.len(), 1);
    model.take(&record(10));
    let reference = f64::from(0.02_f32);
    let load = f64::from(0.018_f32);
    let expected = Mass {
        name: "load 2".into(),
        position: Some(load),
        deviation: Some(load - reference),
        velocity: Some(f64::from(0.3_f32)),
    };
    assert_eq!(model.masses()[2], expected);
    assert_eq!(model.reference(), Some(reference));
}

#[test]
fn everything_is_shown_with_its_unit() {
    let mut model = running();
    model.said = "stop: the machine comes to rest".into();
    let text = shown(&model, 120, 40);
    shows(
        &text,
        &[
            "linear-2-000000ab on /dev/ttyACM0, firmware 0.1.0",
            "operation enabled",
            "running",
            "closed",
            "its switches",
            "20.000 mm",
            "1.50 um rms",
            "9876",
            "0 of 200",
            "7 records",
            "3 frames",
            "load 2",
            "18.000 ",
            "-2000 ",
            "+100 ",
            "+0.3000",
            "-1.250 A of 5.00 A",
            "at [mm]",
            "off [um]",
            "v [m/s]",
            "position [mm]",
            "current [A]",
            "-10 s",
            "q, Esc: end",
            "comes to rest",
        ],
    );
    assert!(!text.contains("no answer"));
    model.current_limit = None;
    model.silent = Some(2.25);
    let text = shown(&model, 120, 40);
    shows(&text, &["largest so far 1.25 A", "no answer for 2.2 s"]);
}

#[test]
fn faults_are_said_in_words() {
    let mut model = running();
    let past = |period, fault| PastFault {
        period,
        fault,
        value: 2.5,
    };
    model.faults = vec![past(1_000, Fault::Travel), past(19_000, Fault::Velocity)];
    let text = shown(&model, 120, 40);
    shows(&text, &["last faults", "1.0 s ago: fault 10 (Velocity)"]);
    shows(&text, &["19.0 s ago: fault 8 (Travel), value 2.500"]);
    let status = Status {
        fault_value: 2.5,
        held: None,
        limited: true,
        ..status(Mode::Fault(Fault::Velocity))
    };
    model.report(status);
    let text = shown(&model, 120, 40);
    shows(
        &text,
        &["stopped by a fault", "ask for slower moves", "at its limit"],
    );
    // With little room what stops the drive is still there, and so are the keys.
    shows(
        &shown(&model, 80, 24),
        &["fault 10 (Velocity)", "load 2", "q, Esc: end"],
    );
}

#[test]
fn no_size_of_the_terminal_is_too_small() {
    let mut faulty = running();
    let fault = status(Mode::Stopping(Fault::Thermal));
    faulty.report(fault);
    faulty.faults = vec![
        PastFault {
            period: 5,
            fault: Fault::Thermal,
            value: 1.0
        };
        8
    ];
    for model in [&model(), &running(), &faulty] {
        for (width, height) in [
            (20, 5),
            (1, 1),
            (0, 0),
            (300, 2),
            (2, 100),
            (37, 15),
            (80, 24),
        ] {
            drawn(model, width, height);
        }
    }
}

#[test]
fn what_is_no_number_is_borne() {
    for odd in [f32::NAN, f32::INFINITY, f32::MAX, f32::MIN_POSITIVE] {
        let mut model = running();
        let mut record = record(2_000);
        record.command = odd;
        record.reference = odd;
        record.position = odd;
        record.load_position = vec![odd];
        record.load_velocity = vec![odd];
        model.take(&record);
        for current_limit in [odd, 0.0, -1.0] {
            model.report(Status {
                command: odd,
                current_limit,
                vibration: odd,
                fault_value: odd,
                ..status(Mode::Fault(Fault::NonFinite))
            });
            shown(&model, 100, 40);
        }
    }
}
