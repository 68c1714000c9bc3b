//! `host-sim tune`: a drive file with what was found, which is what was judged; the same for any number of threads;
//! a family that contains another is not worse; and what cannot be asked.

use crate::common::{host_sim, ran};
use serde_json::Value;
use std::path::Path;

const THIN: [&str; 8] = [
    "tune",
    "--evaluations",
    "40",
    "--tuned-on",
    "2",
    "--plants",
    "4",
    "--json",
];

fn thin(more: &[&str], threads: &str) -> (i32, String, String) {
    ran(host_sim()
        .args(THIN)
        .args(more)
        .env("RAYON_NUM_THREADS", threads))
}

/// Two masses on a short axis: few plans, soon made.
const SMALL: &str = r#"
[actuator]
mass = 0.059
force_constant = 6.43
current_limit = 2.0
current_resolution = 1e-3

[encoder]
resolution = 1e-6
counter_bits = 16

[[load]]
mass = 0.057
stiffness = 300.0
damping = 0.1

[control]
sample_time = 1e-3
disturbance_cutoff = 628.0
reaction_force_cutoff = 628.0
observer = "anchored"

[cost]
current = 1.0
position = [450.0, 450.0]
velocity = [0.4, 0.4]

[protection]
travel = [-1e-3, 0.032]
"#;

/// The small drive as a file.
fn small(folder: &Path) -> String {
    let path = folder.join("small.toml");
    std::fs::write(&path, SMALL).unwrap();
    path.to_str().unwrap().to_owned()
}

fn law<'a>(value: &'a Value, name: &str) -> &'a Value {
    let laws = value["laws"].as_array().unwrap();
    laws.iter().find(|law| law["law"] == name).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

#[test]
fn what_is_found_is_in_the_drive_file_and_is_a_design_like_any_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tuned.toml");
    let file = path.to_str().unwrap();
    let drive = small(folder.path());
    let (code, text, error) = thin(&[&drive, "--step", "--toml", file], "2");
    assert_eq!((code, error), (0, String::new()));
    assert_eq!(
        text,
        thin(&[&drive, "--step"], "1").1,
        "threads change nothing"
    );
    let value: Value = serde_json::from_str(&text).unwrap();
    let tuned = law(&value, "drive, tuned");
    let gain = &tuned["tuning"]["gain"];
    let (position, velocity) = (numbers(&gain["position"]), numbers(&gain["velocity"]));

    // `design` has the gain that was judged, whole, and no performance index.
    let (code, text, error) = ran(host_sim().args(["design", file, "--json"]));
    assert_eq!((code, error), (0, String::new()));
    let design: Value = serde_json::from_str(&text).unwrap();
    let k = numbers(&design["k"]);
    let (of_positions, of_velocities): (Vec<f64>, Vec<f64>) =
        k.chunks(2).map(|mass| (mass[0], mass[1])).unzip();
    assert_eq!((of_positions, of_velocities), (position, velocity));
    let why = design["finite_horizon_failure"].as_str().unwrap();
    assert!(why.contains("[gain]"), "{why}");
    let checks = design["checks"].as_array().unwrap();
    assert!(
        checks
            .iter()
            .all(|check| check["name"] != "riccati_residual")
    );
    assert!(checks.iter().any(|check| check["name"] == "closed_loop"));

    // With everything free the drive is not worse than PD with its own friction removal, of which it contains all.
    let criterion = |name: &str| law(&value, name)["criterion"].as_f64().unwrap();
    assert!(criterion("drive, tuned") <= criterion("drive, load gains zero"));
    let zero = numbers(&law(&value, "drive, load gains zero")["tuning"]["gain"]["position"]);
    assert_eq!(zero[1..], [0.0]);
    for law in value["laws"].as_array().unwrap() {
        assert!(
            law["peak_current"]["worst"].as_f64().unwrap() <= 2.0 + 1e-6,
            "{law}"
        );
    }
}

#[test]
fn planned_moves_are_tuned_with_their_plans() {
    let folder = tempfile::tempdir().unwrap();
    let drive = small(folder.path());
    let (code, text, error) = thin(&[&drive, "--force-constant", "1:1", "--friction", "0"], "2");
    assert_eq!((code, error), (0, String::new()));
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        value["ranges"]["force_constant"],
        serde_json::json!([1.0, 1.0])
    );
    assert_eq!(value["ranges"]["friction"], serde_json::json!([0.0, 0.0]));
    let plan = |name: &str| numbers(&law(&value, name)["plan"]);
    let [own, tuned] = ["drive, as designed", "drive, tuned"].map(plan);
    // Less current makes a longer move, and the centre of the masses needs 2 √(s M / F) at the least.
    let least = 2.0 * (0.03_f64 * 0.116 / (2.0 * 6.43)).sqrt();
    assert!(
        tuned[0] <= own[0] && tuned[1] >= own[1] && own[1] >= least,
        "{own:?} {tuned:?}"
    );
}

#[test]
fn what_cannot_be_tuned_is_one_sentence_and_leaves_the_file_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("there.toml");
    std::fs::write(&path, "what stood there").unwrap();
    let file = path.to_str().unwrap();
    for (arguments, named) in [
        (vec!["--set", "rough"], "friction.coulomb"),
        (vec!["--stiffness", "1.3:0.7"], "--stiffness"),
        (vec!["--stiffness", "nan"], "--stiffness"),
        (vec!["--last-load", "0:1"], "--last-load"),
        (vec!["--force-constant", "0.5:100"], "--force-constant"),
        (
            vec!["--friction", "-1:0"],
            "--friction -1:0: must rise, from 0 to",
        ),
        (vec!["--friction", "0:1e9"], "--friction"),
        (vec!["--distance", "0"], "--distance"),
    ] {
        let (code, out, error) = thin(&[&arguments[..], &["--toml", file]].concat(), "2");
        assert_eq!((code, out.as_str()), (2, ""), "{error}");
        assert!(
            error.contains(named) && error.trim().lines().count() == 1,
            "{error}"
        );
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "what stood there");
    // Out of the travel.
    let small = small(folder.path());
    let (code, out, error) = thin(&[&small, "--distance", "0.1", "--toml", file], "2");
    assert_eq!((code, out.as_str()), (2, ""), "{error}");
    assert!(
        error.contains("leads to 0.1 m, outside the travel"),
        "{error}"
    );
    // Before the work, which here would take for ever.
    let long = ["--evaluations", "1000000", "--tuned-on", "10000"];
    let nowhere = folder.path().to_str().unwrap();
    let (code, out, error) = ran(host_sim()
        .args(["tune", &small, "--toml", nowhere])
        .args(long));
    assert_eq!((code, out.as_str()), (1, ""), "{error}");
    assert!(error.contains("cannot write"), "{error}");
    // Where the drive fails on every plant, here as soon as it moves, there is nothing to write.
    let slow = SMALL.replace("[protection]\n", "[protection]\nvelocity = 1e-3\n");
    std::fs::write(&small, slow).unwrap();
    let (code, out, error) = thin(&[&small, "--step", "--toml", file], "2");
    assert_eq!((code, out.as_str()), (1, ""), "{error}");
    assert!(error.contains("on a single plant"), "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "what stood there");
}

/// A drive file with other text in the place of its cost.
fn with_gain(folder: &Path, gain: &str) -> std::path::PathBuf {
    let text = include_str!("../drive.toml");
    let cost = text.find("[cost]").unwrap();
    let end = text.find("[move]").unwrap();
    let path = folder.join("drive.toml");
    std::fs::write(
        &path,
        format!("{}{gain}\n\n{}", &text[..cost], &text[end..]),
    )
    .unwrap();
    path
}

/// The gain that `[cost]` leads to, stated itself, is the same drive.
#[test]
fn a_stated_gain_is_the_gain() {
    let design = |path: Option<&Path>| -> Value {
        let (code, text, error) = ran(host_sim().arg("design").args(path).arg("--json"));
        assert_eq!((code, error), (0, String::new()));
        serde_json::from_str(&text).unwrap()
    };
    let designed = design(None);
    let k = numbers(&designed["k"]);
    let list = |first: usize| format!("{:?}", k.iter().skip(first).step_by(2).collect::<Vec<_>>());
    let folder = tempfile::tempdir().unwrap();
    let gain = format!("[gain]\nposition = {}\nvelocity = {}", list(0), list(1));
    let stated = design(Some(&with_gain(folder.path(), &gain)));
    for key in [
        "k",
        "regulator_poles",
        "observer_gain",
        "protection",
        "moves",
        "margins",
        "margins_held",
        "fingerprint",
    ] {
        assert_eq!(stated[key], designed[key], "{key}");
    }
}

#[test]
fn gains_that_cannot_be_are_one_sentence_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let cost = "[cost]\ncurrent = 1.0\nenergy = 1.0\n";
    let good = "[gain]\nposition = [10.0, 0, 0, 0]\nvelocity = [0.5, 0, 0, 0]";
    for (gain, code, named) in [
        (format!("{cost}{good}"), 2, "[gain] and [cost]"),
        (
            good.replace("10.0, 0,", "10.0,"),
            2,
            "gain.position has 3 entries: must have 4",
        ),
        (
            good.replace("0.5", "inf"),
            2,
            "gain.velocity[0] = inf: must be",
        ),
        (
            good.replace("10.0", "-10.0"),
            2,
            "gain.position: the sum of its entries is -10",
        ),
        (good.replace("velocity", "speed"), 2, "speed"),
        (
            good.replace("0.5", "-0.5"),
            1,
            "the regulator is not stable",
        ),
    ] {
        let path = with_gain(folder.path(), &gain);
        let (found, out, error) = ran(host_sim().arg("design").arg(&path));
        assert_eq!((found, out.as_str()), (code, ""), "{gain}: {error}");
        assert!(
            error.contains(named) && error.trim().lines().count() == 1,
            "{error}"
        );
        assert!(code == 1 || error.contains("drive.toml:"), "{error}");
    }
}
