//! `host-sim bound`, and the bound beside the settling times of `simulate` and `compare`.

use crate::common::{host_sim, ran};
use serde_json::Value;
use std::fs;

const DRIVE: &str = include_str!("../drive.toml");

fn run(arguments: &[&str]) -> (i32, String, String) {
    ran(host_sim().args(arguments))
}

fn json(arguments: &[&str]) -> Value {
    let (code, text, error) = run(arguments);
    assert_eq!((code, error.as_str()), (0, ""));
    serde_json::from_str(&text).unwrap()
}

fn near(value: &Value, expected: f64, tolerance: f64) -> bool {
    (value.as_f64().unwrap() - expected).abs() < tolerance
}

#[test]
fn table_and_json_say_the_same() {
    let (code, text, error) = run(&["bound"]);
    assert_eq!((code, error.as_str()), (0, ""));
    for row in [
        "mass 2 stays within 2 % |   57 |",
        "all masses are at rest  |   78 |",
    ] {
        assert!(text.contains(row), "{text}");
    }
    let value = json(&["bound", "--json"]);
    assert!(near(&value["settled"], 0.057, 1e-9) && near(&value["rest"], 0.078, 1e-9));
    // Backwards is as far, and farther takes longer.
    let back = json(&["bound", "--json", "--distance", "-0.03"]);
    assert_eq!(back["settled"], value["settled"]);
    let longer = json(&["bound", "--json", "--distance", "0.3"]);
    assert!(longer["rest"].as_f64() > value["rest"].as_f64());
}

/// Of the plant, not of the drive; friction is left out, in the amplifier's limit and the drive's the lower counts.
#[test]
fn a_plant_has_its_own_bound() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("plant.toml");
    let plant = path.to_str().unwrap();
    let bound = |text: String| {
        fs::write(&path, text).unwrap();
        json(&["bound", "--json", "--plant", plant])
    };
    let same = bound(format!("{DRIVE}\n[friction]\ncoulomb = 0.2\n"));
    assert!(near(&same["settled"], 0.057, 1e-9));
    let soft = bound(DRIVE.replace("stiffness = 300.0", "stiffness = 210.0"));
    assert!(near(&soft["settled"], 0.066, 1.5e-3) && near(&soft["rest"], 0.089, 1.5e-3));
    let stronger = bound(DRIVE.replace("current_limit = 2.0", "current_limit = 5.0"));
    assert!(near(&stronger["current_limit"], 2.0, 1e-9));
    let weaker = bound(DRIVE.replace("current_limit = 2.0", "current_limit = 1.0"));
    assert!(weaker["rest"].as_f64() > same["rest"].as_f64());
}

#[test]
fn what_cannot_be_asked_is_one_sentence() {
    for (arguments, code, expected) in [
        (
            &["bound", "--distance", "0"][..],
            2,
            "--distance 0: must be from",
        ),
        (
            &["bound", "--distance", "nan"],
            2,
            "--distance NaN: must be from",
        ),
        (&["bound", "nowhere.toml"], 2, "cannot read nowhere.toml"),
    ] {
        let (found, out, error) = run(arguments);
        assert_eq!(
            (found, out.as_str(), error.lines().count()),
            (code, "", 1),
            "{error}"
        );
        assert!(error.contains(expected), "{error}");
    }
}

/// Each experiment has the bound of its own start and target.
#[test]
fn experiments_are_held_against_their_bound() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    let arguments = ["--scenario", "fig3", "--scenario", "fig5", "--out", out];
    let value = json(&[&["simulate", "--json"], &arguments[..]].concat());
    let experiments = value["experiments"].as_array().unwrap();
    assert!(near(&experiments[0]["bound"]["settled"], 0.057, 1e-9));
    assert!(near(&experiments[2]["bound"]["settled"], 0.036, 1.5e-3));
    for experiment in experiments {
        let settled = experiment["metrics"]["settling_time"].as_f64().unwrap();
        let bound = experiment["bound"]["settled"].as_f64().unwrap();
        assert!(near(&experiment["times_bound"], settled / bound, 1e-9));
        assert!(settled > bound);
    }
    let (_, text, _) = run(&[&["simulate"], &arguments[..]].concat());
    assert!(
        text.contains("| x bound |") && text.contains("|    2.49 |"),
        "{text}"
    );
}
