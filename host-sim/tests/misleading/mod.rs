//! Inputs on which the program once said something that was not so: each must be told as it is.

mod drives;

use crate::common::{host_sim, ran};
use drives::{
    BELT_2A, BELT_2A_PLANT, BELT_REFUSED, HEAVY, HEAVY_PLANT, HUNTING, HUNTING_WILD, ROTARY,
    ROTARY_PLANT,
};
use serde_json::Value;
use std::fs;

const DRIVE: &str = include_str!("../../drive.toml");
const FIG3: [&str; 6] = [
    "simulate",
    "drive.toml",
    "--scenario",
    "fig3",
    "--out",
    "out",
];

/// Runs with a drive and a plant in files of these names; returns exit code, standard output, standard
/// error.
fn run(drive: &str, plant: Option<&str>, arguments: &[&str]) -> (i32, String, String) {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("drive.toml"), drive).unwrap();
    let mut command = host_sim();
    command.args(arguments).current_dir(directory.path());
    if let Some(plant) = plant {
        fs::write(directory.path().join("plant.toml"), plant).unwrap();
        command.args(["--plant", "plant.toml"]);
    }
    ran(&mut command)
}

/// A run that must fail before anything is shown, with one sentence.
fn refused(drive: &str, plant: Option<&str>, arguments: &[&str], expected: i32) -> String {
    let (code, text, error) = run(drive, plant, arguments);
    assert_eq!((code, text.as_str()), (expected, ""), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    error
}

/// Figures of fig3 with the drive's observer, and the rows of the tables that show them.
fn fig3(drive: &str, plant: Option<&str>) -> (Value, String) {
    let (code, text, error) = run(drive, plant, &[&FIG3[..], &["--json"]].concat());
    assert_eq!((code, error.as_str()), (0, ""));
    let mut value: Value = serde_json::from_str(&text).unwrap();
    let (_, table, _) = run(drive, plant, &FIG3);
    let rows = table.lines().filter(|line| line.contains("| anchored"));
    let rows: String = rows.collect();
    assert!(!rows.is_empty(), "{table}");
    (value["experiments"][0]["metrics"].take(), rows)
}

/// A check of a design, and what `design` printed and said of it.
fn checked(drive: &str, name: &str) -> (i32, Value, String, String) {
    let (code, json, error) = run(drive, None, &["design", "drive.toml", "--json"]);
    let value: Value = serde_json::from_str(&json).unwrap_or_else(|_| panic!("{error}"));
    let mut checks = value["checks"].as_array().unwrap().iter();
    let check = checks.find(|check| check["name"] == name).unwrap().clone();
    let (_, text, _) = run(drive, None, &["design", "drive.toml"]);
    (code, check, text, error)
}

/// What `design` refuses is not simulated or compared either, and the sentence is the same.
#[test]
fn a_refused_design_is_not_run() {
    let (code, _, design) = run(BELT_REFUSED, None, &["design", "drive.toml"]);
    assert_eq!(code, 1);
    assert!(
        design.contains("the check commissioning_brake refuses it (1.0"),
        "{design}"
    );
    let csv = [&FIG3[..], &["--csv"]].concat();
    for arguments in [&FIG3[..], &csv, &["compare", "drive.toml"]] {
        assert_eq!(refused(BELT_REFUSED, None, arguments, 1), design);
    }
}

#[test]
fn a_plant_that_cannot_be_the_drive_s_is_refused() {
    let rotary = DRIVE.replacen("[actuator]", "kind = \"rotary\"\n[actuator]", 1);
    let slower = DRIVE.replace("sample_time = 1e-3", "sample_time = 2e-3");
    let slower = slower.replace("= 628.0 ", "= 314.0 ");
    for (drive, plant, sentence) in [
        (
            DRIVE,
            rotary.as_str(),
            "the plant is rotary and the drive linear: they must be of the same kind",
        ),
        (&rotary, DRIVE, "the plant is linear and the drive rotary"),
        (
            HEAVY,
            BELT_2A_PLANT,
            "the plant has 2 loads and the drive 1: they must have the same number",
        ),
        (BELT_2A, HEAVY_PLANT, "the plant has 1 load and the drive 2"),
        (
            DRIVE,
            &slower,
            "the plant file has control.sample_time = 0.002 s and the drive 0.001 s",
        ),
    ] {
        let error = refused(drive, Some(plant), &FIG3, 2);
        assert!(error.contains(sentence), "{error}");
    }
    // A drive file is the plant of its own drive, and of another that differs in what it is made of.
    let heavier = DRIVE.replacen("mass = 0.019", "mass = 0.021", 1);
    fig3(DRIVE, Some(&heavier));
}

/// What moves for ever has no settling time, but a word and a figure.
#[test]
fn hunting_is_shown_and_is_not_settled() {
    let (metrics, row) = fig3(HUNTING_WILD, None);
    let end = &metrics["end"];
    assert!(metrics["settling_time"].is_null(), "{metrics}");
    assert_ne!(end["state"], "rest", "{end}");
    let motion = end["motion"][0].as_f64().unwrap();
    assert!(motion > 5e-3, "{end}");
    let word = end["state"].as_str().unwrap();
    assert!(row.contains(&format!(" {word} ")), "{row}");
    assert!(row.contains(&format!("{:.1}", 1e6 * motion)), "{row}");
    // And the design says so beforehand.
    let (_, check, text, _) = checked(HUNTING_WILD, "stillness");
    assert_eq!(check["verdict"], "warn", "{check}");
    assert!(text.contains("stillness: encoder counts"), "{text}");
}

/// Drives that hunted for ever under friction, coarse encoder or heavy load come to rest, within the tolerance.
#[test]
fn what_hunted_comes_to_rest() {
    for (name, drive, plant, tolerance) in [
        (
            "rotary",
            ROTARY,
            Some(ROTARY_PLANT),
            5.0 * 2.0 * std::f64::consts::PI / 16384.0,
        ),
        ("heavy", HEAVY, Some(HEAVY_PLANT), 100e-6),
        ("all checks pass", HUNTING, None, 200e-6),
    ] {
        let (metrics, _) = fig3(drive, plant);
        let end = &metrics["end"];
        assert_eq!(end["state"], "rest", "{name}: {end}");
        for offset in end["offset"].as_array().unwrap() {
            assert!(offset.as_f64().unwrap().abs() < tolerance, "{name}: {end}");
        }
    }
}

/// What stands still beside its target is shown to stand there.
#[test]
fn the_offset_at_the_end_is_shown() {
    let (metrics, row) = fig3(BELT_2A, Some(BELT_2A_PLANT));
    let end = &metrics["end"];
    let offset = end["offset"][0].as_f64().unwrap();
    assert_eq!(end["state"], "rest", "{end}");
    assert!((20e-6..100e-6).contains(&offset.abs()), "{end}");
    assert!(row.contains(&format!("{:.1}", 1e6 * offset)), "{row}");
    // The drive that is as described stands on its target.
    let (metrics, _) = fig3(DRIVE, None);
    let settled = metrics["settling_time"].as_f64().unwrap();
    assert!((settled - 0.142).abs() < 1e-9, "{metrics}");
    for offset in metrics["end"]["offset"].as_array().unwrap() {
        assert!(offset.as_f64().unwrap().abs() < 10e-6, "{metrics}");
    }
}

/// Friction that is declared counts: most of the motor's force is a warning, what start-up cannot overcome a
/// refusal.
#[test]
fn friction_beyond_the_force_is_refused() {
    let with = |limit: f64| {
        DRIVE
            .replace("current_limit = 2.0 ", &format!("current_limit = {limit} "))
            .replace("[cost] ", "[friction]\ncoulomb = 1.007\n[cost] ")
    };
    for (limit, verdict) in [
        (2.0, "pass"),
        (0.4, "warn"),
        (0.3, "refuse"),
        (0.008, "refuse"),
    ] {
        let (code, check, text, error) = checked(&with(limit), "friction_share");
        let share = check["value"].as_f64().unwrap();
        assert!((share - 1.007 / 6.43 / limit).abs() < 1e-9, "{check}");
        assert_eq!(check["verdict"], verdict, "{limit}");
        assert_eq!(code, i32::from(verdict == "refuse"), "{limit}: {error}");
        assert_eq!(text.contains("friction.coulomb takes"), verdict != "pass");
        if verdict == "refuse" {
            refused(&with(limit), None, &FIG3, 1);
        }
    }
}

/// An encoder that outruns its counter within a move, or within an excitation.
#[test]
fn an_encoder_too_fine_for_its_counter_is_refused() {
    let fine = DRIVE.replace("resolution = 1e-6 ", "resolution = 1e-8 ");
    let (code, check, _, error) = checked(&fine, "counts_per_period");
    assert_eq!((code, &check["limit"]), (1, &Value::from(16384.0)));
    // 0.5 m/s of the drive file's [move] at the least.
    assert!(check["value"].as_f64().unwrap() >= 50_000.0, "{check}");
    assert!(
        error.contains("the check counts_per_period refuses it"),
        "{error}"
    );
    refused(&fine, None, &FIG3, 1);
    let (code, check, ..) = checked(&fine.replace("bits = 16", "bits = 32"), "counts_per_period");
    assert_eq!((code, check["verdict"].as_str()), (0, Some("pass")));

    let error = refused(&fine, None, &["excite", "drive.toml", "--out", "out"], 2);
    assert!(
        error.contains("16384 at most, a quarter of its counter's range"),
        "{error}"
    );
}

/// Weights that lie decades apart: K(t) all the same, and never "NaN".
#[test]
fn no_figure_is_no_number() {
    let apart = "velocity = [1e8, 6.47385e-08, 24.1514, 0.0154806]\n";
    let drive = DRIVE
        .replace("velocity = [0.2, 0.2, 0.2, 0.2] ", &format!("{apart}#"))
        .replacen("mass = 0.019 ", "mass = 0.136066 ", 1)
        + "\n[observer]\ndisturbance = false\n";
    let (code, json, error) = run(&drive, None, &["design", "drive.toml", "--json"]);
    // 11.7 degrees are no margin.
    assert_eq!(code, 1);
    assert!(
        error.contains("the check peak_sensitivity refuses it"),
        "{error}"
    );
    let value: Value = serde_json::from_str(&json).unwrap();
    let horizon = value["finite_horizon"].as_array().unwrap();
    assert_eq!(horizon.len(), 5);
    assert!(
        horizon.iter().all(|gain| gain["distance"].is_f64()),
        "{horizon:?}"
    );
    assert!(
        value["checks"]
            .as_array()
            .unwrap()
            .iter()
            .all(|check| check["value"].is_f64())
    );
    let (_, text, _) = run(&drive, None, &["design", "drive.toml"]);
    assert!(!text.contains("NaN"), "{text}");
}

/// The observer's advice is what was tried, and a slow observer in a sound loop is no reason to refuse.
#[test]
fn advice_on_the_observer_is_what_was_tried() {
    let (code, check, text, error) = checked(ROTARY, "observer_speed");
    assert_eq!(
        (code, check["verdict"].as_str()),
        (0, Some("warn")),
        "{error}"
    );
    let advice = check["advice"].as_str().unwrap();
    assert!(text.contains(advice), "{text}");
    // Ten times the load's noise is no faster here; a third of it is.
    let tried = |ratio: &str| {
        let key = format!("observer.load_force_ratio = {ratio}: ");
        let (_, after) = advice
            .split_once(&key)
            .unwrap_or_else(|| panic!("{advice}"));
        after.split(',').next().unwrap().parse::<f64>().unwrap()
    };
    assert!(tried("3.2") > check["value"].as_f64().unwrap(), "{advice}");
    assert!(tried("28") < check["value"].as_f64().unwrap(), "{advice}");

    let slow = format!("{ROTARY}[observer]\nload_force_ratio = 0.1\n");
    let (code, check, ..) = checked(&slow, "observer_speed");
    assert_eq!((code, check["verdict"].as_str()), (0, Some("warn")));
}

/// Only what does not pass is explained in the table; JSON has every sentence.
#[test]
fn what_passes_needs_no_explanation() {
    let (code, check, text, _) = checked(DRIVE, "distinct_eigenvalues");
    assert_eq!((code, check["verdict"].as_str()), (0, Some("pass")));
    let advice = check["advice"].as_str().unwrap();
    assert!(
        advice.contains("the free chain has a double zero"),
        "{advice}"
    );
    assert!(!text.contains(advice), "{text}");
    let (_, check, text, _) = checked(ROTARY, "peak_sensitivity");
    assert_eq!(check["verdict"], "warn");
    assert!(text.contains(check["advice"].as_str().unwrap()), "{text}");
}

/// The plot ends where the motion does.
#[test]
fn the_plot_ends_where_the_motion_does() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("drive.toml"), DRIVE).unwrap();
    let mut command = host_sim();
    command.args(FIG3).arg("--quiet");
    let (code, _, error) = ran(command.current_dir(directory.path()));
    assert_eq!((code, error.as_str()), (0, ""));
    let svg = fs::read_to_string(directory.path().join("out/fig3.svg")).unwrap();
    let (_, shown) = svg.split_once("(the first ").expect("a shorter time axis");
    let seconds: f64 = shown.split_once(" s of ").unwrap().0.parse().unwrap();
    assert!(seconds < 0.6, "{seconds}");
}
