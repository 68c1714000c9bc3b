//! `host-sim drive` as the user runs it, on a simulated drive at the other end of a line. What happened is asked of
//! the plant.

#[path = "../common/mod.rs"]
mod common;
mod simulated;
mod watch;

use arso_core::link::message::{Introduction, TAG};
use arso_core::request::Request;
use arso_core::{Fault, Mode, Place};
use common::{host_sim, ran};
use host_sim::drive::Drive;
use host_sim::identify::{Columns, Log};
use host_sim::link::{Connection, Port};
use serde_json::Value;
use simulated::{Simulated, impostor, introduction};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Exit code, standard output, standard error.
type Ran = (i32, String, String);

fn drive(port: &str, arguments: &[&str]) -> Ran {
    ran(host_sim().args(["drive", "--port", port]).args(arguments))
}

fn done(port: &str, arguments: &[&str]) -> String {
    let (code, out, error) = drive(port, arguments);
    assert_eq!(code, 0, "{arguments:?}: {error}");
    assert!(!error.contains("warning"), "{error}");
    out
}

fn json(port: &str, arguments: &[&str]) -> Value {
    serde_json::from_str(&done(port, &[arguments, &["--json"]].concat())).unwrap()
}

/// The error of a run that ends so.
fn fails(port: &str, arguments: &[&str], expected: i32) -> String {
    let (code, out, error) = drive(port, arguments);
    assert_eq!((code, out.as_str()), (expected, ""), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    error
}

/// A run that goes on.
struct Host(Child);

impl Host {
    fn new(port: &str, arguments: &[&str]) -> Self {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("host-sim"));
        command.args(["drive", "--port", port]).args(arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().unwrap())
    }

    fn send(&self, signal: &str) {
        let kill = Command::new("kill")
            .args(["-s", signal, &self.0.id().to_string()])
            .status();
        assert!(kill.unwrap().success());
    }

    /// Whether it was a success, and standard error.
    fn ended(self) -> (bool, String) {
        let output = self.0.wait_with_output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        (output.status.success(), error)
    }
}

fn parsed(csv: &str) -> Log {
    let drive = Drive::default_drive();
    Log::parse(csv.as_bytes(), "csv", &drive, &Columns::default()).unwrap()
}

/// The distance between the ends of a log, m.
fn way(log: &Log) -> f64 {
    log.position.last().unwrap() - log.position.first().unwrap()
}

#[test]
fn from_switched_on_to_the_record_of_its_moves() {
    let simulated = Simulated::idle();
    let port = simulated.port.as_str();

    let status = json(port, &["status"]);
    assert_eq!(status["state"], "switch on disabled");
    assert_eq!(status["mode"], "idle");
    assert_eq!(status["drive"]["loads"], 3);
    let error = fails(port, &["move", "0.03"], 1);
    assert!(
        error.contains("the drive refuses: move is for a running drive, and this one is idle"),
        "{error}"
    );
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    let error = fails(port, &["record", "--out", out], 1);
    assert!(error.contains("has not moved since its reset"), "{error}");

    done(port, &["set-position", "-0.001"]);
    done(port, &["set-position", "0"]);
    assert!(done(port, &["enable"]).starts_with("the drive runs; the actuator is at"));
    assert!(done(port, &["enable"]).starts_with("the drive runs already"));
    assert_eq!(simulated.truth().mode, Mode::Running);

    let moved = json(port, &["move", "0.03"]);
    let truth = simulated.truth();
    assert_eq!(moved["held"], 30_000);
    assert_eq!(moved["held_position"], 0.03);
    let took = moved["duration"].as_f64().unwrap();
    assert!((0.02..0.5).contains(&took), "{took}");
    let position = moved["position"].as_f64().unwrap();
    assert!((position - 0.03).abs() < 0.0006, "{position}");
    assert!((truth.position - 0.03).abs() < 0.0006, "{truth:?}");
    let text = done(port, &["status"]);
    for words in [
        "operation enabled",
        "at 0.030000 m",
        "firmware 0.1.0",
        "0x0637",
    ] {
        assert!(text.contains(words), "{words} in {text}");
    }
    let error = fails(port, &["set-position", "0"], 1);
    assert!(
        error.contains("set position is for an idle or ready drive"),
        "{error}"
    );

    // A machine that has stood begins another move.
    std::thread::sleep(Duration::from_millis(300));
    assert!((simulated.truth().load - 0.03).abs() < 0.0006);
    let said = done(port, &["move", "--by", "-0.01"]);
    assert!(
        said.contains("held at its target 0.020000 m after"),
        "{said}"
    );
    assert!((simulated.truth().position - 0.02).abs() < 0.0006);
    assert_eq!(done(port, &["move", "0.02", "--quiet"]), "");

    // It stands, and can be read.
    let text = done(port, &["record", "--out", out]);
    assert!(text.contains("Every step of move 2"), "{text}");
    let csv = std::fs::read_to_string(directory.path().join("record.csv")).unwrap();
    assert!((way(&parsed(&csv)) + 0.01).abs() < 0.0006);
    let first = parsed(&done(port, &["record", "--move", "1", "--csv"]));
    assert!((way(&first) - 0.03).abs() < 0.0006);
    assert_eq!(first.drive, parsed(&csv).drive);
    let listed = json(port, &["record", "--out", out]);
    assert_eq!(listed.as_array().unwrap().len(), 2);
    assert_eq!(listed[1]["ended"], true);
    let error = fails(port, &["record", "--move", "7"], 2);
    assert!(error.contains("--move 7: must be one of"), "{error}");

    assert_eq!(
        done(port, &["faults"]),
        "no fault since the reset of the drive\n"
    );
    assert_eq!(json(port, &["faults"]), Value::Array(Vec::new()));
    assert!(done(port, &["clear"]).starts_with("there is no fault"));
    assert_eq!(simulated.truth().mode, Mode::Running);
    done(port, &["disable"]);
    assert_eq!(simulated.truth().mode, Mode::Ready);
    assert_eq!(json(port, &["status"])["state"], "switched on");
    assert!(done(port, &["enable"]).starts_with("the drive runs;"));
}

#[test]
fn a_jog_lasts_for_its_time_and_ends_with_its_host() {
    let simulated = Simulated::running();
    let port = simulated.port.as_str();
    let said = done(port, &["jog", "0.05", "--for", "0.3"]);
    assert!(said.starts_with("the machine is held after 0."), "{said}");
    let one = simulated.truth().position;
    // 15 mm, but for its two changes of velocity.
    assert!((0.012..0.021).contains(&one), "{one}");
    done(port, &["jog", "-0.05", "--for", "0.3"]);
    let back = simulated.truth().position;
    assert!((0.012..0.021).contains(&(one - back)), "{back}");

    // Ctrl-C ends it in order; a host that dies, or hangs, leaves it to the drive.
    for signal in ["INT", "KILL", "STOP"] {
        let before = simulated.truth().position;
        let host = Host::new(port, &["jog", "0.02"]);
        simulated.wait(|truth| truth.position > before + 0.004);
        host.send(signal);
        std::thread::sleep(Duration::from_millis(400));
        let rests = simulated.truth().position;
        assert!(rests < before + 0.02, "{signal}: {rests} from {before}");
        std::thread::sleep(Duration::from_millis(50));
        let later = simulated.truth().position;
        assert!((later - rests).abs() < 1e-5, "{signal}: {later}");
        if signal == "STOP" {
            host.send("KILL");
        }
        let (success, _) = host.ended();
        assert_eq!(success, signal == "INT");
        assert_eq!(json(port, &["status"])["jogging"], false);
    }

    // It comes to rest without being asked by its host.
    let before = simulated.truth().position;
    let host = Host::new(port, &["jog", "0.02"]);
    simulated.wait(|truth| truth.position > before + 0.004);
    simulated.orders().asked = Some(Request::Halt);
    let (success, error) = host.ended();
    assert!(
        success && error.contains("came to rest before it was halted"),
        "{error}"
    );
}

/// Waits until records come into an unfinished file of a folder.
fn grown(folder: &Path) {
    let length =
        |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().metadata().unwrap().len();
    let longest = || std::fs::read_dir(folder).unwrap().map(length).max();
    while longest().unwrap_or(0) < 10_000 {
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Whoever ends it, the record is whole; until then, and where no drive answers, the old one stands.
#[test]
fn a_record_that_is_ended_is_whole() {
    let simulated = Simulated::running();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("log.csv");
    std::fs::write(&path, "old").unwrap();
    let arguments = ["telemetry", "--csv", path.to_str().unwrap()];
    fails("127.0.0.1:1", &arguments, 2);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    for signal in ["INT", "TERM", "HUP"] {
        let host = Host::new(&simulated.port, &arguments);
        grown(directory.path());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        host.send(signal);
        let (success, error) = host.ended();
        assert!(success, "{error}");
        let text = std::fs::read_to_string(&path).unwrap();
        let columns = |row: &str| row.split(',').count();
        let rows: Vec<usize> = text.lines().map(columns).collect();
        let whole = rows.iter().all(|columns| *columns == rows[0]);
        assert!(text.ends_with('\n') && whole && rows.len() > 20, "{text}");
        std::fs::write(&path, "old").unwrap();
    }
}

#[test]
fn telemetry_is_what_identification_reads() {
    let simulated = Simulated::running();
    let port = simulated.port.as_str();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("log.csv");
    let log = std::thread::scope(|scope| {
        let host = scope.spawn(|| {
            drive(
                port,
                &["telemetry", "--for", "0.8", "--csv", path.to_str().unwrap()],
            )
        });
        grown(directory.path());
        simulated.orders().asked = Some(Request::MoveBy(20_000));
        let (code, out, error) = host.join().unwrap();
        assert_eq!((code, out.as_str()), (0, ""), "{error}");
        assert_eq!(error, "800 records, none was missed\n");
        parsed(&std::fs::read_to_string(&path).unwrap())
    });
    assert!((way(&log) - 0.02).abs() < 0.0004, "{}", way(&log));
    assert!(log.drive.unwrap().starts_with("linear-3-"));
    assert!((simulated.truth().position - 0.02).abs() < 0.0004);

    let csv = done(port, &["telemetry", "--for", "0.1", "--every", "10"]);
    let rows: Vec<&str> = csv.lines().collect();
    assert_eq!(rows.len(), 11);
    assert!(rows[10].starts_with("0.09,"), "{}", rows[10]);
    let lines = done(port, &["telemetry", "--for", "0.01", "--json"]);
    for line in lines.lines() {
        let record: Value = serde_json::from_str(line).unwrap();
        assert_eq!(record["mode"], "running");
        assert_eq!(record["load_position"].as_array().unwrap().len(), 3);
    }
    // What is lost on the way is counted.
    simulated.orders().lost = 5;
    let (code, csv, error) = drive(port, &["telemetry", "--for", "0.2"]);
    assert!(code == 0 && csv.lines().count() < 180, "{error}");
    assert!(error.contains("records were missed"), "{error}");
}

/// Every third frame of the drive is lost, and each move is carried out once.
#[test]
fn what_is_asked_is_done_once() {
    let simulated = Simulated::running();
    simulated.orders().lost = 3;
    let mut drive = Connection::new(Port::open(&simulated.port).unwrap()).unwrap();
    let begin = drive.status().unwrap().held.unwrap().0;
    for number in 1..=4 {
        // Now and then it cannot take a request at once.
        simulated.orders().busy = number % 2;
        // In step with the losses, whatever was asked between.
        for _ in 0..number % 3 {
            drive.status().unwrap();
        }
        let arrival = drive.go(Request::MoveBy(-2_000), &|| true).unwrap();
        let target = Place(begin - 2_000 * i64::from(number));
        assert_eq!(arrival.status.held, Some(target));
        assert_eq!(simulated.truth().moves, number);
    }
    let truth = simulated.truth();
    assert!((truth.position + 0.008).abs() < 0.00016, "{truth:?}");
    assert!(truth.lost > 5, "{truth:?}");
    drop(drive);
    let moved = json(&simulated.port, &["move", "--by", "-0.01"]);
    assert_eq!(
        (moved["held"].as_i64(), simulated.truth().moves),
        (Some(begin - 18_000), 5)
    );
}

#[test]
fn noise_between_frames_costs_nothing() {
    let simulated = Simulated::running();
    simulated.orders().noise = true;
    let port = simulated.port.as_str();
    let moved = json(port, &["move", "0.01"]);
    assert_eq!(moved["held"], 10_000);
    assert!((simulated.truth().position - 0.01).abs() < 0.0002);
    assert_eq!(simulated.truth().moves, 1);
    let first = parsed(&done(port, &["record", "--csv"]));
    assert!((way(&first) - 0.01).abs() < 0.0002);
    let mut drive = Connection::new(Port::open(port).unwrap()).unwrap();
    drive.subscribe(5).unwrap();
    let mut periods = Vec::new();
    while periods.len() < 20 {
        // Other questions may be asked meanwhile; what comes then is kept.
        if periods.len() == 10 {
            drive.status().unwrap();
            std::thread::sleep(Duration::from_millis(30));
        }
        let record = drive.record(Duration::from_secs(1)).unwrap().unwrap();
        periods.push(record.period);
    }
    // Frames that come twice are two of the same.
    periods.dedup();
    assert!(
        periods.windows(2).all(|pair| pair[1] == pair[0] + 5),
        "{periods:?}"
    );
}

#[test]
fn a_fault_on_the_way_is_named_and_acknowledged() {
    let simulated = Simulated::running();
    let port = simulated.port.as_str();
    std::thread::scope(|scope| {
        let host = scope.spawn(|| fails(port, &["move", "2"], 1));
        simulated.wait(|truth| truth.position > 0.01);
        simulated.orders().fault = Some(Fault::Thermal);
        let error = host.join().unwrap();
        for words in [
            "the drive stopped with fault 18 (Thermal)",
            "the motor carries more current than it can for so long; let it cool",
        ] {
            assert!(error.contains(words), "{error}");
        }
    });
    // The loop brakes before it is acknowledged.
    assert!(done(port, &["clear"]).starts_with("the fault is acknowledged"));
    assert_eq!(simulated.truth().mode, Mode::Idle);
    let faults = json(port, &["faults"]);
    assert_eq!(faults[0]["number"], 18);
    assert_eq!(faults.as_array().unwrap().len(), 1);
    assert!(done(port, &["faults"]).contains("let it cool, move less often"));

    simulated.orders().fault = Some(Fault::Amplifier);
    simulated.wait(|truth| truth.mode == Mode::Fault(Fault::Amplifier));
    let error = fails(port, &["enable"], 1);
    assert!(error.contains("stopped by fault 20 (Amplifier)"), "{error}");
    let status = json(port, &["status"]);
    assert_eq!(status["state"], "fault");
    assert_eq!(status["fault"]["remedy"], "see the amplifier's own manual");
    assert!(done(port, &["status"]).contains("fault 20 (Amplifier)"));
}

/// Something else is asked of the drive, by whoever commands it beside this host.
#[test]
fn a_wait_ends_when_the_drive_does_something_else() {
    let simulated = Simulated::running();
    let port = simulated.port.as_str();
    // Ctrl-C brings the machine to rest.
    let before = simulated.truth().position;
    let host = Host::new(port, &["move", "--by", "2"]);
    simulated.wait(|truth| truth.position > before + 0.01);
    host.send("INT");
    let (success, error) = host.ended();
    assert!(
        !success && error.contains("interrupted: the machine is halted at"),
        "{error}"
    );
    assert!(simulated.truth().position < before + 1.0);

    for (asked, words) in [
        (
            Request::Halt,
            "and not at the target 2.000000 m: something else",
        ),
        (Request::Stop, "and is ready: was its run switch opened?"),
    ] {
        let before = simulated.truth().position;
        std::thread::scope(|scope| {
            let host = scope.spawn(|| fails(port, &["move", "2"], 1));
            simulated.wait(|truth| truth.position > before + 0.01);
            simulated.orders().asked = Some(asked);
            let error = host.join().unwrap();
            assert!(error.contains(words), "{error}");
        });
    }
}

#[test]
fn who_does_not_speak_the_link_is_told() {
    let other = Introduction {
        version: 9,
        tag: 0x1234,
        firmware: "3.2.1".try_into().unwrap(),
        ..introduction()
    };
    let error = fails(&impostor(Some(other), b""), &["status"], 1);
    let words = format!(
        "the link failed: the drive speaks version 9 of the link, tag 0x1234, and this program version 1, tag \
         {TAG:#06x}: use the host-sim of the drive's firmware, 3.2.1"
    );
    assert!(error.contains(&words), "{error}");

    let odd = Introduction {
        kind: "helical".try_into().unwrap(),
        ..introduction()
    };
    let error = fails(&impostor(Some(odd), b""), &["status"], 1);
    assert!(
        error.contains("what no drive of this program is"),
        "{error}"
    );

    let silent = impostor(None, b"");
    let error = fails(&silent, &["status"], 1);
    assert!(
        error.contains(&format!("nothing answers on {silent}")),
        "{error}"
    );
    let log = impostor(None, b"INFO drive ready\n\0\x05abc\0");
    let error = fails(&log, &["status"], 1);
    assert!(error.contains("no drive answers on"), "{error}");
    assert!(error.contains("bytes came"), "{error}");
}

#[test]
fn what_cannot_be_used_is_refused_before_anything_is_sent() {
    let nobody = "127.0.0.1:1";
    for (arguments, words) in [
        (&["status"][..], "--port 127.0.0.1:1: cannot be opened: "),
        (&["move", "nan"], "X NaN: must be a number"),
        (
            &["move", "-1e9"],
            "X -1000000000: must be a number from -1e6",
        ),
        (&["move", "inf", "--by"], "X inf: must be"),
        (&["set-position", "nan"], "X NaN"),
        (&["jog", "0"], "V 0: must not be zero"),
        (&["jog", "nan"], "V NaN"),
        (&["jog", "1", "--for", "-1"], "--for -1: must be above 0"),
        (
            &["home", "--input", "--velocity", "0"],
            "--velocity 0: must not be zero",
        ),
        (
            &["home", "--stop", "nan", "--velocity", "1"],
            "--stop NaN: must be a current above 0 A",
        ),
        (
            &["home", "--stop", "1", "--velocity", "1"],
            "--back-off 0: must be above 0",
        ),
        (
            &["home", "--input", "--velocity", "1", "--back-off", "-1"],
            "--back-off -1: must not be negative",
        ),
        (&["telemetry", "--for", "nan"], "--for NaN"),
        (&["record", "--csv", "--json"], "exclude each other"),
    ] {
        let error = fails(nobody, arguments, 2);
        assert!(error.contains(words), "{error}");
    }
    assert_eq!(drive(nobody, &["telemetry", "--every", "0"]).0, 2);
    assert_eq!(drive(nobody, &["home", "--velocity", "1"]).0, 2);
    let error = fails("/dev/no-such-port", &["status"], 2);
    assert!(
        error.contains("--port /dev/no-such-port: cannot be opened: "),
        "{error}"
    );
    let (code, _, error) = ran(host_sim().args(["drive", "status"]));
    assert!(
        code == 2 && error.contains("--port must say where"),
        "{error}"
    );
    // A distance that rounds to no count.
    let simulated = Simulated::running();
    let error = fails(&simulated.port, &["move", "--by", "1e-7"], 2);
    assert!(
        error.contains("one count of the encoder at least, 0.000001 m"),
        "{error}"
    );
    assert_eq!(simulated.truth().moves, 0);
}

/// A serial device, as far as there is one without hardware.
#[cfg(target_os = "linux")]
#[test]
fn a_pseudo_terminal_is_a_port() {
    use serialport::{SerialPort, TTYPort};
    use std::io::{Read, Write};

    struct Terminal(TTYPort);
    impl simulated::Wire for Terminal {
        fn receive(&mut self) -> Vec<u8> {
            let waiting = self.0.bytes_to_read().unwrap_or(0);
            let mut bytes = vec![0; waiting as usize];
            let length = if waiting > 0 {
                self.0.read(&mut bytes).unwrap()
            } else {
                0
            };
            bytes.truncate(length);
            bytes
        }

        fn send(&mut self, bytes: &[u8]) {
            let _ = self.0.write_all(bytes);
        }
    }

    let (ours, theirs) = TTYPort::pair().unwrap();
    let port = theirs.name().unwrap();
    // Held open by somebody else all the time, as by a board that is simulated.
    let held = std::fs::File::open(&port).unwrap();
    drop(theirs);
    let simulated = Simulated::on(Terminal(ours), port, true);
    for target in [10_000, -5_000] {
        let position = (f64::from(target) * 1e-6).to_string();
        let moved = json(&simulated.port, &["move", &position]);
        assert_eq!(moved["held"], target);
    }
    assert!((simulated.truth().position + 0.005).abs() < 0.0003);
    let csv = done(&simulated.port, &["record", "--csv"]);
    assert!(csv.starts_with("time[s],count[1],"), "{csv}");
    drop(simulated);
    drop(held);
}

/// The stop is at -0.1 m, and the home switch active from -0.09 m on, wherever the drive's zero is.
#[test]
fn zero_is_found_by_a_stop_and_by_the_switch() {
    let simulated = Simulated::running();
    let port = simulated.port.as_str();
    let stop = ["home", "--stop", "0.3", "--velocity", "-0.05"];
    let found = json(port, &[&stop[..], &["--back-off", "0.02"]].concat());
    assert_eq!(found["held_position"], 0.02);
    assert!(found["duration"].as_f64().unwrap() > 1.9, "{found}");
    assert!((simulated.truth().position + 0.08).abs() < 0.0001);
    // What is called so is as far from the stop.
    done(port, &["move", "0.15"]);
    assert!((simulated.truth().position - 0.05).abs() < 0.0001);

    let input = ["home", "--input", "--velocity", "-0.1"];
    let said = done(port, &[&input[..], &["--position", "-0.04"]].concat());
    assert!(
        said.starts_with("zero is known, the machine is held after"),
        "{said}"
    );
    // To a period of the approach.
    assert!((simulated.truth().position + 0.09).abs() < 0.0002);
    let error = fails(port, &["home", "--input", "--velocity", "-0.1"], 1);
    assert!(
        error.contains("the home switch is active already, move off it"),
        "{error}"
    );
    let error = fails(
        port,
        &[
            "home",
            "--stop",
            "5",
            "--velocity",
            "-0.05",
            "--back-off",
            "0.01",
        ],
        1,
    );
    assert!(error.contains("below the drive's limit"), "{error}");

    // Ctrl-C ends it, and zero is what it was.
    done(port, &["move", "0.0"]);
    let before = simulated.truth().position;
    let host = Host::new(port, &["home", "--input", "--velocity", "0.05"]);
    simulated.wait(|truth| truth.position > before + 0.01);
    host.send("INT");
    let (success, error) = host.ended();
    assert!(!success && error.contains("halted at 0.0"), "{error}");
    done(port, &["move", "0.0"]);
    assert!((simulated.truth().position - before).abs() < 0.0001);
}
