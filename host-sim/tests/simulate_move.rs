//! `simulate --move`: planned moves, one after the other and on top of each other.

use crate::common::{host_sim, ran};
use serde_json::Value;
use std::fs;

const DRIVE: &str = include_str!("../drive.toml");

/// Runs `simulate` on the default drive, files into a folder of its own; its JSON, its warnings, and every step of
/// the core's run by column.
struct Simulated {
    experiments: Vec<Value>,
    warnings: String,
    header: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Simulated {
    fn new(arguments: &[&str], name: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let out = directory.path().to_str().unwrap();
        let fixed = ["simulate", "--json", "--out", out];
        let (code, text, warnings) = ran(host_sim().args(fixed).args(arguments));
        assert_eq!(code, 0, "{warnings}");
        let value: Value = serde_json::from_str(&text).unwrap();
        for file in value["files"].as_array().unwrap() {
            assert!(fs::metadata(file.as_str().unwrap()).is_ok(), "{file}");
        }
        let svg = fs::read_to_string(directory.path().join(format!("{name}.svg"))).unwrap();
        assert!(svg.contains("2 % of the way") && svg.contains("tolerance 50 um"));
        let path = directory.path().join(format!("{name}.csv"));
        let mut csv = csv::Reader::from_path(path).unwrap();
        let header = csv.headers().unwrap().iter().map(Into::into).collect();
        let rows = csv.records().map(|row| {
            let row = row.unwrap();
            row.iter().map(|field| field.parse().unwrap()).collect()
        });
        Self {
            experiments: value["experiments"].as_array().unwrap().clone(),
            warnings,
            header,
            rows: rows.collect(),
        }
    }

    fn column(&self, name: &str) -> Vec<f64> {
        let found = self.header.iter().position(|other| other == name);
        let index = found.unwrap_or_else(|| panic!("{name} in {:?}", self.header));
        self.rows.iter().map(|row| row[index]).collect()
    }

    /// Positions of actuator and mass 2.
    fn positions(&self) -> [Vec<f64>; 2] {
        ["actuator", "load2"].map(|mass| self.column(&format!("{mass}_position_true[m]")))
    }

    /// Time from which on both are within 50 um of a target, by the file.
    fn within_tolerance_from(&self, target: f64) -> f64 {
        let [actuator, load] = self.positions();
        let off =
            |k: &usize| (actuator[*k] - target).abs() > 50e-6 || (load[*k] - target).abs() > 50e-6;
        let last = (0..self.rows.len()).rfind(off).unwrap();
        self.column("time[s]")[last + 1]
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// The planned move of 30 mm by name and by distance are the same; its figures are those of the file, and beside
/// the bound.
#[test]
fn a_move_is_judged_by_its_own_file() {
    let named = Simulated::new(&["--scenario", "move"], "move");
    let asked = Simulated::new(&["--move", "0.03", "--duration", "1.2"], "move");
    assert_eq!(asked.warnings, "");
    assert_eq!(named.rows, asked.rows);
    assert_eq!(named.experiments[0]["move"], Value::Null);
    assert_eq!(number(&asked.experiments[0]["move"]["distance"]), 0.03);
    for simulated in [&named, &asked] {
        let core = &simulated.experiments[0];
        let time = number(&core["metrics"]["within_tolerance_from"]);
        assert!((time - simulated.within_tolerance_from(0.03)).abs() < 1e-9);
        assert_eq!(number(&core["metrics"]["settling_tolerance"]), 50e-6);
        assert!((number(&core["times_rest"]) - time / number(&core["bound"]["rest"])).abs() < 1e-9);
        assert!(number(&core["times_bound"]) > 1.0);
        let end = core["metrics"]["end"]["offset"].as_array().unwrap();
        assert!(end.iter().all(|offset| number(offset).abs() < 50e-6));
    }
}

/// What held the actuator when the signs were proven is worth what a drive file says of friction: the first move ends as
/// it does with friction stated.
#[test]
fn friction_that_is_not_stated_is_seen_when_the_signs_are_proven() {
    for newton in [0.05, 0.2] {
        let directory = tempfile::tempdir().unwrap();
        let rubs = directory.path().join("rubs.toml");
        fs::write(&rubs, format!("{DRIVE}\n[friction]\ncoulomb = {newton}\n")).unwrap();
        let rubs = rubs.to_str().unwrap();
        let within = |drive: &[&str]| {
            let arguments = [drive, &["--plant", rubs, "--move", "0.03"]].concat();
            let simulated = Simulated::new(&arguments, "move");
            number(&simulated.experiments[0]["metrics"]["within_tolerance_from"])
        };
        let [stated, seen] = [within(&[rubs]), within(&[])];
        assert!(
            seen < stated + 5e-3,
            "{newton} N: {seen} s, {stated} s stated"
        );
    }
}

/// Each begins when the one before has ended, and each has figures and a bound of its own.
#[test]
fn moves_are_made_one_after_the_other() {
    let ways: [&[&str]; 2] = [
        &["--move", "0.03", "--move", "-0.01"],
        &["--move", "0.03", "-0.01"],
    ];
    let [one_by_one, listed] = ways.map(|arguments| Simulated::new(arguments, "moves"));
    assert_eq!(one_by_one.rows, listed.rows);
    let names: Vec<_> = listed.experiments.iter().map(|e| &e["scenario"]).collect();
    assert_eq!(names, ["move 1", "move 1", "move 2", "move 2"]);
    let second = &listed.experiments[2];
    let at = number(&second["move"]["at"]);
    assert!((number(&second["move"]["target"]) - 0.02).abs() < 1e-12 && at > 1.2);
    let time = number(&second["metrics"]["within_tolerance_from"]);
    assert!((at + time - listed.within_tolerance_from(0.02)).abs() < 1e-9);
    // A shorter way takes less time, and the least time for it is less too.
    let rest = |k: usize| number(&listed.experiments[k]["bound"]["rest"]);
    assert!(rest(2) < rest(0));
    assert!(time < number(&listed.experiments[0]["metrics"]["within_tolerance_from"]));
}

/// Retargeted twice while it moves, the second time backwards: within its limits, at rest at the last target.
#[test]
fn a_retargeted_drive_rests_at_its_last_target() {
    let arguments = [
        "--move", "0.03", "-0.05", "0.01", "--at", "0", "0.03", "0.07",
    ];
    let simulated = Simulated::new(&arguments, "moves");
    let retargeted: Vec<_> = simulated.experiments.iter().step_by(2).collect();
    let flags = retargeted.iter().map(|e| &e["move"]["retargeted"]);
    assert_eq!(
        flags.collect::<Vec<_>>(),
        [&Value::from(true), &Value::from(true), &Value::from(false)]
    );
    let last = &retargeted[2]["metrics"];
    let time = 0.07 + number(&last["within_tolerance_from"]);
    assert!((time - simulated.within_tolerance_from(-0.01)).abs() < 1e-9);
    assert_eq!(last["end"]["state"], "rest");
    assert!(time < 0.5, "{time}");
    let current = simulated.column("command[A]");
    assert!(current.iter().all(|current| current.abs() <= 2.0));
    let moving = simulated.column("load3_velocity_true[m/s]");
    assert!(moving[moving.len() - 200..].iter().all(|v| v.abs() < 1e-3));
}

/// As CSV to standard output; a distance between two counts is said to be rounded.
#[test]
fn a_move_goes_to_standard_output() {
    let arguments = [
        "simulate",
        "--csv",
        "--duration",
        "0.2",
        "--move=-1.00003e-2",
    ];
    let (code, text, warning) = ran(host_sim().args(arguments));
    assert_eq!((code, text.lines().count()), (0, 201));
    assert_eq!(
        warning,
        "warning: --move -0.0100003: no whole number of encoder counts, rounded to -10000\n"
    );
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    let last = csv.records().last().unwrap().unwrap();
    let reference: f64 = last[5].parse().unwrap();
    assert!((reference + 0.01).abs() < 1e-7, "{reference}");
}

#[test]
fn moves_that_cannot_be_made_are_one_sentence() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("drive.toml");
    fs::write(
        &path,
        format!("{DRIVE}\n[protection]\ntravel = [-0.01, 0.02]\n"),
    )
    .unwrap();
    let drive = path.to_str().unwrap();
    for (arguments, expected) in [
        (
            &["--move", "0"][..],
            "--move 0: must be one count of the encoder at least, 1e-6 m",
        ),
        (
            &["--drive", drive, "--move", "0.015", "0.01"],
            "--move 0.01: leads to 0.025 m, outside the travel from -0.01 to 0.02 m",
        ),
        (
            &["--move", "1e9"],
            "control periods within the limits of planned moves",
        ),
        (
            &["--move", "0.01", "0.01", "--at", "0"],
            "--at 0: must be one time for each",
        ),
        (
            &["--move", "0.01", "0.01", "--at", "0.2", "0.1"],
            "--at 0.1: must be a control period of 0.001 s later",
        ),
        (
            &["--move", "0.01", "0.01", "--duration", "0.5"],
            "--duration 0.5: the last move begins at",
        ),
    ] {
        let (code, out, error) = ran(host_sim().arg("simulate").args(arguments));
        assert_eq!(
            (code, out.as_str(), error.lines().count()),
            (2, "", 1),
            "{error}"
        );
        assert!(error.contains(expected), "{error}");
    }
    for arguments in [
        &["--move", "0.01", "--scenario", "fig3"][..],
        &["--at", "0.1"],
        &["--move", "far"],
        &["--move"],
    ] {
        let (code, out, _) = ran(host_sim().arg("simulate").args(arguments));
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}");
    }
}
