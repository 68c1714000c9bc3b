//! The link of the release ELF on the virtual board: commanded over its serial line, and abused over it.
#![cfg(feature = "virtual-board")]

use arso_core::link::frame::Receiver;
use arso_core::link::message::{Answer, Ask, Asked, HELLO, Introduction, TAG, VERSION, WORDS};
use arso_core::request::{At, Homing, Reason, Request};
use arso_core::{Current, Mode, Place, Velocity};
use arso_tests::virtual_board::host::{Heard, Host, framed};
use arso_tests::virtual_board::image::{RAM, RAM_SIZE};
use arso_tests::virtual_board::rig::{Period, Switches};
use host_sim::capture::{Origin, read_defmt, read_memory};
use host_sim::design::Design;
use host_sim::drive::Drive;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

#[test]
fn it_says_which_drive_it_is() {
    let mut host = Host::new();
    host.send(&framed(HELLO, &()));
    let mut receiver = Receiver::default();
    host.rig.periods(3).unwrap();
    let bytes = host.rig.board.bus_mut().received();
    let (last, rest) = bytes.split_last().unwrap();
    assert!(rest.iter().all(|byte| receiver.take(*byte).is_none()));
    let hello = receiver.take(*last).unwrap().unwrap();
    assert_eq!(hello.tag, HELLO);
    let said: Introduction = hello.message().unwrap();
    let expected = Origin::of(&Design::new(&Drive::default_drive()).unwrap()).unwrap();
    assert_eq!((said.version, said.tag, said.loads), (VERSION, TAG, 3));
    assert_eq!((&*said.kind, said.resolution), ("linear", 1e-6));
    assert_eq!(said.fingerprint, expected.fingerprint);
}

#[test]
fn a_machine_is_commanded_over_it() {
    let mut host = Host::new();
    let nothing = host.status();
    assert_eq!((nothing.mode, nothing.run_switch), (Mode::Idle, false));
    assert!(nothing.remote && nothing.damaged == 0 && nothing.lost == 0);
    // The run switch is open: nothing moves, whoever asks.
    assert_eq!(host.request(Request::Commission), Err(Reason::RunSwitch));
    // From now on the link commands alone: closing it asks for nothing.
    host.rig.switches(Switches::run(1));
    let periods = host.periods(500);
    assert!(periods.iter().all(|period| !period.enabled));
    assert_eq!(host.request(Request::Start), Err(Reason::Mode));
    assert_eq!(host.request(Request::Commission), Ok(()));
    host.until(3000, |status| status.mode == Mode::Ready);
    assert_eq!(host.request(Request::SetPosition(Place(0))), Ok(()));
    assert_eq!(host.request(Request::Start), Ok(()));

    // From the first bit of the command to the current of the move: three periods at most, and the answer comes soon.
    host.periods(50);
    let at_rest = host.periods(1)[0].code.unwrap();
    let ask = Ask::Request(Request::Move(Place(30_000)));
    host.number = host.number.wrapping_add(1);
    let number = host.number;
    host.send(&framed(TAG, &Asked { number, ask }));
    let periods = host.periods(4);
    let moved = |period: &Period| period.code.unwrap().abs_diff(at_rest) > 200;
    let latency = periods.iter().position(moved).unwrap() + 1;
    assert!(latency <= 3, "{latency}");
    let answered = host.telemetry.iter().any(|heard| heard.number == number);
    assert!(answered);
    host.periods(1000);
    let status = host.status();
    assert_eq!(
        (status.mode, status.held),
        (Mode::Running, Some(Place(30_000)))
    );
    for position in host.truth() {
        assert!((position - 0.03).abs() < 20e-6, "{position}");
    }
    assert_eq!(host.request(Request::MoveBy(-12_500)), Ok(()));
    host.periods(1000);
    for position in host.truth() {
        assert!((position - 0.0175).abs() < 20e-6, "{position}");
    }
    assert_eq!(
        host.request(Request::Move(Place(i64::MAX))),
        Err(Reason::Unreachable)
    );
    assert_eq!(
        host.request(Request::Jog(Velocity(f32::INFINITY))),
        Err(Reason::Unreachable)
    );

    // What is asked is asked once, however often it comes.
    let number = host.number.wrapping_add(1);
    host.number = number;
    let ask = Ask::Request(Request::MoveBy(1000));
    for _ in 0..5 {
        let ask = ask.clone();
        host.send(&framed(TAG, &Asked { number, ask }));
        host.periods(7);
    }
    let answers = host
        .telemetry
        .drain(..)
        .filter(|heard| heard.number == number);
    assert!(answers.count() >= 4);
    host.periods(800);
    assert_eq!(host.status().held, Some(Place(18_500)));

    // The run switch wins.
    host.rig.switches(Switches::default());
    let periods = host.periods(3);
    assert!(!periods[1].enabled);
    assert_eq!(host.request(Request::Start), Err(Reason::RunSwitch));
    assert!(matches!(host.ask(Ask::Faults), Answer::Faults(faults) if faults.is_empty()));
}

/// Targets drawn at random, each of which is reached by the actuator and by every load.
fn reaches_random_targets(targets: usize) {
    let mut host = Host::running();
    let mut random = ChaCha8Rng::seed_from_u64(1000);
    for number in 0..targets {
        let target = random.random_range(-60_000..60_000);
        assert_eq!(host.request(Request::Move(Place(target))), Ok(()));
        host.until(2000, |status| status.held == Some(Place(target)));
        host.periods(150);
        for position in host.truth() {
            let off = position - target as f64 * 1e-6;
            assert!(off.abs() < 50e-6, "target {number}: {off}");
        }
    }
    let status = host.status();
    assert_eq!(
        (status.mode, status.lost, status.damaged),
        (Mode::Running, 0, 0)
    );
}

#[test]
fn random_targets_are_reached() {
    reaches_random_targets(20);
}

/// Some minutes: `cargo test --release -p arso-tests --features virtual-board --test all board_link -- --ignored`.
#[test]
#[ignore = "takes minutes"]
fn a_thousand_random_targets_are_reached() {
    reaches_random_targets(1000);
}

#[test]
fn a_jog_ends_in_a_planned_stop_where_the_host_is_unplugged() {
    let mut host = Host::running();
    assert_eq!(host.request(Request::Jog(Velocity(0.05))), Ok(()));
    for _ in 0..20 {
        host.periods(40);
        assert_eq!(host.ask(Ask::Heartbeat), Answer::Taken);
    }
    let velocity = host.rig.plant().state()[1];
    assert!((velocity - 0.05).abs() < 0.002, "{velocity}");
    // In the middle of a frame.
    let frame = framed(
        TAG,
        &Asked {
            number: 99,
            ask: Ask::Heartbeat,
        },
    );
    host.send(&frame[..frame.len() / 2]);
    let before = host.truth()[0];
    host.periods(100);
    assert!((host.truth()[0] - before - 0.005).abs() < 0.0003);
    host.periods(900);
    let after = host.truth();
    // It is brought to rest without a fault, soon, and every mass with it.
    assert!(after[0] - before < 0.015, "{}", after[0] - before);
    let state = host.rig.plant().state();
    assert!(
        state
            .iter()
            .skip(1)
            .step_by(2)
            .all(|velocity| velocity.abs() < 1e-3)
    );
    let status = host.status();
    assert_eq!(status.mode, Mode::Running);
    assert!(status.held.is_some() && !status.jogging && status.damaged == 1);
}

/// By a stop at -5 mm, and then by the home switch, active above 8 mm; places by their true positions.
#[test]
fn zero_is_found_over_it() {
    let mut host = Host::running();
    host.rig.stop_at(-5e-3);
    let stop = Homing {
        velocity: Velocity(-0.05),
        at: At::Stop {
            current: Current(0.3),
        },
        position: Place(0),
        back_off: 4000,
    };
    let mut slowest = 0;
    let mut home = |host: &mut Host, homing: Homing| {
        host.periods(600);
        assert_eq!(host.request(Request::Home(homing)), Ok(()));
        assert!(host.status().homing);
        for _ in 0..400 {
            for _ in 0..10 {
                let home = host.truth()[0] > 8e-3;
                host.rig.home_switch(home);
                let period = host.periods(1)[0];
                slowest = slowest.max(period.instructions);
            }
            let status = host.status();
            if !status.homing {
                return status;
            }
        }
        panic!("{:?}", host.status());
    };
    let found = home(&mut host, stop);
    assert_eq!((found.mode, found.held), (Mode::Running, Some(Place(4000))));
    assert!(found.position_set);
    for position in host.truth() {
        assert!((position + 1e-3).abs() < 50e-6, "{position}");
    }
    let input = Homing {
        velocity: Velocity(0.05),
        at: At::Input,
        position: Place(1000),
        ..stop
    };
    let found = home(&mut host, input);
    assert_eq!(
        (found.mode, found.held),
        (Mode::Running, Some(Place(-3000)))
    );
    for position in host.truth() {
        // A period of the approach beyond the edge at most.
        assert!(
            (4e-3 - 50e-6..4e-3 + 100e-6).contains(&position),
            "{position}"
        );
    }
    println!("{slowest} instructions at most");
    // The host is gone.
    host.periods(600);
    assert_eq!(host.request(Request::Home(stop)), Ok(()));
    host.periods(1000);
    let status = host.status();
    assert!(status.held.is_some() && !status.homing, "{status:?}");
    assert_eq!(status.mode, Mode::Running);
}

/// What waits for rest is never held on the way, and a jog that waits is watched.
#[test]
fn what_is_asked_on_top_of_a_move_waits_for_its_end() {
    let mut host = Host::running();
    assert_eq!(host.request(Request::Move(Place(40_000))), Ok(()));
    host.periods(20);
    // It lies behind.
    assert_eq!(host.request(Request::Move(Place(-10_000))), Ok(()));
    let held = host.until(2000, |status| status.held.is_some());
    assert_eq!(held.held, Some(Place(-10_000)));
    assert_eq!(host.request(Request::Move(Place(30_000))), Ok(()));
    host.periods(20);
    assert_eq!(host.request(Request::Jog(Velocity(-0.05))), Ok(()));
    // The host is gone.
    host.periods(1500);
    let status = host.status();
    assert!(status.held.is_some() && !status.jogging, "{status:?}");
    // A step waits for rest too, and ends a jog.
    assert_eq!(host.request(Request::Jog(Velocity(0.05))), Ok(()));
    host.periods(50);
    let near = host.status().position * 1e6;
    let place = Place(near as i64 + 10_000);
    assert_eq!(host.request(Request::Step(place)), Ok(()));
    host.periods(1000);
    assert_eq!(host.status().held, Some(place));
}

#[test]
fn the_last_moves_are_fetched_over_it() {
    let mut host = Host::running();
    for target in [20_000, 5000] {
        assert_eq!(host.request(Request::Move(Place(target))), Ok(()));
        host.periods(700);
    }
    let mut words = Vec::new();
    loop {
        let first = u16::try_from(words.len()).unwrap();
        let Answer::LastMoves(piece) = host.ask(Ask::LastMoves(first)) else {
            panic!("no words");
        };
        words.extend_from_slice(&piece);
        if piece.len() < WORDS {
            break;
        }
    }
    let bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
    let fetched = read_memory(&bytes, "link").unwrap();
    let ram = host.rig.board.memory(RAM, RAM_SIZE as usize);
    assert_eq!(fetched, read_memory(&ram, "ram").unwrap());
    assert!(fetched.moves.len() >= 2);
}

/// What the log has of a period, the link has too.
#[test]
fn telemetry_at_every_period_is_the_log() {
    let mut host = Host::running();
    assert_eq!(host.ask(Ask::Subscribe(1)), Answer::Taken);
    assert_eq!(host.request(Request::Move(Place(20_000))), Ok(()));
    host.periods(600);
    assert_eq!(host.ask(Ask::Subscribe(0)), Answer::Taken);
    let log = read_defmt(
        &arso_tests::firmware(),
        "firmware",
        &host.rig.log[..],
        |_| (),
    )
    .unwrap();
    assert_eq!((log.lost, log.malformed, host.damaged), (0, 0, 0));
    let telemetry: Vec<_> = host
        .telemetry
        .iter()
        .filter_map(|heard| match &heard.answer {
            Answer::Telemetry(record) => Some(record),
            _ => None,
        })
        .collect();
    assert!(telemetry.len() >= 600, "{}", telemetry.len());
    let first = telemetry[0].period;
    for (record, period) in telemetry.iter().zip(first..) {
        assert_eq!(record.period, period, "none is missing");
    }
    let from = log
        .records
        .iter()
        .position(|record| record.period == first)
        .unwrap();
    for (heard, logged) in telemetry.iter().zip(&log.records[from..]) {
        assert!(heard.columns().eq(logged.columns()));
    }
}

/// What the board did is the same, to the cycle.
fn same(periods: &[Period], quiet: &[Period]) {
    assert_eq!(periods.len(), quiet.len());
    for (k, both) in periods.iter().zip(quiet).enumerate() {
        assert_eq!(both.0, both.1, "period {k}");
    }
}

/// Whatever comes over the line, the control interrupt does what it does without it, to the cycle, and the machine
/// moves as it was told.
#[test]
fn abuse_is_not_felt() {
    let play = |abuse: &mut dyn FnMut(&mut Host, usize)| {
        let mut host = Host::running();
        assert_eq!(host.request(Request::Move(Place(30_000))), Ok(()));
        let mut periods = Vec::new();
        for k in 0..1000 {
            abuse(&mut host, k);
            periods.extend(host.periods(1));
        }
        let log = read_defmt(
            &arso_tests::firmware(),
            "firmware",
            &host.rig.log[..],
            |_| (),
        );
        let log = log.unwrap();
        let timing = log.messages.iter().any(|message| message.contains("fault"));
        assert!(!timing, "{:?}", log.messages);
        (periods, host)
    };
    let (quiet, _) = play(&mut |_, _| ());
    let mut random = ChaCha8Rng::seed_from_u64(18);
    let question = |number, ask| framed(TAG, &Asked { number, ask });

    // Noise, as much as the line carries.
    let (noisy, mut host) = play(&mut |host, _| {
        let mut noise = [0; 100];
        random.fill_bytes(&mut noise);
        host.send(&noise);
    });
    same(&noisy, &quiet);
    assert!(host.status().damaged > 100);

    // Frames of other versions, cut off, with a wrong checksum, and repeated ones.
    let mut random = ChaCha8Rng::seed_from_u64(19);
    let (bad, _) = play(&mut |host, k| {
        let mut frame = question(k as u8, Ask::Request(Request::Stop));
        match k % 4 {
            0 => {
                let number = 1;
                let ask = Ask::Request(Request::Stop);
                frame = framed(TAG ^ 1, &Asked { number, ask });
            }
            1 => frame.truncate(random.random_range(0..frame.len() - 1)),
            2 => frame[4] ^= 0x10,
            // The number of the move that is under way, and the same move.
            _ => frame = question(host.number, Ask::Request(Request::Move(Place(30_000)))),
        }
        host.send(&frame);
    });
    same(&bad, &quiet);

    // Both directions full: telemetry of every period, and questions with the longest answers.
    let (full, host) = play(&mut |host, k| {
        if k == 0 {
            host.send(&question(200, Ask::Subscribe(1)));
        }
        for number in 0..9 {
            host.send(&question(number, Ask::LastMoves(40)));
        }
    });
    same(&full, &quiet);
    let records = |heard: &&Heard| matches!(heard.answer, Answer::Telemetry(_));
    let (records, answers): (Vec<_>, Vec<_>) = host.telemetry.iter().partition(records);
    assert!(
        records.len() > 100 && answers.len() > 100,
        "{} {}",
        records.len(),
        answers.len()
    );
}
