//! A drive commanded as its user commands it: the release ELF on the virtual board behind a pseudo-terminal or a TCP
//! port, `host-sim`'s end of the link on the other side.
#![cfg(feature = "virtual-board")]

use arso_core::request::{Reason, Request};
use arso_core::{Mode, Place};
use arso_tests::learning::{error_of_the_whole, learned};
use host_sim::drive::{Drive, PlantFile};
use host_sim::error::Error;
use host_sim::link::{Connection, Port};
use host_sim::report::record::csv;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

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
