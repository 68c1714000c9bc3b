//! `host-sim record` as the user runs it, on the memory of a drive that has made two moves.

use crate::common::{host_sim, ran};
use arso_core::record::{Course, LastMoves, Recorder, Scale};
use arso_core::{Counts, Current, Identity};

const DRIVE: Identity<'static> = Identity {
    kind: "linear",
    loads: 3,
    sample_time: 1e-3,
    fingerprint: 0xD85A_F250,
};
const SCALE: Scale = Scale {
    counter_bits: 16,
    step: Current(1e-3),
    tolerance: 50,
};

fn memory() -> Vec<u8> {
    let memory = LastMoves::<1500>::new();
    let mut recorder = Recorder::new(&memory, &DRIVE, SCALE);
    for period in 0..800 {
        let tick = period % 400;
        let course = if tick < 20 {
            Course::Moved
        } else {
            Course::Free
        };
        let applied = Current(if tick == 1 { 0.123 } else { 0.0 });
        // It moves for 100 periods, and stands.
        let count = period / 400 * 100 + tick.min(100);
        recorder.step(period, Counts(count), applied, course);
    }
    memory.words().flat_map(u32::to_le_bytes).collect()
}

/// Runs `record` on a dump.
fn record(dump: &[u8], arguments: &[&str]) -> (i32, String, String) {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("ram.bin"), dump).unwrap();
    let mut command = host_sim();
    command.current_dir(directory.path());
    let run = ran(command.args(["record", "ram.bin"]).args(arguments));
    if run.0 == 0 && !arguments.contains(&"--csv") {
        let csv = std::fs::read_to_string(directory.path().join("target/host-sim/record.csv"));
        assert!(csv.unwrap().starts_with("time[s],count[1],"));
    }
    run
}

#[test]
fn moves_are_listed_and_written() {
    let (code, text, _) = record(&memory(), &[]);
    assert_eq!(code, 0);
    assert!(text.contains("fingerprint d85af250"), "{text}");
    assert!(text.contains("Every step of move 2"), "{text}");
    assert_eq!(
        text.lines().filter(|line| line.contains("0.123")).count(),
        2
    );
    assert_eq!(record(&memory(), &["--quiet"]).1, "");

    for (arguments, first) in [(&["--csv"][..], 100), (&["--csv", "--move", "1"], 0)] {
        let (code, csv, _) = record(&memory(), arguments);
        let rows: Vec<&str> = csv.lines().take(3).collect();
        let expected = [
            "time[s],count[1],applied_current[A],drive[name]".to_owned(),
            format!("0,{first},0,linear-3-d85af250"),
            format!("0.001,{},0.123,linear-3-d85af250", first + 1),
        ];
        assert_eq!(
            (code, rows),
            (0, expected.iter().map(String::as_str).collect())
        );
    }
}

#[test]
fn what_is_not_there_is_said() {
    let (code, _, error) = record(&memory(), &["--move", "3"]);
    assert!(
        code == 2 && error.contains("--move 3: must be one of"),
        "{error}"
    );
    let (code, _, error) = record(b"nothing", &[]);
    assert!(
        code == 2 && error.contains("ram.bin: none of its 7 bytes"),
        "{error}"
    );
    let empty = LastMoves::<100>::new();
    Recorder::new(&empty, &DRIVE, SCALE);
    let bytes: Vec<u8> = empty.words().flat_map(u32::to_le_bytes).collect();
    let (code, _, error) = record(&bytes, &[]);
    assert!(
        code == 1 && error.contains("has not moved since"),
        "{error}"
    );
}
