//! A drive commanded as its user commands it: the release ELF on the virtual board behind a pseudo-terminal or a TCP
//! port, `host-sim`'s end of the link on the other side.
#![cfg(feature = "virtual-board")]

use arso_core::link::image::{HEADER, Header};
use arso_core::link::message::Source;
use arso_core::request::{Reason, Request};
use arso_core::{Mode, Place};
use arso_tests::drives::belt;
use arso_tests::learning::{error_of_the_whole, learned};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::error::Error;
use host_sim::identify::drive_file;
use host_sim::link::{Connection, Port, Pushed};
use host_sim::report::link::{settings, settings_json};
use host_sim::report::record::csv;
use host_sim::simulate::corridor::settings_image;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A virtual board in real time, which ends with this.
struct Board {
    program: Child,
    port: String,
}

impl Board {
    fn start(serial: &[&str]) -> Self {
        let mut program = Command::new(env!("CARGO_BIN_EXE_virtual-board"))
            .arg(arso_tests::target_binary("arso-firmware"))
            .args(serial)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let output = program.stdout.take().unwrap();
        let line = BufReader::new(output).lines().next().unwrap().unwrap();
        let port = line.split_whitespace().last().unwrap().to_owned();
        Self { program, port }
    }

    /// Ends it in order, so that its flash is written.
    fn switch_off(mut self) {
        drop(self.program.stdin.take());
        assert!(self.program.wait().unwrap().success());
    }

    fn connect(&self) -> Connection {
        Connection::new(Port::open(&self.port).unwrap()).unwrap()
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

const GO_ON: fn() -> bool = || true;

/// How near to its target the actuator comes, m: 40 counts of its encoder.
const TOLERANCE: f64 = 200e-6;

/// Where a test keeps its files.
fn scratch(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_file(&path);
    path
}

/// The machine that a belt drive moves, which is not quite the one that its file describes: springs that are a fifth
/// softer, and more friction.
fn belt_machine(drive: &str) -> String {
    let mut machine = drive.to_owned();
    for (stated, true_one) in [("30e3", "24e3"), ("20e3", "16e3"), ("15e3", "12e3")] {
        assert!(machine.contains(stated));
        machine = machine.replace(stated, true_one);
    }
    assert!(machine.contains("coulomb = 1.0"));
    machine.replace("coulomb = 1.0", "coulomb = 1.4")
}

/// The firmware of the default drive becomes that of a belt drive of 5 A, moves its machine to random targets, teaches
/// the PC by one of its moves what the machine is, and moves by that; switched off and on, it has it still.
fn belt_drive(targets: usize) {
    let drive = belt();
    let design = Design::new(&drive).unwrap();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/belt-drive.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let machine = belt_machine(&text);
    let (plant, flash) = (scratch("belt-machine.toml"), scratch("belt-flash.bin"));
    std::fs::write(&plant, &machine).unwrap();
    let arguments = [
        "--serial",
        "--drive",
        path,
        "--plant",
        plant.to_str().unwrap(),
        "--flash",
        flash.to_str().unwrap(),
    ];
    let board = Board::start(&arguments);
    let mut host = board.connect();
    let set = settings_image(&design).unwrap();
    assert_eq!(host.push(&set, |_, _| ()).unwrap(), Pushed::Kept);
    assert_eq!(host.push(&set, |_, _| ()).unwrap(), Pushed::Known);
    assert_eq!(host.resolution(), drive.encoder.resolution);
    host.enable(&GO_ON).unwrap();

    let mut random = ChaCha8Rng::seed_from_u64(18);
    for _ in 0..targets {
        let target = random.random_range(-30_000..30_000);
        let arrival = host.go(Request::Move(Place(target)), &GO_ON).unwrap();
        assert!(arrival.time < 1.5, "{} s", arrival.time);
        // Held: what the wrong springs leave of the motion dies away.
        let expected = target as f64 * drive.encoder.resolution;
        let off = |host: &mut Connection| {
            let status = host.status().unwrap();
            assert_eq!(status.mode, Mode::Running);
            (f64::from(status.position) - expected).abs()
        };
        let patience = Instant::now() + Duration::from_secs(2);
        while off(&mut host) > TOLERANCE {
            assert!(Instant::now() < patience, "it does not come to {expected}");
        }
    }

    // A long move from rest, the last in the drive's memory.
    host.go(Request::Move(Place(-20_000)), &GO_ON).unwrap();
    std::thread::sleep(Duration::from_millis(600));
    host.go(Request::Move(Place(20_000)), &GO_ON).unwrap();
    std::thread::sleep(Duration::from_millis(600));
    let moves = host.last_moves().unwrap();
    let record = csv(moves.moves.last().unwrap(), &moves.origin).unwrap();
    let found = learned(&drive, &String::from_utf8(record).unwrap()).unwrap();
    let truth = PlantFile::parse(&machine, "machine").unwrap();
    let error = error_of_the_whole(&found, &truth);
    assert!(error < 0.02, "{error}");
    let text = drive_file(&text, &found.quantities).unwrap();
    let better = Design::new(&Drive::parse(&text, "learned").unwrap()).unwrap();
    let better = settings_image(&better).unwrap();
    host.request(Request::Stop).unwrap();
    assert_eq!(host.push(&better, |_, _| ()).unwrap(), Pushed::Kept);
    host.enable(&GO_ON).unwrap();
    host.go(Request::MoveBy(10_000), &GO_ON).unwrap();
    host.request(Request::Stop).unwrap();
    drop(host);
    board.switch_off();

    let board = Board::start(&arguments);
    let mut host = board.connect();
    let status = host.status().unwrap();
    assert_eq!(status.source, Source::Kept(2));
    assert_eq!(status.fingerprint, Header::of(&better).unwrap().fingerprint);
    let (header, said) = host.settings().unwrap();
    assert_eq!(header.fingerprint, status.fingerprint);
    assert_eq!(said[HEADER..], better[HEADER..said.len()]);
    let shown = settings_json(&header, &said, status.source).unwrap();
    let shown = settings(&host, shown, status.source).unwrap();
    for line in [
        "# settings: kept in flash, set 2",
        "[limits]\ncurrent_limit = 5.0\ncurrent_resolution = 0.0025\n",
        "zero_code = 2080\n",
        "[encoder]\ncounter_bits = 16\nresolution = 0.000005\n",
    ] {
        assert!(shown.contains(line), "{line}: {shown}");
    }
    host.enable(&GO_ON).unwrap();
    host.go(Request::MoveBy(10_000), &GO_ON).unwrap();
    host.request(Request::Stop).unwrap();
    assert!(host.forget_settings().unwrap());
    let status = host.status().unwrap();
    assert_eq!(status.source, Source::CompiledIn);
    assert_ne!(status.fingerprint, Header::of(&better).unwrap().fingerprint);
    assert!(!host.forget_settings().unwrap());
}

#[test]
fn a_belt_drive_is_pushed_learned_and_pushed_again() {
    belt_drive(10);
}

/// With a thousand targets: `cargo test -p arso-tests --features virtual-board --test board_drive -- --ignored`.
#[test]
#[ignore = "takes minutes: the same as above in real time with 1,000 targets"]
fn a_belt_drive_reaches_a_thousand_targets() {
    belt_drive(1000);
}

#[test]
fn a_newcomer_moves_it_jogs_it_and_learns_from_it() {
    let board = Board::start(&["--serial"]);
    let mut drive = board.connect();
    assert_eq!(drive.introduction().loads, 3);
    drive.enable(&GO_ON).unwrap();
    let arrival = drive.go(Request::Move(Place(30_000)), &GO_ON).unwrap();
    assert!(arrival.time < 1.0, "{}", arrival.time);
    let status = drive.status().unwrap();
    // The plan has ended; the last of the motion dies away.
    assert!((status.position - 0.03).abs() < 0.5e-3);
    drive.go(Request::MoveBy(-10_000), &GO_ON).unwrap();
    let status = drive.status().unwrap();
    assert_eq!(status.held, Some(Place(20_000)));
    drive.jog(-0.05, Some(0.3), &GO_ON).unwrap();
    let after = drive.status().unwrap();
    assert_eq!(after.mode, Mode::Running);
    let moved = after.position - status.position;
    assert!((-0.02..-0.012).contains(&moved), "{moved}");

    // A move of 50 mm without the host, and what it teaches.
    drive.go(Request::Move(Place(-20_000)), &GO_ON).unwrap();
    std::thread::sleep(Duration::from_millis(400));
    let moves = drive.last_moves().unwrap();
    let record = csv(moves.moves.last().unwrap(), &moves.origin).unwrap();
    let truth = Drive::default_drive();
    let found = learned(&truth, &String::from_utf8(record).unwrap()).unwrap();
    let error = error_of_the_whole(&found, &PlantFile::from(&truth));
    assert!(error < 0.01, "{error}");

    let Err(Error::Refused(refusal)) = drive.request(Request::Commission) else {
        panic!("it runs");
    };
    assert_eq!(refusal.reason, Reason::Mode);
    assert!(drive.faults().unwrap().is_empty());
    // Unplugged and plugged in again, the drive is as it was.
    drop(drive);
    let mut drive = board.connect();
    assert_eq!(drive.status().unwrap().held, Some(Place(-20_000)));
    drop(board);
    assert!(matches!(drive.status(), Err(Error::Link(_))));
}

#[test]
fn a_network_port_is_as_good() {
    let board = Board::start(&["--tcp", "127.0.0.1:0"]);
    let mut drive = board.connect();
    drive.enable(&GO_ON).unwrap();
    drive.go(Request::MoveBy(5000), &GO_ON).unwrap();
    drive.request(Request::Stop).unwrap();
    assert_eq!(drive.status().unwrap().mode, Mode::Ready);
}
