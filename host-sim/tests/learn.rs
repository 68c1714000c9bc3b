//! `host-sim learn`: one command from the record of an ordinary move to new gains; and `--watch`, which says when it
//! is time for that.

use crate::common::{host_sim, ran};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::identify::{Columns, Drift, Log, drift};
use host_sim::report::csv::csv;
use host_sim::simulate::Law;
use host_sim::simulate::sequence::{MoveSequence, simulate_moves};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::Path;

const DRIVE: &str = include_str!("../drive.toml");

/// Springs 30 % stiffer than the drive file's, last load 20 % heavier, and friction.
fn stiffer() -> PlantFile {
    let mut plant = PlantFile::from(&Drive::default_drive());
    for load in &mut plant.loads {
        load.stiffness *= 1.3;
    }
    plant.loads[2].mass *= 1.2;
    plant.friction.coulomb = 0.15;
    plant
}

/// The same as a file.
fn stiffer_file() -> String {
    let text = DRIVE.replace("stiffness = 300.0", "stiffness = 390.0");
    let (before, last) = text.rsplit_once("mass = 0.019").unwrap();
    format!("{before}mass = 0.0228{last}\n[friction]\ncoulomb = 0.15\n")
}

/// The record of a planned move by the gains of a drive file, as `simulate --csv` prints it.
fn record(design: &Design, plant: &PlantFile, distances: &[f64]) -> String {
    let sequence = MoveSequence::new(design, distances, &[]).unwrap();
    let run = simulate_moves(design, plant, &sequence, Law::Core, sequence.duration()).unwrap();
    String::from_utf8(csv(&run).unwrap()).unwrap()
}

fn default_design() -> Design {
    Design::new(&Drive::default_drive()).unwrap()
}

fn run(directory: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = host_sim();
    ran(command.current_dir(directory).args(arguments))
}

/// A machine 30 % off makes one ordinary planned move by the wrong gains; from its record alone come a drive file and
/// gains that are those of the machine.
#[test]
fn one_move_is_enough() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let drive = format!("# Of the rig in room 12.\n{DRIVE}");
    fs::write(here.join("my-drive.toml"), &drive).unwrap();
    fs::write(here.join("plant.toml"), stiffer_file()).unwrap();
    let simulate = "simulate my-drive.toml --move 0.03 --plant plant.toml --csv";
    let simulate: Vec<&str> = simulate.split(' ').collect();
    let (code, log, error) = run(here, &simulate);
    assert_eq!(code, 0, "{error}");
    fs::write(here.join("run.csv"), log).unwrap();

    let learn = ["learn", "run.csv", "--drive", "my-drive.toml"];
    let (code, text, error) = run(here, &learn);
    assert_eq!((code, error.as_str()), (0, ""), "{text}");
    for said in [
        "load 1: ",
        "modes: 11.94 -> ",
        "before ",
        " times).",
        "cp target/host-sim/learned.toml my-drive.toml",
        "cp target/host-sim/learned-gains.rs firmware/src/gains.rs",
        "cargo flash",
    ] {
        assert!(text.contains(said), "{said}: {text}");
    }
    assert_eq!(
        fs::read_to_string(here.join("my-drive.toml")).unwrap(),
        drive
    );

    let (code, text, _) = run(here, &[&learn[..], &["--json", "--move", "0.03"]].concat());
    assert_eq!(code, 0);
    let value: Value = serde_json::from_str(&text).unwrap();
    let made = &value["move"];
    let figure = |name: &str| made[name].as_f64().unwrap();
    assert!(figure("after") <= 1.2 * figure("bound"), "{made}");
    assert!(figure("times_bound") >= 1.0, "{made}");
    assert!(
        made["before"]
            .as_f64()
            .is_none_or(|before| before > 1.5 * figure("after"))
    );
    assert_eq!(value["files"]["gains"], "target/host-sim/learned-gains.rs");

    let path = here.join("target/host-sim/learned.toml");
    let written = fs::read_to_string(&path).unwrap();
    assert!(written.starts_with("# Of the rig in room 12."), "{written}");
    assert!(written.contains("# one table per mass"), "{written}");
    let learned = Drive::load(Some(&path)).unwrap();
    let truth = stiffer();
    for (load, truth) in learned.loads.iter().zip(&truth.loads) {
        assert!(
            (load.stiffness / truth.stiffness - 1.0).abs() < 0.02,
            "{load:?}"
        );
        assert!((load.mass / truth.mass - 1.0).abs() < 0.02, "{load:?}");
    }
    assert!((learned.actuator.mass / truth.actuator.mass - 1.0).abs() < 0.02);
    // What the firmware takes is designed from what was learned, to the last figure.
    let gains = fs::read_to_string(here.join("target/host-sim/learned-gains.rs")).unwrap();
    let (code, _, _) = run(
        here,
        &["design", path.to_str().unwrap(), "--rust", "designed.rs"],
    );
    assert_eq!(code, 0);
    assert_eq!(gains, fs::read_to_string(here.join("designed.rs")).unwrap());
    let total = learned.total_mass() as f32;
    assert!(gains.contains(&format!("{total}")), "{total}");

    // A drive file that stands where the new one would go stays, unless that is what was asked for.
    let again = [
        "learn",
        "run.csv",
        "--drive",
        "target/host-sim/learned.toml",
    ];
    let (code, _, error) = run(here, &again);
    assert!(code == 2 && error.contains("say with --toml"), "{error}");
    assert_eq!(fs::read_to_string(&path).unwrap(), written);
    let own = [
        &again[..],
        &["--toml", "target/host-sim/learned.toml", "--quiet"],
    ]
    .concat();
    assert_eq!(run(here, &own), (0, String::new(), String::new()));
}

#[test]
fn what_cannot_be_learned_from_gets_one_sentence() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let still = (0..600).map(|k| format!("{:.3},{},{}\n", f64::from(k) * 1e-3, k % 3, k % 2));
    let still: String = still.collect();
    let still = format!("time[s],count[1],applied_current[A]\n{still}");
    fs::write(here.join("still.csv"), still).unwrap();
    for (arguments, expected, sentence) in [
        (&["missing.csv"][..], 2, "missing.csv"),
        // Before anything is read.
        (&["missing.csv", "--move", "nan"], 2, "must be one count"),
        (
            &["still.csv"],
            2,
            "still.csv: the actuator moves by 2 counts",
        ),
        (&["still.csv", "--drive", "none.toml"], 2, "none.toml"),
        (&["--watch", "missing.csv"], 2, "missing.csv"),
    ] {
        let (code, text, error) = run(here, &[&["learn"], arguments].concat());
        assert_eq!((code, text.as_str()), (expected, ""), "{error}");
        assert!(
            error.starts_with("error: ") && error.contains(sentence),
            "{error}"
        );
        assert_eq!(error.lines().count(), 1, "{error}");
    }
    assert_eq!(run(here, &["learn"]).0, 2);
    assert!(!here.join("target").exists());
}

/// A machine that the checks refuse: the drive file is written all the same, gains are not.
#[test]
fn a_machine_without_gains_is_described_all_the_same() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let log = record(&default_design(), &stiffer(), &[0.03]);
    fs::write(here.join("run.csv"), log).unwrap();
    // More current than the amplifier resolves, so little weight on it that nothing is stable in f32.
    let drive = DRIVE.replace("current = 1.0 ", "current = 1e-9 ");
    fs::write(here.join("my-drive.toml"), drive).unwrap();
    let (code, text, error) = run(here, &["learn", "run.csv", "--drive", "my-drive.toml"]);
    assert_eq!(code, 1, "{text}{error}");
    assert!(
        error.contains("the check ") && error.contains("refuses it"),
        "{error}"
    );
    assert!(text.contains("modes: ") && !text.contains("cp "), "{text}");
    assert!(here.join("target/host-sim/learned.toml").exists());
    assert!(!here.join("target/host-sim/learned-gains.rs").exists());
}

/// Drawn by a small generator: from -1 to 1.
struct Drawn(u64);

impl Drawn {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A drive at random, with friction and a fine or coarse encoder.
fn drawn(drawn: &mut Drawn) -> Drive {
    let mut drive = Drive::default_drive();
    drive.actuator.mass *= 1.0 + 0.3 * drawn.next();
    for load in &mut drive.loads {
        load.mass *= 1.0 + 0.3 * drawn.next();
        load.stiffness *= 1.0 + 0.4 * drawn.next();
        load.damping *= 1.0 + 0.5 * drawn.next();
    }
    drive.friction.coulomb = 0.1 + 0.1 * drawn.next();
    drive.encoder.resolution = [1e-6, 5e-6, 1e-5][(drawn.next().abs() * 3.0) as usize % 3];
    drive
}

fn drift_of(design: &Design, plant: &PlantFile, distance: f64) -> Drift {
    let (drive, text) = (&design.drive, record(design, plant, &[distance]));
    let log = Log::parse(text.as_bytes(), "run", drive, &Columns::default()).unwrap();
    drift(drive, &log).unwrap()
}

/// Loads changed by 30 % in one respect are noticed from the next move, machines as described are not, whatever their
/// friction does.
#[test]
fn a_changed_load_is_noticed_and_no_other() {
    let mut generator = Drawn(7);
    for number in 0..PLANTS {
        let drive = drawn(&mut generator);
        let design = Design::new(&drive).unwrap();
        let distance = [0.03, -0.02, 0.01][number % 3];
        let mut as_described = PlantFile::from(&drive);
        as_described.friction.coulomb *= 1.0 + 0.5 * generator.next();
        let quiet = drift_of(&design, &as_described, distance);
        assert!(!quiet.changed(), "{number}: {quiet:?}");
        let factor = if generator.next() > 0.0 { 1.3 } else { 0.7 };
        let changes: [(&str, Change<'_>); 4] = [
            ("springs", &|plant| {
                for load in &mut plant.loads {
                    load.stiffness *= factor;
                }
            }),
            ("last mass", &|plant| plant.loads[2].mass *= factor),
            ("first mass", &|plant| plant.loads[0].mass *= factor),
            ("second spring", &|plant| plant.loads[1].stiffness *= factor),
        ];
        for (what, change) in changes {
            let mut plant = as_described.clone();
            change(&mut plant);
            let found = drift_of(&design, &plant, distance);
            assert!(found.changed(), "{number}, {what} by {factor}: {found:?}");
        }
    }
}

const PLANTS: usize = 6;

/// What is done to a plant.
type Change<'a> = &'a dyn Fn(&mut PlantFile);

/// The watch reads a record that grows while it looks, and says a line for each move.
#[test]
fn the_watch_says_a_line_for_each_move() {
    let directory = tempfile::tempdir().unwrap();
    let here = directory.path();
    let design = default_design();
    let mut as_described = PlantFile::from(&design.drive);
    as_described.friction.coulomb = 0.15;
    let quiet = record(&design, &as_described, &[0.03, -0.03]);
    let changed = record(&design, &stiffer(), &[0.03]);
    fs::write(here.join("quiet.csv"), &quiet).unwrap();
    let watch = ["learn", "--watch", "quiet.csv", "--moves", "2"];
    let (code, text, error) = run(here, &watch);
    assert_eq!((code, error.as_str()), (0, ""));
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 2, "{text}");
    for line in lines {
        assert!(
            line.contains("the load is as the drive file says (prediction error "),
            "{line}"
        );
    }

    // Written piece by piece, the end only while the watch looks.
    let path = here.join("growing.csv");
    let (first, rest) = changed.split_at(changed.len() / 20);
    fs::write(&path, first).unwrap();
    let rest = rest.to_owned();
    let writer = std::thread::spawn(move || {
        let mut file = fs::OpenOptions::new().append(true).open(path).unwrap();
        for piece in rest.as_bytes().chunks(rest.len() / 7) {
            std::thread::sleep(std::time::Duration::from_millis(100));
            file.write_all(piece).unwrap();
        }
    });
    let (code, text, error) = run(
        here,
        &["learn", "--watch", "growing.csv", "--moves", "1", "--json"],
    );
    writer.join().unwrap();
    assert_eq!((code, error.as_str()), (0, ""));
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["changed"], true, "{value}");
    let stiffness = value["stiffness"].as_f64().unwrap();
    assert!((0.2..0.4).contains(&stiffness), "{value}");
    let mass = value["last_mass"].as_f64().unwrap();
    assert!((0.1..0.3).contains(&mass), "{value}");
}
