//! `host-sim moves`: the same plants for every law, the same figures in table and JSON and for any number of
//! threads, and what cannot be asked.

use crate::common::{host_sim, ran};
use serde_json::Value;

const THIN: [&str; 5] = ["moves", "--plants", "3", "--evaluations", "20"];

fn thin(more: &[&str], threads: &str) -> (i32, String, String) {
    ran(host_sim()
        .args(THIN)
        .args(more)
        .env("RAYON_NUM_THREADS", threads))
}

fn figures(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn laws_are_held_against_each_other_on_the_same_plants() {
    let (code, text, error) = thin(&["--json"], "2");
    assert_eq!((code, error), (0, String::new()));
    assert_eq!(text, thin(&["--json"], "1").1, "threads change nothing");
    let value = figures(&text);
    // 0.2 N of 12 N where the drive file states none: 2 A times 6.43 N/A over 60.
    let friction = value["friction"].as_f64().unwrap();
    assert!((friction - 2.0 * 6.43 / 60.0).abs() < 1e-12);
    assert_eq!(value["friction_assumed"], true);
    let sets = value["sets"].as_array().unwrap();
    let names: Vec<_> = sets
        .iter()
        .map(|set| set["set"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["nominal", "identified", "rough"]);
    let (_, table, _) = thin(&[], "2");
    for set in sets {
        let laws = set["laws"].as_array().unwrap();
        assert_eq!(laws.len(), 9);
        for law in laws {
            let name = law["law"].as_str().unwrap();
            assert!(table.contains(&format!("| {name} ")), "{name}: {table}");
            // No law is faster than the least time of the fastest plant, or stronger than the motor.
            let ratio = law["within_band_times_bound"]["median"].as_f64();
            assert!(ratio.is_none_or(|ratio| ratio > 1.0), "{name}: {ratio:?}");
            assert!(law["peak_current"]["worst"].as_f64().unwrap() <= 2.0 + 1e-6);
        }
    }
    // On its own plant the drive moves as `bound` allows.
    let planned = &sets[0]["laws"][0];
    assert_eq!(planned["law"], "planned move");
    let ratio = planned["within_band_times_bound"]["worst"]
        .as_f64()
        .unwrap();
    assert!(ratio < 1.2, "{ratio}");
}

#[test]
fn another_seed_draws_other_plants() {
    let bound = |seed: &str| {
        let value = figures(&thin(&["--json", "--seed", seed], "2").1);
        value["sets"][2]["laws"][1]["within_band"].clone()
    };
    assert_ne!(bound("1"), bound("2"));
}

#[test]
fn what_cannot_be_moved_is_one_sentence() {
    for distance in ["0", "1e-7", "nan", "1e9"] {
        let (code, out, error) = thin(&["--distance", distance], "2");
        assert_eq!(
            (code, out.as_str(), error.lines().count()),
            (2, "", 1),
            "{error}"
        );
        assert!(error.contains("--distance"), "{error}");
    }
}
