//! `host-sim design` and what follows from it, as the user asks for it: kinds of drive, ways to choose
//! gains, and the comparison.

use crate::common::{host_sim, ran};
use serde_json::Value;
use std::fs;
use std::path::Path;

const DRIVE: &str = include_str!("../drive.toml");
const WEIGHTS: &str = "position = [225.0, 225.0, 225.0, 225.0]  # 1/m^2, actuator first\n\
                       velocity = [0.2, 0.2, 0.2, 0.2]          # s^2/m^2\n";

/// Runs in a directory; returns exit code, standard output, standard error.
fn run(directory: &Path, arguments: &[&str]) -> (i32, String, String) {
    ran(host_sim().args(arguments).current_dir(directory))
}

/// Runs a command on a drive file, which must succeed, and returns what it printed.
fn good(directory: &Path, drive: &str, arguments: &[&str]) -> String {
    fs::write(directory.join("drive.toml"), drive).unwrap();
    let (code, text, error) = run(directory, arguments);
    assert_eq!((code, error.as_str()), (0, ""), "{arguments:?}");
    text
}

fn json(directory: &Path, drive: &str, arguments: &[&str]) -> Value {
    let text = good(directory, drive, &[arguments, &["--json"]].concat());
    serde_json::from_str(&text).unwrap()
}

fn with_observer(table: &str) -> String {
    DRIVE.replace("[cost]", &format!("[observer]\n{table}\n\n[cost]"))
}

/// Norms of the poles that a design prints.
fn norms(poles: &Value) -> Vec<f64> {
    poles
        .as_array()
        .unwrap()
        .iter()
        .map(|pole| f64::hypot(pole[0].as_f64().unwrap(), pole[1].as_f64().unwrap()))
        .collect()
}

/// A rotary drive of the same numbers has the same gains; everything it writes is in its own units.
#[test]
fn a_rotary_drive_is_in_its_own_units() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let rotary = DRIVE.replacen("[actuator]", "kind = \"rotary\"\n[actuator]", 1);
    let design = ["design", "drive.toml"];
    let (linear, turning) = (json(at, DRIVE, &design), json(at, &rotary, &design));
    assert_eq!(linear["k"], turning["k"]);
    assert_eq!(linear["observer_gain"], turning["observer_gain"]);

    let mut written = vec![
        good(
            at,
            &rotary,
            &[
                "design",
                "drive.toml",
                "--rust",
                "gains.rs",
                "--plot",
                "k.svg",
            ],
        ),
        good(at, &rotary, &["simulate", "drive.toml", "--out", "."]),
        good(
            at,
            &rotary,
            &["simulate", "drive.toml", "--scenario", "move", "--out", "."],
        ),
        good(
            at,
            &rotary,
            &[
                "excite",
                "drive.toml",
                "--out",
                ".",
                "--rust",
                "excitation.rs",
            ],
        ),
        good(at, &rotary, &THIN),
    ];
    for (found, expected) in written.iter().zip([
        "position gain [A/rad]",
        "residual [urad p-p]",
        "move of 30 mrad",
        " mrad",
        "Step of 30 mrad",
    ]) {
        assert!(found.contains(expected), "{expected}: {found}");
    }
    for name in [
        "gains.rs",
        "k.svg",
        "fig3.csv",
        "fig3.svg",
        "fig5.svg",
        "excitation.rs",
    ] {
        written.push(fs::read_to_string(at.join(name)).unwrap());
    }
    let csv = &written[7];
    assert!(csv.starts_with("time[s],count[1]"), "{csv:.80}");
    for column in ["reference[rad]", "velocity[rad/s]", "reaction_force[N m]"] {
        assert!(csv.contains(column), "{column}");
    }
    for text in &written {
        for unit in [
            "[m]", "[m/s]", "[N]", " mm", "[mm", "[um", " um ", "A/m", "N/m", " kg,",
        ] {
            assert!(!text.contains(unit), "{unit} in {text}");
        }
    }
}

/// The weights of a requested settling time: the true state fed back settles in it. The amplifier has no steps: one
/// of 1 mA is 0.7 mm to the weakest of these gains.
#[test]
fn a_requested_settling_time_is_met() {
    let directory = tempfile::tempdir().unwrap();
    for seconds in [0.15, 0.25, 0.5] {
        let drive = DRIVE
            .replace(WEIGHTS, &format!("settling_time = {seconds}\n"))
            .replace("current_resolution = 1e-3", "current_resolution = 0.0");
        let arguments = ["simulate", "drive.toml", "--scenario", "fig3", "--out", "."];
        let value = json(directory.path(), &drive, &arguments);
        let settled = |index: usize| {
            value["experiments"][index]["metrics"]["settling_time"]
                .as_f64()
                .unwrap()
        };
        assert!(
            (settled(1) / seconds - 1.0).abs() < 0.02,
            "{seconds}: {}",
            settled(1)
        );
        assert!(
            (settled(0) / seconds - 1.0).abs() < 0.10,
            "{seconds}: {}",
            settled(0)
        );
    }
}

/// Placed poles: every part of the estimation error that can be moved decays as many times faster than
/// the slowest regulator pole as was asked for, or more.
#[test]
fn an_observer_of_placed_poles_is_as_fast_as_asked() {
    let directory = tempfile::tempdir().unwrap();
    for speed in [2.0, 3.0] {
        let drive = with_observer(&format!("design = \"poles\"\nspeed = {speed}"));
        let value = json(directory.path(), &drive, &["design", "drive.toml"]);
        let slowest = |poles: &Value| -norms(poles).into_iter().fold(0.0, f64::max).ln();
        let ratio = slowest(&value["observer_poles"]) / slowest(&value["regulator_poles"]);
        assert!((ratio / speed - 1.0).abs() < 1e-6, "{speed}: {ratio}");
        let check = value["checks"].as_array().unwrap().iter();
        let check = check
            .clone()
            .find(|check| check["name"] == "observer_speed")
            .unwrap();
        assert!(
            check["verdict"] == "pass" && check["limit"] == speed,
            "{check}"
        );
    }
}

/// The disturbance state takes what pushes the actuator for what it is; without it the observer puts the same force down
/// to the load and leaves the load away from its target for long.
#[test]
fn without_the_disturbance_state_a_push_is_taken_for_load() {
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("plant.toml");
    let push = "[[force]]\nmass = 0\nnewton = -0.1\nstart = 0.0\nduration = 2.0\n";
    fs::write(&plant, format!("{DRIVE}\n{push}")).unwrap();
    let metrics = |drive: &str| {
        let arguments = [
            &["simulate", "drive.toml", "--scenario", "fig3", "--out", "."][..],
            &["--plant", "plant.toml"],
        ];
        let mut value = json(directory.path(), drive, &arguments.concat());
        value["experiments"][0]["metrics"].take()
    };
    let (with, without) = (
        metrics(DRIVE),
        metrics(&with_observer("disturbance = false")),
    );
    let error = |metrics: &Value| metrics["estimation_error"][2].as_f64().unwrap();
    assert!(error(&without) > 2.0 * error(&with), "{with} {without}");
    let settled = |metrics: &Value| metrics["settling_time"].as_f64();
    let quick = settled(&with).unwrap();
    assert!(quick < 0.2, "{with}");
    let slow = settled(&without).unwrap_or(f64::INFINITY);
    assert!(slow > 3.0 * quick, "{without}");
}

/// The plot of K(t), whole or not at all.
#[test]
fn the_gain_over_the_time_to_go_is_plotted() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let text = good(at, DRIVE, &["design", "drive.toml", "--plot", "k.svg"]);
    assert!(text.contains("plot written to k.svg"), "{text}");
    let svg = fs::read_to_string(at.join("k.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    assert!(svg.matches("<polyline").count() >= 8 && !svg.contains("NaN"));

    let (code, _, error) = run(at, &["design", "drive.toml", "--plot", "."]);
    assert_eq!((code, error.lines().count()), (1, 1), "{error}");
}

/// A comparison that is made quickly.
const THIN: [&str; 6] = [
    "compare",
    "drive.toml",
    "--evaluations",
    "20",
    "--plants",
    "2",
];

/// Every law on every plant; the table says what the JSON says.
#[test]
fn rivals_are_compared_on_the_same_plants() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let value = json(at, DRIVE, &THIN);
    let laws = value["laws"].as_array().unwrap();
    let names: Vec<_> = laws
        .iter()
        .map(|law| law["law"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "full state",
            "drive",
            "drive, tuned",
            "encoder filter",
            "PD",
            "PD + notch",
            "PD + observer",
            "PD + ZV",
            "PD + ZVD",
            "PD + EI",
            "PD + MZV"
        ]
    );
    let cases = |law: &Value| -> Vec<String> {
        let outcomes = law["outcomes"].as_array().unwrap();
        outcomes
            .iter()
            .map(|outcome| outcome["case"].to_string())
            .collect()
    };
    assert_eq!(cases(&laws[0]).len(), 9);
    assert!(laws.iter().all(|law| cases(law) == cases(&laws[0])));
    assert!(laws.iter().all(|law| law["held_out"]["plants"] == 2));
    // By planned moves the same laws on the same plants; PD behind a shaper goes as it went.
    let moves = value["moves"].as_array().unwrap();
    for (by_move, by_step) in moves.iter().zip(laws) {
        assert_eq!(by_move["law"], by_step["law"]);
        assert_eq!(cases(by_move), cases(by_step));
    }
    assert_eq!(moves.len(), laws.len());
    assert_eq!(moves[8]["tuning"], laws[8]["tuning"]);
    // The same experiment as the main job's.
    let arguments = ["simulate", "drive.toml", "--scenario", "fig3", "--out", "."];
    let main = json(at, DRIVE, &arguments);
    for (law, run) in [(1, 0), (0, 1)] {
        assert_eq!(
            laws[law]["outcomes"][0]["metrics"]["settling_time"],
            main["experiments"][run]["metrics"]["settling_time"]
        );
    }
    // Beside every settling time, how many times the bound of its plant it is: one sample late, one sample more.
    let bound = |case: usize| value["bounds"][case]["bound"]["settled"].as_f64().unwrap();
    assert!((bound(7) - bound(0) - 1e-3).abs() < 1e-9);
    for law in laws {
        for (case, outcome) in law["outcomes"].as_array().unwrap().iter().enumerate() {
            let settled = outcome["metrics"]["settling_time"].as_f64();
            let times = settled.map(|settled| settled / bound(case));
            assert_eq!(outcome["times_bound"].as_f64(), times);
            assert!(times.is_none_or(|times| times > 1.0));
        }
    }
    let text = good(at, DRIVE, &THIN);
    for name in names {
        assert!(text.contains(&format!("| {name} ")), "{name}: {text}");
    }
    let (code, out, error) = run(at, &["compare", "nowhere.toml"]);
    assert_eq!(
        (code, out.as_str(), error.lines().count()),
        (2, "", 1),
        "{error}"
    );
}

/// What would run for minutes, or into all of the memory, is refused before it begins.
#[test]
fn runs_that_would_not_end_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let soft = DRIVE.replace("stiffness = 300.0", "stiffness = 1e-3");
    fs::write(at.join("soft.toml"), soft).unwrap();
    let quick = DRIVE.replace("sample_time = 1e-3", "sample_time = 1e-4");
    fs::write(at.join("quick.toml"), quick).unwrap();
    for (arguments, expected, sentence) in [
        (
            &["compare", "soft.toml"][..],
            1,
            "at most 50000 can be compared",
        ),
        (
            &["simulate", "quick.toml", "--duration", "100.1"],
            2,
            "--duration 100.1: must be 1000000 control periods of 0.0001 s at most",
        ),
    ] {
        let (code, out, error) = run(at, arguments);
        assert_eq!((code, out.as_str()), (expected, ""), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(error.contains(sentence), "{error}");
    }
}
