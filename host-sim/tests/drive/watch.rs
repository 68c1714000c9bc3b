//! `host-sim drive watch` and `drive telemetry --mcap` as the user runs them, on a simulated drive.

use crate::common::{host_sim, ran};
use crate::simulated::Simulated;
use host_sim::report::mcap::TOPIC;
use mcap::{MessageStream, Summary};
use serde_json::Value;
use std::path::Path;

/// Times, ns, and records of a file.
fn recorded(path: &Path) -> Vec<(u64, Value)> {
    let file = std::fs::read(path).unwrap();
    assert!(Summary::read(&file).unwrap().is_some());
    let messages = MessageStream::new(&file).unwrap();
    let messages = messages.map(|message| {
        let message = message.unwrap();
        assert_eq!(message.channel.topic, TOPIC);
        let value = serde_json::from_slice(&message.data).unwrap();
        (message.log_time, value)
    });
    messages.collect()
}

#[test]
fn without_a_terminal_it_is_refused_before_anything_is_sent() {
    let drive = |arguments: &[&str]| {
        let mut command = host_sim();
        ran(command
            .args(["drive", "--port", "127.0.0.1:1"])
            .args(arguments))
    };
    let (code, out, error) = drive(&["watch"]);
    assert_eq!((code, out.as_str()), (2, ""));
    let expected =
        "error: watch draws in a terminal, and standard output is none: use telemetry to record\n";
    assert_eq!(error, expected);
    let (code, _, error) = drive(&["watch", "--json"]);
    assert!(code == 2 && error.contains("telemetry --json"), "{error}");
    assert_eq!(drive(&["watch", "--every", "0"]).0, 2);
}

#[test]
fn telemetry_becomes_an_mcap_file() {
    let simulated = Simulated::running();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run.mcap");
    let telemetry = ["telemetry", "--for", "0.3", "--every", "5", "--mcap"];
    let mut command = host_sim();
    command.args(["drive", "--port", &simulated.port]);
    let (code, out, error) = ran(command.args(telemetry).arg(&path));
    assert_eq!((code, out.as_str()), (0, ""), "{error}");
    let records = recorded(&path);
    assert_eq!(records.len(), 60);
    for pair in records.windows(2) {
        assert_eq!(pair[1].0 - pair[0].0, 5_000_000);
    }
    let (time, record) = &records[0];
    assert_eq!(record["period"].as_u64().unwrap() * 1_000_000, *time);
    assert_eq!(record["mode"], "running");
    assert_eq!(record["load_position"].as_array().unwrap().len(), 3);
    // Nothing unfinished is left.
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 1);
}

/// In a pseudo-terminal, with keys.
#[cfg(target_os = "linux")]
#[test]
fn in_a_terminal_it_draws_and_records_until_a_key_ends_it() {
    use serialport::{SerialPort, TTYPort};
    use std::io::{Read, Write};
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    let simulated = Simulated::running();
    let directory = tempfile::tempdir().unwrap();
    let [csv, mcap] = ["run.csv", "run.mcap"].map(|name| directory.path().join(name));
    let (mut ours, theirs) = TTYPort::pair().unwrap();
    ours.set_timeout(Duration::from_millis(20)).unwrap();
    let name = theirs.name().unwrap();
    let open = || std::fs::File::options().read(true).write(true).open(&name);
    let held = open().unwrap();
    drop(theirs);
    let size = ["rows", "40", "cols", "120"];
    let sized = Command::new("stty").args(["-F", &name]).args(size).status();
    assert!(sized.unwrap().success());

    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("host-sim"));
    command.env("TERM", "xterm");
    command.args(["drive", "--port", &simulated.port, "watch"]);
    command.arg("--csv").arg(&csv).arg("--mcap").arg(&mcap);
    command.stdin(open().unwrap()).stdout(open().unwrap());
    let mut watch = command.stderr(Stdio::piped()).spawn().unwrap();

    let mut seen = Vec::new();
    let mut read_until = |ours: &mut TTYPort, words: &str| {
        let begun = Instant::now();
        let mut buffer = [0; 4096];
        while !String::from_utf8_lossy(&seen).contains(words) {
            assert!(begun.elapsed() < Duration::from_secs(10), "{words}");
            let length = ours.read(&mut buffer).unwrap_or(0);
            seen.extend_from_slice(&buffer[..length]);
        }
    };
    read_until(&mut ours, "operation");
    std::thread::sleep(Duration::from_millis(500));
    ours.write_all(b"s").unwrap();
    read_until(&mut ours, "comes");
    ours.write_all(b"q").unwrap();
    // The terminal is given back: its other screen is left.
    read_until(&mut ours, "\u{1b}[?1049l");
    assert!(watch.wait().unwrap().success());
    let mut error = String::new();
    watch.stderr.unwrap().read_to_string(&mut error).unwrap();
    assert!(error.contains("records, 0 were missed"), "{error}");
    drop(held);

    let rows = std::fs::read_to_string(&csv).unwrap().lines().count() - 1;
    let records = recorded(&mcap);
    assert!(rows > 30 && rows == records.len(), "{rows}");
    assert_eq!(records[1].0 - records[0].0, 10_000_000);
}
