//! `host-sim capture` as the user runs it: what the drive says of itself is believed, and nothing that came is
//! lost.

use crate::common::{host_sim, ran};
use arso_core::{Identity, Mode, Telemetry};
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::Serialize;
use std::fs;
use std::path::Path;

const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

fn serialised(value: &impl Serialize) -> String {
    let mut buffer = [0; 128];
    let bytes = postcard::to_slice_crc32(value, &mut buffer, CHECKSUM.digest()).unwrap();
    format!("{bytes:?}")
}

fn record(period: u32) -> String {
    let record = Telemetry {
        period,
        mode: Mode::Idle,
        count: 12,
        applied_current: 0.001,
        ..Telemetry::<[f32; 2]>::default()
    };
    format!("DEBUG record {}", serialised(&record))
}

/// What a rotary drive of two loads says.
fn identity(start: &str) -> String {
    let identity = Identity {
        kind: "rotary",
        loads: 2,
        sample_time: 5e-4,
        fingerprint: 0x1A2B,
    };
    format!("INFO {start}: 2 loads, identity {}", serialised(&identity))
}

/// Runs on a log; exit code, standard output, standard error.
fn capture(log: &str, arguments: &[&str]) -> (i32, String, String) {
    let mut command = host_sim();
    ran(command.arg("capture").args(arguments).write_stdin(log))
}

/// Kind, units and period are the log's; a drive file is compared with it, in words.
#[test]
fn the_log_says_which_drive_it_is_of() {
    let log = [
        identity("drive ready"),
        record(1),
        record(2),
        identity("drive"),
    ]
    .join("\n");
    let (code, csv, error) = capture(&log, &["--csv"]);
    // As the checksum protects it, and not as the words beside it have it.
    assert_eq!(
        (code, error.as_str()),
        (
            0,
            "INFO drive ready: rotary, 2 loads, control period 0.0005 s, fingerprint 00001a2b\n"
        )
    );
    assert!(csv.contains("actuator_position[rad]"), "{csv}");
    assert!(
        csv.lines().nth(2).unwrap().starts_with("0.0005,2,Idle"),
        "{csv}"
    );

    let drive = Path::new(env!("CARGO_MANIFEST_DIR")).join("drive.toml");
    let drive = drive.to_str().unwrap();
    for way in [&["--csv", "--drive", drive][..], &["--csv", drive]] {
        let (code, same, error) = capture(&log, way);
        assert_eq!((code, same), (0, csv.clone()));
        for words in [
            "rotary, not linear",
            "2 loads, not 3",
            "control period 0.0005 s, not 0.001 s",
            "fingerprint 00001a2b, not ",
        ] {
            assert!(error.contains(words), "{error}");
        }
    }

    // Nothing said: the file counts, and without one that is said.
    let (code, csv, error) = capture(&record(1), &["--csv"]);
    assert!(code == 0 && csv.contains("[m]"), "{csv}");
    assert!(error.contains("does not say which drive"), "{error}");
}

#[test]
fn the_table_is_json_as_well() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    let log = [identity("drive"), record(1), record(4), "INFO idle".into()].join("\n");
    let (code, text, _) = capture(&log, &["--json", "--out", out, "--quiet"]);
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, &value["kind"]), (0, &"rotary".into()));
    assert_eq!(
        (&value["lost"], &value["control_periods"]),
        (&2.into(), &2.into())
    );
    assert_eq!(value["columns"]["count[1]"]["last"], 12.0);
    assert!(directory.path().join("log.csv").exists());
}

/// A drive that was reset starts again at small numbers: its time goes on, and the reset is said.
#[test]
fn a_reset_is_said() {
    let log = [
        record(500),
        record(501),
        identity("drive ready"),
        record(1),
        record(2),
    ];
    let (code, csv, error) = capture(&log.join("\n"), &["--csv"]);
    assert_eq!(code, 0);
    let times: Vec<&str> = csv
        .lines()
        .skip(1)
        .map(|row| row.split(',').next().unwrap())
        .collect();
    assert_eq!(times, ["0", "0.0005", "0.001", "0.0015"]);
    assert!(error.contains("was reset 1 times"), "{error}");
    assert!(!error.contains("missing"), "{error}");
}

/// Ctrl-C on a pipe that is silent and stays open: what has come is written.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_silent_pipe_with_its_records() {
    use std::io::{BufRead, BufReader, Write};
    use std::process::{Command, Stdio};
    let directory = tempfile::tempdir().unwrap();
    let fifo = directory.path().join("fifo");
    let made = Command::new("mkfifo").arg(&fifo).status().unwrap();
    assert!(made.success());
    for pipe in [None, Some(fifo)] {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("host-sim"));
        command.args(["capture", "--csv"]);
        if let Some(fifo) = &pipe {
            command.arg("--rtt").arg(fifo);
        }
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let stdin = child.stdin.take().unwrap();
        // Open until the end of the test: the pipe says nothing more, and does not end.
        let mut writer: Box<dyn Write> = match &pipe {
            None => Box::new(stdin),
            Some(fifo) => Box::new(fs::OpenOptions::new().write(true).open(fifo).unwrap()),
        };
        let log = format!("{}\n{}\nINFO seen\n", identity("drive"), record(1));
        writer.write_all(log.as_bytes()).unwrap();
        let mut messages = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while line != "INFO seen\n" {
            line.clear();
            assert!(messages.read_line(&mut line).unwrap() > 0);
        }
        let interrupt = Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status();
        assert!(interrupt.unwrap().success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        let csv = String::from_utf8(output.stdout).unwrap();
        assert!(
            csv.lines().count() == 2 && csv.contains("\n0,1,Idle,12,"),
            "{csv}"
        );
        drop(writer);
    }
}

/// Nobody reads the messages any more: the log is written all the same.
#[test]
fn closed_messages_lose_no_log() {
    use std::io::Write;
    use std::process::{Command, Stdio};
    let directory = tempfile::tempdir().unwrap();
    let mut child = Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
        .arg("capture")
        .arg("--out")
        .arg(directory.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stderr.take());
    let log = [identity("drive ready"), record(1), "INFO idle".into()].join("\n");
    child
        .stdin
        .take()
        .unwrap()
        .write_all(log.as_bytes())
        .unwrap();
    assert!(child.wait().unwrap().success());
    assert!(directory.path().join("log.csv").exists());
}

/// A raw stream taken for text: nothing of it is shown, and what is missing is named.
#[test]
fn a_raw_stream_without_its_firmware_is_named() {
    let mut command = host_sim();
    let raw: Vec<u8> = (0..4000_u32).map(|k| (k * 37 % 256) as u8).collect();
    let (code, out, error) = ran(command.arg("capture").write_stdin(raw));
    assert_eq!((code, out.as_str()), (1, ""));
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(
        error.contains("needs the firmware that logged it, with --elf"),
        "{error}"
    );
}

/// The CSV says which drive wrote it, and `identify` reads that.
#[test]
fn the_csv_says_which_drive_it_is_of() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("log.csv");
    let log = [identity("drive ready"), record(1), record(2)].join("\n");
    let (_, csv, _) = capture(&log, &["--csv"]);
    assert!(
        csv.lines().next().unwrap().ends_with(",drive[name]"),
        "{csv}"
    );
    assert!(
        csv.lines()
            .all(|row| row.ends_with(",rotary-2-00001a2b") != row.starts_with("time"))
    );

    // A log as long as it must be, of a drive of either kind.
    let log_of = |mark: &str| {
        let rows = (0..400).map(|k| {
            let (time, count) = (f64::from(k) * 1e-3, (k * k) / 16);
            format!("{time:.3},{count},{},{mark}\n", f64::from(k % 7) * 0.01)
        });
        let header = "time[s],count[1],applied_current[A],drive[name]\n";
        fs::write(&path, format!("{header}{}", rows.collect::<String>())).unwrap();
        let out = directory.path().to_str().unwrap();
        ran(host_sim().args(["identify", path.to_str().unwrap(), "--out", out]))
    };
    let (code, _, error) = log_of("rotary-2-00001a2b");
    assert_eq!((code, error.lines().count()), (2, 1), "{error}");
    assert!(
        error.contains("the log is of a rotary drive, and the drive file"),
        "{error}"
    );
    let (code, _, error) = log_of("nonsense");
    assert!(
        code == 2 && error.contains("drive[name] = \"nonsense\""),
        "{error}"
    );
    let (_, _, error) = log_of("linear-2-00001a2b");
    assert!(
        error.contains("2 loads, not 3") && error.contains("fingerprint 00001a2b"),
        "{error}"
    );
}
