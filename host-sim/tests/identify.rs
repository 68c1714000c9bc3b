//! `host-sim identify` as the user runs it: what it finds, and what it refuses, each with its sentence.

use crate::common::{host_sim, ran};
use host_sim::drive::{Drive, PlantFile};
use host_sim::excite::{ExcitationPlan, ExcitationRequest};
use host_sim::machine::Friction;
use host_sim::simulate::plant::Plant;
use std::fmt::Write;
use std::fs;
use std::path::Path;

const DRIVE: &str = include_str!("../drive.toml");

/// Runs and returns exit code, standard output, standard error.
fn run(arguments: &[&str]) -> (i32, String, String) {
    ran(host_sim().args(arguments))
}

/// A log of the plant under some current, as a drive would write it.
fn log(plant: &PlantFile, currents: impl IntoIterator<Item = f64>) -> String {
    let mut machine = Plant::new(plant, 1e-3);
    let mut text = String::from("time[s],count[1],applied_current[A]\n0,0,0\n");
    for (k, current) in (1..).zip(currents) {
        machine.advance(current).unwrap();
        let time = f64::from(k) * 1e-3;
        writeln!(text, "{time:.3},{},{current}", machine.count()).unwrap();
    }
    text
}

fn excitation(drive: &Drive) -> Vec<f64> {
    let plan = ExcitationPlan::new(drive, &ExcitationRequest::default()).unwrap();
    plan.currents().map(f64::from).collect()
}

/// The same log with the encoder's phases swapped.
fn reversed(log: &str) -> String {
    let rows = log.lines().skip(1).map(|row| {
        let fields: Vec<&str> = row.split(',').collect();
        let count: u32 = fields[1].parse().unwrap();
        format!(
            "{},{},{}\n",
            fields[0],
            (65_536 - count) % 65_536,
            fields[2]
        )
    });
    format!(
        "time[s],count[1],applied_current[A]\n{}",
        rows.collect::<String>()
    )
}

/// Identifies from a text; returns exit code, output and the error without the directory.
fn identify(log: &str, arguments: &[&str]) -> (i32, String, String) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("log.csv");
    fs::write(&path, log).unwrap();
    let out = directory.path().join("out");
    let mut all = vec!["identify", path.to_str().unwrap()];
    all.extend(["--out", out.to_str().unwrap()]);
    all.extend(arguments);
    let (code, text, error) = run(&all);
    let place = format!("{}/", directory.path().display());
    (code, text, error.replace(&place, ""))
}

/// A plant that differs from the drive file in everything but its force constant: found again from the
/// excitation alone, written to a drive file that can be designed for.
#[test]
fn a_drive_that_differs_is_found_and_written() {
    let drive = Drive::default_drive();
    let mut plant = PlantFile::from(&drive);
    plant.actuator.mass = 0.065;
    for (load, (mass, stiffness)) in
        plant
            .loads
            .iter_mut()
            .zip([(0.021, 350.0), (0.018, 260.0), (0.017, 330.0)])
    {
        (load.mass, load.stiffness) = (mass, stiffness);
    }
    plant.friction = Friction {
        coulomb: 0.15,
        viscous: 0.2,
        ..Friction::default()
    };
    let directory = tempfile::tempdir().unwrap();
    let toml = directory.path().join("identified.toml");
    let log = log(&plant, excitation(&drive));
    let (code, text, error) = identify(&log, &["--json", "--toml", toml.to_str().unwrap()]);
    assert_eq!((code, error.as_str()), (0, ""));
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let truth = [
        ("actuator.mass", 0.065),
        ("load[1].mass", 0.021),
        ("load[2].mass", 0.018),
        ("load[3].mass", 0.017),
        ("load[1].stiffness", 350.0),
        ("load[2].stiffness", 260.0),
        ("load[3].stiffness", 330.0),
        ("load[3].damping", 0.1),
        ("friction.coulomb", 0.15),
        ("friction.viscous", 0.2),
    ];
    for (name, truth) in truth {
        let entry = &value["parameters"][name];
        let found = entry["value"].as_f64().unwrap();
        assert!((found / truth - 1.0).abs() < 0.01, "{name}: {entry}");
        assert_eq!(entry["held"], false);
    }
    assert_eq!(value["parameters"]["actuator.force_constant"]["held"], true);
    assert_eq!(value["parameters"]["load[1].damping"]["unit"], "N s/m");
    assert!(value["fit_percent"].as_f64().unwrap() > 98.0);

    let written = Drive::load(Some(&toml)).unwrap();
    assert!((written.loads[1].stiffness / 260.0 - 1.0).abs() < 0.01);
    assert!((written.friction.coulomb / 0.15 - 1.0).abs() < 0.01);
    assert_eq!(run(&["design", toml.to_str().unwrap()]).0, 0);

    // For people: a table and a plot, in the drive's units.
    let out = directory.path().join("out");
    let path = directory.path().join("log.csv");
    let rotary = directory.path().join("rotary.toml");
    fs::write(&path, &log).unwrap();
    fs::write(&rotary, format!("kind = \"rotary\"\n{DRIVE}")).unwrap();
    let (path, out_name) = (path.to_str().unwrap(), out.to_str().unwrap());
    let rotary = rotary.to_str().unwrap();
    let (code, text, _) = run(&["identify", path, "--drive", rotary, "--out", out_name]);
    assert_eq!(code, 0);
    assert!(text.contains("| load[2].stiffness"), "{text}");
    let svg = fs::read_to_string(out.join("identification.svg")).unwrap();
    assert!(svg.trim_end().ends_with("</svg>") && !svg.contains("NaN"));
    assert!(
        text.contains("N m/rad") && text.contains("kg m^2"),
        "{text}"
    );
    for unit in ["N/m", "N s/m", "N/A", " mm", "um"] {
        assert!(!text.contains(unit) && !svg.contains(unit), "{unit}");
    }
}

/// Known masses instead of a known force constant: then that is found.
#[test]
fn the_force_constant_is_found_where_a_mass_is_known() {
    let drive = Drive::default_drive();
    let mut plant = PlantFile::from(&drive);
    plant.actuator.force_constant = 7.0;
    let log = log(&plant, excitation(&drive));
    let hold = ["--hold", "load[1].mass", "--hold", "load[2].mass"];
    let (code, text, _) = identify(&log, &[&["--json"][..], &hold].concat());
    assert_eq!(code, 0);
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let found = value["parameters"]["actuator.force_constant"]["value"].as_f64();
    assert!((found.unwrap() / 7.0 - 1.0).abs() < 2e-3, "{found:?}");
}

/// Each log, its arguments, and the sentence it gets.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn bad_logs_get_one_sentence_that_says_where() {
    let drive = Drive::default_drive();
    let plant = PlantFile::from(&drive);
    let good = log(&plant, excitation(&drive));
    let line = |number: usize| good.lines().nth(number - 1).unwrap().to_owned();
    let replaced = |number: usize, new: &str| good.replacen(&line(number), new, 1);
    let first: String = good.lines().take(150).collect::<Vec<_>>().join("\n");
    let kept = good.lines().enumerate().filter(|(k, _)| k % 4 != 2);
    let every_fourth_missing = kept.map(|(_, row)| row).collect::<Vec<_>>().join("\n");
    let rows = |row: fn(i32) -> (i32, i32)| {
        (0..500).fold(String::new(), |mut text, k| {
            let (count, current) = row(k);
            writeln!(text, "{:.3},{count},{current}", f64::from(k) * 1e-3).unwrap();
            text
        })
    };
    let constant = rows(|k| (10 * k, 1));
    let still = rows(|k| (k % 3, k % 2));
    // As far from the count that stands there as a counter of 16 bits can be.
    let count: u32 = line(900).split(',').nth(1).unwrap().parse().unwrap();
    let opposite = (count + 32_768) % 65_536;
    let header = "time[s],count[1],applied_current[A]\n";
    let cases: Vec<(String, &[&str], &str)> = vec![
        (
            String::new(),
            &[],
            "log.csv:1: has no column time[s]: it is empty",
        ),
        (
            "hello\nworld\n".into(),
            &[],
            "log.csv:1: has no column time[s]: it has hello; say which it is with --column time=NAME",
        ),
        (
            good.replace("count[1]", "enc"),
            &[],
            "log.csv:1: has no column count[1]: it has time[s], enc, applied_current[A]",
        ),
        (
            good.replace("applied_current[A]", "applied_current[kA]"),
            &[],
            "log.csv:1: has the column applied_current[kA]: its unit must be one of A, mA",
        ),
        (
            good.clone(),
            &["--column", "speed=v"],
            "\"speed=v\": must be WHAT=NAME with time, count, position",
        ),
        (
            header.into(),
            &[],
            "log.csv: 0 control periods: must be 200",
        ),
        (
            first,
            &[],
            "log.csv: 149 control periods: must be 200 at least",
        ),
        (
            replaced(500, "0.498,abc,0.1"),
            &[],
            "log.csv:500: count[1] = \"abc\": must be a number",
        ),
        (
            replaced(500, "0.498,12.5,0.1"),
            &[],
            "log.csv:500: count[1] = 12.5: must be a whole number",
        ),
        (
            replaced(500, "0.498,1e300,0.1"),
            &[],
            "log.csv:500: count[1] = 1e300: must be 9007199254740992 counts at most",
        ),
        (
            replaced(500, "nan,0,0.1"),
            &[],
            "log.csv:500: time[s] = \"nan\": must be a number",
        ),
        (
            replaced(500, "0.498,0,inf"),
            &[],
            "log.csv:500: applied_current[A] = \"inf\": must be a number",
        ),
        (
            replaced(500, "0.498"),
            &[],
            "log.csv:500: count[1] = \"\": must be a number",
        ),
        (
            replaced(700, "0.698,0,3.5"),
            &[],
            "log.csv:700: applied_current[A] = 3.5: is beyond the drive's current_limit of 2 A",
        ),
        (
            every_fourth_missing,
            &[],
            "log.csv:3: time[s] is 2 ms after the row before, and so in",
        ),
        (
            good.replace("0.500,", "0.499,"),
            &[],
            "log.csv:502: time[s] is 0.000000 s after the row before",
        ),
        (
            replaced(900, &format!("0.898,{opposite},0.1")),
            &[],
            "log.csv:900: count[1] jumps by",
        ),
        (
            format!("{header}{constant}"),
            &[],
            "log.csv: applied_current[A] never changes: nothing can be identified",
        ),
        (
            format!("{header}{still}"),
            &[],
            "log.csv: the actuator moves by 2 counts: must be 100 at least",
        ),
        (
            replaced(900, &format!("0.898,{},0.1", (count + 9000) % 65_536)),
            &[],
            "log.csv:900: count[1] jumps by",
        ),
        (
            reversed(&good),
            &[],
            "log.csv: the encoder counts against the current: swap the encoder's phases or",
        ),
        (
            good.clone(),
            &["--hold", "load[4].mass"],
            "--hold load[4].mass: must be one of",
        ),
        (
            good.clone(),
            &["--hold", "load[1].damping"],
            "must name a mass, a stiffness or the force constant",
        ),
        (
            good.clone(),
            &["--run", "free", "--hold", "load[1].mass"],
            "--hold load[1].mass: must be one of actuator.mass, actuator.force_constant, friction",
        ),
        (good.clone(), &["--run", "quick"], "invalid value 'quick'"),
        (
            good.clone(),
            &["--drive", "nowhere.toml"],
            "cannot read nowhere.toml",
        ),
    ];
    for (text, arguments, expected) in &cases {
        let (code, output, error) = identify(text, arguments);
        assert_eq!((code, output.as_str()), (2, ""), "{expected}: {error}");
        assert!(error.contains(expected), "{expected}: {error}");
        if !arguments.contains(&"--column") && !expected.starts_with("invalid value") {
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
    let missing = run(&["identify", "nowhere.csv"]);
    assert!(missing.0 == 2 && missing.2.contains("cannot read nowhere.csv"));
}

/// Columns by other names, and what the reader should be told.
#[test]
fn columns_are_named_and_remarks_are_told() {
    let drive = Drive::default_drive();
    let good = log(&PlantFile::from(&drive), excitation(&drive));
    let other = good.replace("time[s],count[1],applied_current[A]", "t,enc,iq");
    let missing = other.replacen("0.500,", "# 0.500,", 1);
    let (code, text, error) = identify(
        &missing,
        &[
            "--json",
            "--column",
            "time=t,count=enc",
            "--column",
            "current=iq",
        ],
    );
    assert_eq!(code, 0, "{error}");
    assert!(text.contains("load[3].mass"), "{text}");
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let expected = "1 row is missing or late, the longest interval 2 ms";
    let remark = value["remarks"][0].as_str().unwrap();
    assert!(remark.starts_with(expected), "{remark}");
}

/// The right machine or none: every mass, spring and frequency that is given of a plant as the drive file has it
/// is within 3 %, or a failed run says in one sentence why nothing is.
fn right_or_none(what: &str, (code, text, error): (i32, String, String)) {
    if code != 0 {
        assert_eq!((code, text.as_str()), (1, ""), "{what}: {error}");
        assert!(error.contains("nothing was identified"), "{what}: {error}");
        assert_eq!(error.lines().count(), 1, "{what}: {error}");
        return;
    }
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let drive = Drive::default_drive();
    let mut truth = vec![("actuator.mass".to_owned(), drive.actuator.mass)];
    for (number, load) in (1..).zip(&drive.loads) {
        truth.push((format!("load[{number}].mass"), load.mass));
        truth.push((format!("load[{number}].stiffness"), load.stiffness));
    }
    for (name, truth) in truth {
        if let Some(found) = value["parameters"][&name]["value"].as_f64() {
            assert!((found / truth - 1.0).abs() < 0.03, "{what}: {name} {found}");
        }
    }
    let modes = Plant::new(&PlantFile::from(&drive), 1e-3).chain().modes();
    let figure = |name: String| {
        let figures = value["figures"].as_array().unwrap();
        let found = figures
            .iter()
            .find(|figure| figure["name"] == name.as_str());
        found.and_then(|figure| figure["value"].as_f64())
    };
    for (number, mode) in (1..).zip(modes) {
        if let Some(found) = figure(format!("mode {number}")) {
            let error = (found / mode.frequency_hz - 1.0).abs();
            assert!(error < 0.03, "{what}: mode {number} {found}");
        }
    }
}

/// A log that is well-formed but does not say enough: what it does not determine is not given.
#[test]
fn what_a_log_does_not_determine_is_not_given() {
    let drive = Drive::default_drive();
    let plant = PlantFile::from(&drive);
    let slow = |hz: f64| {
        (0..4000).map(move |k| 0.5 * (std::f64::consts::TAU * hz * f64::from(k) * 1e-3).sin())
    };
    let directory = tempfile::tempdir().unwrap();
    // One slow sine: hardly any frequency to go by.
    right_or_none("slow", identify(&log(&plant, slow(1.0)), &["--json"]));
    // The whole chain taken for the actuator alone: nothing of that explains its swings.
    let toml = directory.path().join("identified.toml");
    let free = ["--toml", toml.to_str().unwrap(), "--run", "free"];
    let (code, text, error) = identify(&log(&plant, excitation(&drive)), &free);
    assert_eq!((code, text.as_str()), (1, ""), "{error}");
    assert!(error.contains("nothing was identified"), "{error}");
    assert!(!Path::new(&toml).exists());
    // A band that ends below the second and third modes, seen by a coarse encoder.
    let request = ExcitationRequest {
        to: Some(14.0),
        current: Some(0.02),
        ..ExcitationRequest::default()
    };
    let plan = ExcitationPlan::new(&drive, &request).unwrap();
    let mut noisy = plant.clone();
    noisy.encoder.resolution = 20e-6;
    let narrow = log(&noisy, plan.currents().map(f64::from));
    let coarse = directory.path().join("coarse.toml");
    fs::write(
        &coarse,
        DRIVE.replace("resolution = 1e-6 ", "resolution = 20e-6 "),
    )
    .unwrap();
    let drive = ["--json", "--drive", coarse.to_str().unwrap()];
    right_or_none("narrow", identify(&narrow, &drive));
}

/// Rewiring is advised where it explains the log, and not where the motion had its energy from elsewhere.
#[test]
fn wiring_is_named_only_where_it_explains_the_log() {
    let drive = Drive::default_drive();
    // A weak excitation on a motor that brakes: what it takes out of the motion it has not put in.
    let braking = |plant: &PlantFile, last_load: f64| {
        let mut machine = Plant::new(plant, 1e-3);
        let mut state = machine.state().clone();
        state[6] = last_load;
        machine.set_state(state);
        let mut text = String::from("time[s],count[1],applied_current[A]\n0,0,0\n");
        for (k, weak) in (1..3000).zip(excitation(&drive)) {
            let current = 0.02 * weak - 0.05 * machine.state()[1];
            machine.advance(current).unwrap();
            let time = f64::from(k) * 1e-3;
            writeln!(text, "{time:.3},{},{current}", machine.count()).unwrap();
        }
        text
    };
    let push = "[[force]]\nmass = 3\nstart = 1.0\nduration = 1.0\nnewton = 0.2\n";
    let pushed = PlantFile::parse(&format!("{DRIVE}\n{push}"), "plant.toml").unwrap();
    for (what, log) in [
        ("deflected", braking(&PlantFile::from(&drive), 0.02)),
        ("pushed", braking(&pushed, 0.0)),
    ] {
        let found = identify(&log, &["--json"]);
        assert!(!found.2.contains("swap"), "{what}: {}", found.2);
        right_or_none(what, found);
    }
}

/// Without friction all energy comes back, and rounding decides on its sign.
#[test]
fn a_free_actuator_without_friction_is_identified() {
    let drive = Drive::default_drive();
    let (mass, force_constant) = (0.059, 6.43);
    let free = |sign: f64| {
        let mut text = String::from("time[s],count[1],applied_current[A]\n0,0,0\n");
        let (mut position, mut velocity) = (0.0, 0.0);
        for (k, current) in (1..).zip(excitation(&drive)) {
            let acceleration = sign * force_constant * current / mass;
            position += 1e-3 * velocity + 0.5e-6 * acceleration;
            velocity += 1e-3 * acceleration;
            let count = (position / 1e-6_f64).round().rem_euclid(65_536.0);
            let time = f64::from(k) * 1e-3;
            writeln!(text, "{time:.3},{count},{current}").unwrap();
        }
        text
    };
    let (code, text, error) = identify(&free(1.0), &["--run", "free", "--json"]);
    assert_eq!(code, 0, "{error}");
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let found = value["parameters"]["actuator.mass"]["value"]
        .as_f64()
        .unwrap();
    assert!((found / mass - 1.0).abs() < 1e-3, "{value}");
    let (code, _, error) = identify(&free(-1.0), &["--run", "free"]);
    assert_eq!(code, 2, "{error}");
    assert!(error.contains("swap the encoder's phases"), "{error}");
}
