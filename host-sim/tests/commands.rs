//! The command line as a whole: one way to name a drive, options that every command takes, what a shell and an
//! editor need, and plots of a size that can be opened.

use crate::common::{host_sim, ran};
use std::fs;
use std::path::Path;

/// Runs and returns exit code, standard output, standard error.
fn run(arguments: &[&str]) -> (i32, String, String) {
    ran(host_sim().args(arguments))
}

fn own_drive() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("drive.toml");
    path.to_str().unwrap().to_owned()
}

/// Positional or `--drive`, but not both.
#[test]
fn a_drive_is_named_in_one_way_everywhere() {
    let drive = own_drive();
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    for command in [
        &["design"][..],
        &["bound"],
        &["simulate", "--duration", "0.1", "--out", out],
        &["excite", "--out", out],
    ] {
        let with = |arguments: &[&str]| run(&[command, arguments].concat());
        let positional = with(&[&drive]);
        assert_eq!(positional.0, 0, "{positional:?}");
        assert_eq!(with(&["--drive", &drive]), positional);
        assert_eq!(with(&[&drive, "--drive", &drive]).0, 2);
    }
    for command in ["compare", "moves", "capture", "identify", "learn"] {
        let (code, help, _) = run(&[command, "--help"]);
        assert!(code == 0 && help.contains("--drive <DRIVE.toml>"), "{help}");
    }
}

#[test]
fn quiet_is_quiet_and_files_are_written() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    for command in [
        &["simulate", "--scenario", "fig3", "--out", out][..],
        &["excite", "--out", out],
        &["design"],
        &["bound"],
        &["paper"],
        &["man", out],
    ] {
        let quiet = run(&[command, &["--quiet"]].concat());
        assert_eq!(quiet, (0, String::new(), String::new()), "{command:?}");
    }
    for name in [
        "fig3.svg",
        "fig3.csv",
        "excitation.csv",
        "host-sim.1",
        "host-sim-excite.1",
        "host-sim-drive-move.1",
    ] {
        assert!(directory.path().join(name).exists(), "{name}");
    }
    let (code, text, _) = run(&["excite", "--json", "--out", out]);
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, &value["signal"]), (0, &"multisine".into()));
}

#[test]
fn a_misspelt_command_is_named() {
    for arguments in [
        &["simulte", "x.toml"][..],
        &["simulte"],
        &["desing", "--json"],
    ] {
        let (code, out, error) = run(arguments);
        assert_eq!((code, out.as_str()), (2, ""));
        assert!(error.contains("did you mean"), "{error}");
        assert!(
            error.contains("'simulate'") || error.contains("'design'"),
            "{error}"
        );
    }
    let (_, _, error) = run(&["missing.toml"]);
    assert!(!error.contains("did you mean"), "{error}");
}

#[test]
fn a_shell_and_an_editor_are_served() {
    for shell in ["bash", "zsh", "fish"] {
        let (code, text, _) = run(&["completions", shell]);
        assert!(code == 0 && text.contains("excite"), "{shell}");
    }
    let (code, text, _) = run(&["schema"]);
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(code, 0);
    let mass = &value["$defs"]["RawActuator"]["properties"]["mass"];
    assert!(
        mass["description"].as_str().unwrap().starts_with("kg"),
        "{mass}"
    );
    assert!(run(&["schema", "--plant"]).1.contains("RawForce"));
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    assert_eq!(run(&["man", out]).0, 0);
    let page = fs::read_to_string(directory.path().join("host-sim-identify.1")).unwrap();
    assert!(
        page.contains(".TH host\\-sim-identify") || page.contains(".TH host-sim-identify"),
        "{page}"
    );
}

/// Half a minute of motion is drawn with no more points than can be seen.
#[test]
fn a_long_run_is_a_small_plot() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    let plot = directory.path().join("excite.svg");
    let arguments = [
        "simulate",
        "--scenario",
        "fig3",
        "--duration",
        "30",
        "--out",
        out,
    ];
    assert_eq!(run(&arguments).0, 0);
    let svg = fs::read_to_string(directory.path().join("fig3.svg")).unwrap();
    assert!(svg.len() < 2_000_000, "{}", svg.len());
    assert!(svg.contains("of 29.999 s"));
    let arguments = [
        "excite",
        "--repeat",
        "100",
        "--plot",
        plot.to_str().unwrap(),
        "--out",
        out,
    ];
    assert_eq!(run(&arguments).0, 0);
    let svg = fs::read_to_string(plot).unwrap();
    assert!(svg.len() < 2_000_000 && svg.contains("amplifier off beyond"));
    // A dot for each line that is played, and one in the legend.
    let (_, text, _) = run(&["excite", "--json", "--out", out]);
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let lines = value["lines"].as_u64().unwrap() as usize;
    assert_eq!(svg.matches("<circle").count(), 1 + lines);
}

/// One load has one phase portrait.
#[test]
fn no_panel_is_drawn_twice() {
    let directory = tempfile::tempdir().unwrap();
    let drive = fs::read_to_string(own_drive()).unwrap();
    let begin = drive.find("[[load]]").unwrap();
    let second = begin + 1 + drive[begin + 1..].find("[[load]]").unwrap();
    let control = drive.find("[control]").unwrap();
    let one = [&drive[..second], &drive[control..]].concat();
    let one = one.replace("225.0, 225.0, 225.0, 225.0", "225.0, 225.0");
    let one = one.replace("0.2, 0.2, 0.2, 0.2", "0.2, 0.2");
    let path = directory.path().join("one.toml");
    fs::write(&path, one).unwrap();
    let out = directory.path().to_str().unwrap();
    let (code, _, error) = run(&[
        "--drive",
        path.to_str().unwrap(),
        "--scenario",
        "fig3",
        "--out",
        out,
    ]);
    assert_eq!(code, 0, "{error}");
    let svg = fs::read_to_string(directory.path().join("fig3.svg")).unwrap();
    assert_eq!(svg.matches("phase portrait").count(), 1);
}

/// What takes long is said on a terminal, however few its steps are, and nowhere else.
#[cfg(target_os = "linux")]
#[test]
fn what_takes_long_says_so_on_a_terminal() {
    let directory = tempfile::tempdir().unwrap();
    let run = |quiet: &str| {
        let program = assert_cmd::cargo::cargo_bin!("host-sim")
            .display()
            .to_string();
        let command =
            format!("{program} simulate --scenario fig3 --csv --duration 500 {quiet} > /dev/null");
        let output = std::process::Command::new("script")
            .args(["-qec", &command, "/dev/null"])
            // Where no terminal is named, nothing is drawn.
            .env("TERM", "xterm")
            .current_dir(directory.path())
            .output()
            .unwrap();
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let shown = run("");
    assert!(shown.contains("0/1 fig3"), "{shown}");
    assert_eq!(run("--quiet"), "");
}
