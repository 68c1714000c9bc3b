//! The program as the user runs it: exit codes, messages, files.

use crate::common::{host_sim, ran};
use arso_core::{Fault, Mode, Telemetry};
use std::fs;
use std::path::{Path, PathBuf};

const DRIVE: &str = include_str!("../drive.toml");

/// Runs and returns exit code, standard output, standard error.
fn run(arguments: &[&str]) -> (i32, String, String) {
    ran(host_sim().args(arguments))
}

/// Runs `design` on a text; returns exit code and the error.
fn design(text: &str) -> (i32, String) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("drive.toml");
    fs::write(&path, text).unwrap();
    let (code, _, error) = run(&["design", path.to_str().unwrap()]);
    (
        code,
        error.replace(&directory.path().display().to_string(), ""),
    )
}

#[test]
fn the_main_job_prints_the_table_and_writes_its_files() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("a/b");
    let (code, text, error) = run(&["--out", out.to_str().unwrap()]);
    assert_eq!((code, error.as_str()), (0, ""));
    for name in ["fig3", "fig4", "fig5", "fig6", "move"] {
        assert!(text.contains(&format!("| {name}")), "{text}");
        let svg = fs::read_to_string(out.join(format!("{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        let mut csv = csv::Reader::from_path(out.join(format!("{name}.csv"))).unwrap();
        let header = csv.headers().unwrap().clone();
        assert_eq!(&header[0], "time[s]");
        assert!(header.iter().all(|name| name.ends_with(']')), "{header:?}");
        let rows: Vec<csv::StringRecord> = csv.records().collect::<Result<_, _>>().unwrap();
        assert_eq!(rows.len(), 1200);
        let finite = |field: &str| field.parse::<f64>().unwrap().is_finite();
        assert!(rows.iter().all(|row| row.iter().all(finite)));
    }
    // Nothing temporary stays behind.
    assert_eq!(fs::read_dir(out).unwrap().count(), 15);
    // And the tables fit a terminal.
    let widest = text.lines().map(|line| line.chars().count()).max();
    assert!(widest <= Some(110), "{widest:?}");
}

#[test]
fn json_holds_the_figures_of_the_table() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    let (code, text, _) = run(&["simulate", "--scenario", "fig3", "--json", "--out", out]);
    assert_eq!(code, 0);
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let experiments = value["experiments"].as_array().unwrap();
    assert_eq!(experiments.len(), 2);
    let settling = experiments[0]["metrics"]["settling_time"].as_f64().unwrap();
    assert!((0.1..0.2).contains(&settling));
    assert_eq!(experiments[1]["law"], "full_state");
    for file in value["files"].as_array().unwrap() {
        assert!(fs::metadata(file.as_str().unwrap()).is_ok());
    }

    let (code, text, _) = run(&["design", "--json"]);
    assert_eq!(code, 0);
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["a"].as_array().unwrap().len(), 8);
    assert_eq!(value["k"].as_array().unwrap().len(), 8);
    assert_eq!(value["observer_gain"].as_array().unwrap().len(), 9);
    assert_eq!(value["observer_poles"][0].as_array().unwrap().len(), 2);
    assert!((value["modes"][0]["frequency_hz"].as_f64().unwrap() - 11.94).abs() < 0.01);
}

#[test]
fn csv_goes_to_standard_output() {
    let (code, text, _) = run(&[
        "simulate",
        "--scenario",
        "move",
        "--csv",
        "--duration",
        "0.2",
    ]);
    assert_eq!(code, 0);
    assert_eq!(text.lines().count(), 201);
    let (code, _, error) = run(&["simulate", "--csv"]);
    assert_eq!((code, error.lines().count()), (2, 1));
}

#[test]
fn a_plant_that_differs_is_simulated() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("plant.toml");
    let text = format!(
        "{DRIVE}\n[friction]\ncoulomb = 0.02\nviscous = 0.1\n\n\
         [[force]]\nmass = 3\nstart = 0.6\nduration = 0.01\nnewton = 1.0\n"
    );
    fs::write(&path, text).unwrap();
    let plant = path.to_str().unwrap();
    let out = directory.path().to_str().unwrap();
    let arguments = [
        "simulate",
        "--scenario",
        "fig3",
        "--plant",
        plant,
        "--json",
        "--out",
        out,
    ];
    let (code, text, error) = run(&arguments);
    assert_eq!((code, error.as_str()), (0, ""));
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    // The kick at 0.6 s throws mass 2 out of the band, 10 mN s on 116 g at the least.
    let settling = value["experiments"][0]["metrics"]["settling_time"]
        .as_f64()
        .unwrap();
    assert!(settling > 0.6, "{settling}");
}

/// A drive that faults in the simulation is a failed run, told after its figures; a drive that
/// cannot be commissioned has no figures.
#[test]
fn a_fault_is_a_failed_run() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("plant.toml");
    let out = directory.path().to_str().unwrap();
    let arguments = [
        "--plant",
        path.to_str().unwrap(),
        "--scenario",
        "fig3",
        "--out",
        out,
    ];
    // A blow that moves the encoder by more than a quarter of its range in one period.
    let blow = "[[force]]\nmass = 0\nstart = 0.1\nduration = 0.01\nnewton = 5000.0\n";
    fs::write(&path, format!("{DRIVE}\n{blow}")).unwrap();
    let (code, text, error) = run(&arguments);
    assert_eq!(code, 1);
    assert!(text.contains("fault 2"), "{text}");
    assert!(error.contains("EncoderJump"), "{error}");

    // Friction beyond what half of the current can move.
    fs::write(&path, format!("{DRIVE}\n[friction]\ncoulomb = 10.0\n")).unwrap();
    let (code, text, error) = run(&arguments);
    assert_eq!((code, text.as_str()), (1, ""));
    assert!(
        error.contains("commissioning ended with fault 6 (NoMotion)"),
        "{error}"
    );
}

#[test]
fn gains_are_written_whole_or_not_at_all() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("gains.rs");
    fs::write(&path, "old").unwrap();
    let (code, _, _) = run(&["design", "--rust", path.to_str().unwrap()]);
    assert_eq!(code, 0);
    assert!(
        fs::read_to_string(&path)
            .unwrap()
            .starts_with("//! Gains of the drive.")
    );

    // So does a device: it is not replaced.
    #[cfg(unix)]
    {
        let (code, _, error) = run(&["design", "--rust", "/dev/full"]);
        assert_eq!((code, error.lines().count()), (1, 1), "{error}");
        assert!(!fs::metadata("/dev/full").unwrap().is_file());
    }

    // A directory stands where the file should go: an error, and the directory stays.
    let blocked = directory.path().join("blocked");
    fs::create_dir(&blocked).unwrap();
    let (code, _, error) = run(&["design", "--rust", blocked.to_str().unwrap()]);
    assert_eq!((code, error.lines().count()), (1, 1), "{error}");
    assert!(blocked.is_dir());
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 2);
}

/// Each change of the default drive, and what the message must name: line, key, what is allowed.
#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn bad_drives_get_one_sentence_that_says_where() {
    let cases: &[(&str, &str, &str)] = &[
        (
            "mass = 0.059 ",
            "mass = -0.059 ",
            ":5: actuator.mass = -0.059: must be from 1e-9 to 1e9 kg",
        ),
        (
            "mass = 0.059 ",
            "mass = nan ",
            ":5: actuator.mass = NaN: must be",
        ),
        (
            "mass = 0.059 ",
            "mass = inf ",
            ":5: actuator.mass = inf: must be",
        ),
        (
            "mass = 0.059 ",
            "mass = \"heavy\" ",
            ":5: mass: invalid type: string \"heavy\"",
        ),
        ("mass = 0.059 ", "maas = 0.059 ", ":5: unknown field `maas`"),
        (
            "[actuator]",
            "[actuator]\nholding_force = nan",
            ":5: actuator.holding_force = NaN: must be within 1e9 N",
        ),
        (
            "[actuator]",
            "[actuator]\nbrake = 1",
            ":5: brake: invalid type: integer `1`, expected a boolean",
        ),
        (
            "[actuator]",
            "[amplifier]\nzero_code = -1\n[actuator]",
            ":5: amplifier.zero_code = -1: must be a code of the converter, 0 to 65535",
        ),
        (
            "[actuator]",
            "[amplifier]\nstep = 1e-3\n[actuator]",
            ":5: unknown field `step`, expected `zero_code` or `inverted`",
        ),
        (
            "[actuator]",
            "[protection]\ntravel = [0.02, -0.01]\n[actuator]",
            ":5: protection.travel = [0.02, -0.01]: must be two numbers, the lower end first",
        ),
        (
            "[actuator]",
            "[protection]\ntravel = [0.0]\n[actuator]",
            ":5: protection.travel = [0.0]: must be two numbers",
        ),
        (
            "[actuator]",
            "[protection]\ntravel = [0.0, 1e-9]\n[actuator]",
            "three counts of 1e-6 m apart at least",
        ),
        (
            "mass = 0.059 ",
            "mass = 0,059 ",
            ":5: a number has a decimal point, not a comma",
        ),
        ("mass = 0.059 ", "", ": missing field `mass`"),
        (
            "force_constant = 6.43",
            "force_constant = 0",
            ":6: actuator.force_constant = 0: must be",
        ),
        (
            "current_limit = 2.0",
            "current_limit = 0.0",
            ":7: actuator.current_limit = 0: must be",
        ),
        (
            "current_resolution = 1e-3",
            "current_resolution = 3.0",
            ":8: actuator.current_resolution = 3: must be 0",
        ),
        (
            "current_resolution = 1e-3",
            "mass_deviation = -0.06",
            ":8: actuator.mass_deviation = -0.06: must be within 90 %",
        ),
        (
            "resolution = 1e-6 ",
            "resolution = 0 ",
            ":11: encoder.resolution = 0: must be",
        ),
        (
            "counter_bits = 16",
            "counter_bits = 33",
            ":12: encoder.counter_bits = 33: must be 2 to 32",
        ),
        (
            "counter_bits = 16",
            "counter_bits = 16.5",
            ":12: counter_bits: invalid type",
        ),
        (
            "stiffness = 300.0          #",
            "stiffness = 0.0 #",
            ":16: load[1].stiffness = 0: must be",
        ),
        (
            "damping = 0.1              #",
            "damping = -1 #",
            ":17: load[1].damping = -1: must be",
        ),
        (
            "sample_time = 1e-3",
            "sample_time = 10.0",
            ": control.sample_time = 10: must be from 1e-6 to 1 s",
        ),
        (
            "disturbance_cutoff = 628.0",
            "disturbance_cutoff = 4000.0",
            "below pi / sample_time",
        ),
        (
            "observer = \"anchored\"",
            "observer = \"kalman\"",
            "must be \"anchored\" or \"reaction\"",
        ),
        (
            "position = [225.0, ",
            "position = [",
            "cost.position has 3 entries: must have 4",
        ),
        (
            "position = [225.0, ",
            "position = [-1.0, ",
            "cost.position[0] = -1: must be from 0",
        ),
        (
            "velocity = [0.2, 0.2, 0.2, 0.2]",
            "energy = 1.0",
            "either both position and velocity, or energy alone",
        ),
        (
            "position = [225.0, 225.0, 225.0, 225.0]",
            "position = [0.0, 0.0, 0.0, 0.0]",
            "one entry at least",
        ),
        (
            "current = 1.0 ",
            "current = 0.0 ",
            "cost.current = 0: must be",
        ),
        (
            "velocity = 2.0 ",
            "velocity = 2.0\njerk = 0.0 ",
            "move.jerk = 0: must be",
        ),
        (
            "[actuator]",
            "kind = \"round\"\n[actuator]",
            ":4: kind = \"round\": must be \"linear\" or \"rotary\"",
        ),
        (
            "[actuator]\nmass = 0.059 ",
            "kind = \"rotary\"\n[actuator]\nmass = -1.0 ",
            ":6: actuator.mass = -1: must be from 1e-9 to 1e9 kg m^2",
        ),
        (
            "[cost] ",
            "[friction]\ncoulomb = -1.0\n[cost] ",
            "friction.coulomb = -1: must be from 0 to 1e9 N",
        ),
        (
            "[cost] ",
            "[friction]\nviscous = nan\n[cost] ",
            "friction.viscous = NaN: must be from 0 to 1e9 N s/m",
        ),
        (
            "[cost] ",
            "[friction]\ndynamic = 1.0\n[cost] ",
            "unknown field `dynamic`",
        ),
        (
            "[cost] ",
            "[friction]\ncoulomb = 1.5\nstatic = 1.0\n[cost] ",
            "friction.static = 1: must be from friction.coulomb = 1.5 to 1e9 N",
        ),
        (
            "[cost] ",
            "[friction]\ncoulomb = 1.5\nstatic = 2.0\nstribeck_velocity = 0.0\n[cost] ",
            "friction.stribeck_velocity = 0: must be from 1e-9 to 1e9 m/s",
        ),
        (
            "[actuator]",
            "[actuator]\ndelay = 4.1e-3",
            "actuator.delay = 0.0041: must be at most 4 control periods, 0.004 s, in a drive file",
        ),
        (
            "[actuator]",
            "[actuator]\nlag = -1e-3",
            "actuator.lag = -0.001: must be 0 (none) or from 1e-9 to 1 s",
        ),
        (
            "[actuator]",
            "[actuator]\ncogging = 0.1",
            "actuator.cogging belongs into a plant file",
        ),
        (
            "[encoder]",
            "[encoder]\nnoise = 1e-6",
            "encoder.noise belongs into a plant file",
        ),
        (
            "[cost] ",
            "[observer]\ndesign = \"luenberger\"\n[cost] ",
            "observer.design = \"luenberger\": must be \"kalman\" or \"poles\"",
        ),
        (
            "observer = \"anchored\"           # or \"reaction\", eq. (17) as printed\n",
            "observer = \"reaction\"\n[observer]\ndesign = \"poles\"\n",
            "observer.design = \"poles\": must be \"kalman\" for control.observer = \"reaction\"",
        ),
        (
            "[cost] ",
            "[observer]\nspeed = 0.5\n[cost] ",
            "observer.speed = 0.5: must be from 1 to 100",
        ),
        (
            "[cost] ",
            "[observer]\nload_force_ratio = 0\n[cost] ",
            "observer.load_force_ratio = 0: must be from 1e-9 to 1e9",
        ),
        (
            "[cost] ",
            "[observer]\ndisturbance_rate = -3\n[cost] ",
            "observer.disturbance_rate = -3: must be from 1e-9 to 1e9 1/s",
        ),
        (
            "[cost] ",
            "[observer]\ndisturbance = 1\n[cost] ",
            "invalid type: integer `1`, expected a boolean",
        ),
        (
            "position = [225.0, 225.0, 225.0, 225.0]  # 1/m^2, actuator first\nvelocity = [0.2, 0.2, 0.2, 0.2] ",
            "settling_time = 0.02 ",
            "cost.settling_time = 0.02: equal weights on all masses do not settle this chain that fast",
        ),
        (
            "position = [225.0, 225.0, 225.0, 225.0]  # 1/m^2, actuator first\nvelocity = [0.2, 0.2, 0.2, 0.2] ",
            "settling_time = 0.0 ",
            "cost.settling_time = 0: must be from 1e-9",
        ),
        (
            "current = 1.0 ",
            "current = 1.0\nsettling_time = 0.2 ",
            "or energy alone, or settling_time alone",
        ),
        (
            "current = 1.0 ",
            "current = 1.0\nterminal_position = [1.0] ",
            "cost.terminal_position has 1 entries: must have 4",
        ),
        (
            "current = 1.0 ",
            "current = 1.0\nterminal_velocity = [0.0, 0.0, 0.0, -1.0] ",
            "cost.terminal_velocity[3] = -1: must be from 0 to 1e9 s s^2/m^2",
        ),
        (
            "[cost] ",
            "[[force]]\nmass = 0\nstart = 0\nduration = 0\nnewton = 0\n[cost] ",
            "[[force]] belongs into a plant file",
        ),
        ("[control]", "[control", "unclosed table"),
        ("[control]", "[steering]", "unknown field `steering`"),
    ];
    for (old, new, expected) in cases {
        assert!(DRIVE.contains(old), "{old}");
        let (code, error) = design(&DRIVE.replacen(old, new, 1));
        assert_eq!(code, 2, "{old} -> {new}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(error.contains(expected), "{old} -> {new}: {error}");
        assert!(error.starts_with("error: /drive.toml:"), "{error}");
    }
}

#[test]
fn drives_without_the_needed_tables_say_so() {
    let table = |name: &str| {
        let start = DRIVE.find(name).unwrap();
        let end = DRIVE[start + 1..]
            .find("\n\n[")
            .map_or(DRIVE.len(), |end| start + 1 + end);
        [&DRIVE[..start], &DRIVE[end..]].concat()
    };
    for (name, expected) in [
        ("[actuator]", "missing field `actuator`"),
        ("[encoder]", "missing field `encoder`"),
        ("[control]", "missing table [control]"),
    ] {
        let (code, error) = design(&table(name));
        assert_eq!(code, 2);
        assert!(error.contains(expected), "{error}");
    }
    let no_load = DRIVE[..DRIVE.find("[[load]]").unwrap()].to_owned()
        + &DRIVE[DRIVE.find("[control]").unwrap()..];
    let (code, error) = design(&no_load);
    assert!(
        code == 2 && error.contains("0 [[load]] tables: must be 1 to 6"),
        "{error}"
    );
    let seven = "[[load]]\nmass = 1.0\nstiffness = 1.0\ndamping = 1.0\n".repeat(4);
    let (code, error) = design(&DRIVE.replace("[control]", &format!("{seven}\n[control]")));
    assert!(
        code == 2 && error.contains("7 [[load]] tables: must be 1 to 6"),
        "{error}"
    );
    let (code, error) = design("");
    assert_eq!((code, error.lines().count()), (2, 1), "{error}");
    // [move] may be left out, the limits are then derived from the drive.
    let (code, error) = design(&table("[move]"));
    assert_eq!((code, error.as_str()), (0, ""));
}

/// The default drive's file with one thing changed, and where its gains are to go.
fn changed(directory: &Path, from: &str, to: &str) -> (PathBuf, PathBuf) {
    let path = directory.join("drive.toml");
    fs::write(&path, DRIVE.replace(from, to)).unwrap();
    (path, directory.join("gains.rs"))
}

/// A design that a check refuses is shown, but not written, and is a failed run.
#[test]
fn a_refused_design_is_not_written() {
    let directory = tempfile::tempdir().unwrap();
    let (path, gains) = changed(directory.path(), "resolution = 1e-6 ", "resolution = 1e-3 ");
    let (path, rust) = (path.to_str().unwrap(), gains.to_str().unwrap());
    let (code, text, error) = run(&["design", path, "--rust", rust]);
    assert_eq!((code, error.lines().count()), (1, 1), "{error}");
    assert!(
        text.contains("REFUSE") && !text.contains("gains written"),
        "{text}"
    );
    assert!(error.contains("encoder_force_noise refuses it"), "{error}");
    assert!(!gains.exists());
}

/// A counter of any width is designed for and simulated; gains for the firmware are those of a board's counter.
#[test]
fn the_firmware_has_counters_of_16_or_32_bits() {
    let directory = tempfile::tempdir().unwrap();
    let (path, gains) = changed(directory.path(), "counter_bits = 16", "counter_bits = 24");
    let (path, rust) = (path.to_str().unwrap(), gains.to_str().unwrap());
    let (code, _, error) = run(&["design", path]);
    assert_eq!((code, error.as_str()), (0, ""));
    let (code, _, error) = run(&["design", path, "--rust", rust]);
    assert_eq!((code, error.lines().count()), (1, 1), "{error}");
    let expected = "encoder.counter_bits = 24: the firmware reads counters of 16 or 32 bits alone";
    assert!(error.contains(expected), "{error}");
    assert!(!gains.exists());
}

/// What hangs is refused where nothing holds it or the motor cannot carry it, and a target beyond the travel is
/// not gone to.
#[test]
fn what_hangs_and_what_is_out_of_reach_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("drive.toml");
    for (command, added, expected) in [
        ("design", "holding_force = 1.0", "unheld_force refuses it"),
        (
            "design",
            "holding_force = 7.0\nbrake = true",
            "holding_share refuses it",
        ),
        ("design", "holding_force = 1.0\nbrake = true", ""),
        (
            "simulate",
            "[protection]\ntravel = [-0.01, 0.02]",
            "step: the target is outside the travel",
        ),
    ] {
        let text = if added.starts_with('[') {
            format!("{DRIVE}\n{added}\n")
        } else {
            DRIVE.replace("[actuator]", &format!("[actuator]\n{added}"))
        };
        fs::write(&path, text).unwrap();
        let (code, _, error) = run(&[command, path.to_str().unwrap()]);
        assert_eq!(code, i32::from(!expected.is_empty()), "{added}: {error}");
        assert!(error.contains(expected), "{added}: {error}");
    }
}

/// The printed gains: a table for people, a grid for machines.
#[test]
fn the_printed_gains_are_shown() {
    let (code, text, _) = run(&["paper"]);
    assert!(code == 0 && text.contains("UNSTABLE 45.69"), "{text}");
    let (code, text, _) = run(&["paper", "--json"]);
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, value["grid"].as_array().unwrap().len()), (0, 49));
}

/// Well-formed, but nothing can be designed: a failed run.
#[test]
fn a_chain_too_fast_for_the_sample_time_is_refused() {
    let (code, error) = design(&DRIVE.replace("stiffness = 300.0", "stiffness = 1e6"));
    assert_eq!((code, error.lines().count()), (1, 1));
    assert!(error.contains("needs a sample_time below"), "{error}");
}

#[test]
fn the_paper_s_energy_weights_can_be_asked_for() {
    let position = "position = [225.0, 225.0, 225.0, 225.0]";
    let velocity = "velocity = [0.2, 0.2, 0.2, 0.2]";
    let text = DRIVE
        .replace(position, "energy = 2.0")
        .replace(velocity, "");
    let (code, error) = design(&text);
    assert_eq!((code, error.as_str()), (0, ""));
    // Scale 2: stiffness sums 300, 600, 600, 300 and the masses.
    let explicit = DRIVE
        .replace(position, "position = [600.0, 1200.0, 1200.0, 600.0]")
        .replace(velocity, "velocity = [0.118, 0.038, 0.038, 0.038]");
    let directory = tempfile::tempdir().unwrap();
    let gain = |name: &str, text: &str| -> Vec<f64> {
        let path = directory.path().join(name);
        fs::write(&path, text).unwrap();
        let (_, json, _) = run(&["design", "--json", path.to_str().unwrap()]);
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        value["k"]
            .as_array()
            .unwrap()
            .iter()
            .map(|k| k.as_f64().unwrap())
            .collect()
    };
    for (a, b) in gain("a.toml", &text).iter().zip(gain("b.toml", &explicit)) {
        assert!((a - b).abs() <= 1e-9 * b.abs());
    }
}

#[test]
fn wrong_usage_is_exit_code_2() {
    for arguments in [
        &["--scenario", "fig7"][..],
        &["--duration", "0"],
        &["--duration", "nan"],
        &["--duration", "1000.1"],
        &["design", "--plant", "x"],
        &["simulate", "/nonexistent.toml"],
        &["--plant", "/nonexistent.toml"],
        &["simulate", "--json", "--csv", "--scenario", "fig3"],
        &["nonsense", "more"],
    ] {
        let (code, out, error) = run(arguments);
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}");
        assert!(error.starts_with("error: "), "{error}");
    }
    let (code, _, error) = run(&["simulate", "/nonexistent.toml"]);
    assert_eq!((code, error.lines().count()), (2, 1));
    assert!(error.contains("/nonexistent.toml"));
}

/// Of records and identities.
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// A record as the drive logs it and `probe-rs run` prints it.
fn logged(period: u32, mode: Mode) -> String {
    let record = Telemetry {
        position_set: false,
        period,
        mode,
        count: 12,
        applied_current: 0.001,
        command: 0.002,
        limited: false,
        reference: 0.03,
        position: 1.2e-5,
        velocity: 0.0,
        load_position: [0.0, 0.001],
        load_velocity: [0.0, -0.5],
        reaction_force: 0.1,
        disturbance: 0.1,
        disturbance_state: 0.0,
        fault_value: 0.0,
        cycles: 1100,
    };
    let mut buffer = [0; 128];
    let digest = CHECKSUM.digest();
    let bytes = postcard::to_slice_crc32(&record, &mut buffer, digest).unwrap();
    format!("DEBUG record {bytes:?}")
}

/// What is estimated stands in the CSV while the loop is closed, braking included, and only then.
#[test]
fn estimates_are_shown_while_the_drive_brakes() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("log.txt");
    let braking = Mode::Stopping(Fault::Thermal);
    let lines = [
        logged(1, Mode::Ready),
        logged(2, Mode::Running),
        logged(3, braking),
    ];
    fs::write(&path, lines.join("\n")).unwrap();
    let (code, text, _) = run(&["capture", "--rtt", path.to_str().unwrap(), "--csv"]);
    assert_eq!(code, 0);
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    let headers = csv.headers().unwrap().clone();
    let reference = headers.iter().position(|h| h == "reference[m]");
    let rows = csv
        .records()
        .map(|row| row.unwrap()[reference.unwrap()].to_owned());
    assert_eq!(rows.collect::<Vec<_>>(), ["", "0.03", "0.03"]);
}

/// A log as `probe-rs run` prints it, through a file, standard input and TCP.
#[test]
fn a_log_in_text_is_captured() {
    use std::io::Write;
    let lines = [
        logged(1, Mode::Ready),
        "INFO running".into(),
        logged(2, Mode::Running),
        logged(4, Mode::Running),
    ];
    let log = lines.join("\n");
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("log.txt");
    fs::write(&path, &log).unwrap();
    let out = directory.path().join("out");
    let file = [
        "capture",
        "--rtt",
        path.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    let (code, text, error) = run(&file);
    assert_eq!(code, 0, "{error}");
    assert!(text.contains("3 control periods, 1 lost"), "{text}");
    assert!(
        error.contains("INFO running") && error.contains("1 control periods missing"),
        "{error}"
    );
    let csv = fs::read_to_string(out.join("log.csv")).unwrap();
    assert!(csv.starts_with("time[s],period[1],mode[name],"));
    assert!(
        csv.lines().nth(3).unwrap().starts_with("0.003,4,Running,"),
        "{csv}"
    );
    // What is estimated is known while the drive runs.
    let of = |row: usize, name: &str| {
        let header = csv.lines().next().unwrap();
        let column = header.split(',').position(|title| title == name).unwrap();
        csv.lines()
            .nth(row)
            .unwrap()
            .split(',')
            .nth(column)
            .unwrap()
    };
    assert_eq!(
        (of(1, "disturbance[N]"), of(2, "disturbance[N]")),
        ("", "0.1")
    );
    assert_eq!((of(1, "count[1]"), of(2, "count[1]")), ("12", "12"));
    assert!(
        fs::read_to_string(out.join("log.svg"))
            .unwrap()
            .starts_with("<svg")
    );

    let output = host_sim()
        .args(["capture", "--csv"])
        .write_stdin(log.clone())
        .output()
        .unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), csv);

    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = std::thread::spawn(move || {
        listener
            .accept()
            .unwrap()
            .0
            .write_all(log.as_bytes())
            .unwrap();
    });
    let (code, text, _) = run(&["capture", "--csv", "--tcp", &address]);
    server.join().unwrap();
    assert_eq!((code, text), (0, csv));
}

/// Ctrl-C ends a capture from a server that would stream for ever; nothing that came is lost.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_capture_with_its_records() {
    use std::io::{BufRead, BufReader, Write};
    use std::process::{Command, Stdio};
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let mut capture = Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
        .args(["capture", "--csv", "--tcp", &address])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut server = listener.accept().unwrap().0;
    server
        .write_all(format!("{}\nINFO seen\n", logged(1, Mode::Idle)).as_bytes())
        .unwrap();
    // The message shows that the record before it has been read.
    let mut messages = BufReader::new(capture.stderr.take().unwrap());
    let mut line = String::new();
    messages.read_line(&mut line).unwrap();
    assert_eq!(line, "INFO seen\n");
    let interrupt = Command::new("kill")
        .args(["-INT", &capture.id().to_string()])
        .status();
    assert!(interrupt.unwrap().success());
    let output = capture.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let csv = String::from_utf8(output.stdout).unwrap();
    assert_eq!(
        csv,
        "time[s],period[1],mode[name],count[1],applied_current[A],command[A],limited[1],position_set[1],\
         actuator_position[m],fault_value[1],cycles[1]\n0,1,Idle,12,0.001,0.002,0,0,0.000012,0,1100\n"
    );
}

#[test]
fn logs_that_cannot_be_read_get_a_sentence() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("empty");
    fs::write(&path, "").unwrap();
    let empty = path.to_str().unwrap();
    for (arguments, expected, sentence) in [
        (
            &["capture", "--rtt", "nowhere.log"][..],
            2,
            "cannot read nowhere.log",
        ),
        (
            &["capture", "--elf", "nowhere.log", "--rtt", empty],
            2,
            "cannot read nowhere.log",
        ),
        (
            &["capture", "--elf", empty, "--rtt", empty],
            2,
            "not an ELF",
        ),
        (&["capture", "--rtt", empty], 1, "holds no control period"),
        (
            &["capture", "--tcp", "127.0.0.1:1"],
            2,
            "cannot read 127.0.0.1:1",
        ),
    ] {
        let (code, out, error) = run(arguments);
        assert_eq!((code, out.as_str()), (expected, ""), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(error.contains(sentence), "{error}");
    }
}

/// A reader that goes away early is no error.
#[test]
fn output_into_a_closed_pipe_is_quiet() {
    use std::process::{Command, Stdio};
    let mut child = Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
        .args(["simulate", "--scenario", "fig3", "--csv"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    assert!(output.stderr.is_empty());
}
