//! `host-sim excite` as the user runs it: exit codes, messages, files.

use crate::common::{host_sim, ran};
use std::fs;
use std::path::Path;

const DRIVE: &str = include_str!("../drive.toml");

/// Runs `excite` and returns exit code, standard output, standard error.
fn excite(arguments: &[&str], out: &Path) -> (i32, String, String) {
    let out = ["--out", out.to_str().unwrap()];
    ran(host_sim().arg("excite").args(arguments).args(out))
}

#[test]
fn summary_csv_and_source_are_written() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("a/b");
    let rust = directory.path().join("excitation.rs");
    let (code, text, error) = excite(&["--rust", rust.to_str().unwrap()], &out);
    assert_eq!((code, error.as_str()), (0, ""));
    for expected in [
        "drive: embedded drive.toml",
        "multisine, 54 lines from 2.441 to 54.199 Hz",
        "4 x 2.048 s = 8.192 s, 2048 control periods each",
        "0.500 A peak",
        "A rms",
        "predicted travel",
        "predicted stretch",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    let source = fs::read_to_string(&rust).unwrap();
    assert!(source.starts_with("//! Excitation of the drive. GENERATED from embedded drive.toml"));
    let csv = fs::read_to_string(out.join("excitation.csv")).unwrap();
    let mut rows = csv::Reader::from_reader(csv.as_bytes());
    assert_eq!(rows.headers().unwrap(), vec!["time[s]", "current[A]"]);
    let rows: Vec<(f64, f64)> = rows.deserialize().collect::<Result<_, _>>().unwrap();
    assert_eq!(rows.len(), 4 * 2048);
    assert_eq!((rows[0].0, rows[8191].0), (0.0, 8.191));
    assert!(rows.iter().all(|(_, current)| current.abs() <= 0.5 + 1e-6));
    assert!((0..2048).all(|k| rows[k].1 == rows[k + 3 * 2048].1));

    // The same on standard output, and no files.
    let empty = directory.path().join("empty");
    let (code, text, error) = excite(&["--csv"], &empty);
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(text == csv && !empty.exists());
}

#[test]
fn every_option_is_obeyed() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = [
        "--kind",
        "chirp",
        "--current",
        "0.2",
        "--from",
        "10",
        "--to",
        "40",
        "--period",
        "1",
        "--repeat",
        "7",
    ];
    let (code, text, error) = excite(&arguments, directory.path());
    assert_eq!((code, error.as_str()), (0, ""));
    for expected in [
        "chirp, 15 lines from 11.000 to 39.000 Hz",
        "7 x 1.000 s = 7.000 s, 1000 control periods each",
        "0.200 A peak, 0.141 A rms",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    // Less current where the travel does not allow it.
    let (code, text, error) = excite(&["--travel", "0.02"], directory.path());
    assert_eq!(code, 0);
    assert!(text.contains("amplifier off beyond 20.000 mm"), "{text}");
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(
        error.starts_with("warning: the travel of 0.02 m allows 0.1")
            && error.ends_with(" A instead of 0.500 A\n"),
        "{error}"
    );
}

/// The words of a rotary drive, and the name of its file.
#[test]
fn a_rotary_drive_is_told_in_its_units() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("rotary.toml");
    fs::write(&path, format!("kind = \"rotary\"\n{DRIVE}")).unwrap();
    let rust = directory.path().join("excitation.rs");
    let arguments = [path.to_str().unwrap(), "--rust", rust.to_str().unwrap()];
    let (code, text, error) = excite(&arguments, directory.path());
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(text.starts_with("drive: rotary.toml\n"), "{text}");
    assert!(text.contains(" mrad ") && !text.contains(" mm "), "{text}");
    let source = fs::read_to_string(&rust).unwrap();
    assert!(source.contains("GENERATED from rotary.toml") && source.contains(", // rad\n"));
}

#[test]
fn what_cannot_be_played_gets_one_sentence() {
    let directory = tempfile::tempdir().unwrap();
    for (arguments, sentence) in [
        (
            &["--current", "3"][..],
            "--current 3: must be above 0 and at most the current limit of 2 A",
        ),
        (&["--current", "nan"], "--current NaN: must be above 0"),
        (&["--current", "-1"], "--current -1: must be above 0"),
        (
            &["--current", "0.005"],
            "--current 0.005: must be 10 steps of the current output of 0.001 A at least",
        ),
        (&["--travel", "0"], "--travel 0: must be from 1e-9 to 1e9 m"),
        (&["--travel", "inf"], "--travel inf: must be from"),
        (
            &["--travel", "1e-4"],
            "--travel 0.0001: leaves less than 10 steps of the current output",
        ),
        (&["--from", "0"], "--from 0: must be above 0 Hz"),
        (&["--from", "nan"], "--from NaN: must be above 0 Hz"),
        (
            &["--from", "60"],
            "the band from 60.000 to 54.382 Hz is empty: --from must be below --to",
        ),
        (
            &["--from", "20", "--to", "20"],
            "the band from 20.000 to 20.000 Hz is empty",
        ),
        (
            &["--to", "401"],
            "--to 401: must be above 0 and at most 0.4 / sample_time = 400 Hz",
        ),
        (&["--to", "inf"], "--to inf: must be above 0"),
        (
            &["--from", "0.1"],
            "--from 0.1: must be 0.2000 Hz at least, 4 of its periods must fit into 20000",
        ),
        (
            &["--period", "0.1"],
            "--period 0.1: must be from one period of the lower end of the band, 0.4189 s, to 20000 \
             control periods, 20.00 s",
        ),
        (&["--period", "20.1"], "--period 20.1: must be from"),
        (&["--period", "nan"], "--period NaN: must be from"),
        (
            &["--from", "10.1", "--to", "10.2", "--period", "0.5"],
            "--period 0.5: no odd multiple of its inverse lies from 10.10 to 10.20 Hz, make it longer",
        ),
        (
            &["--repeat", "489"],
            "--repeat 489: makes 1001472 control periods, at most 1000000 can be played",
        ),
        (&["/nonexistent.toml"], "cannot read /nonexistent.toml"),
    ] {
        let (code, out, error) = excite(arguments, directory.path());
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}");
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(error.starts_with(&format!("error: {sentence}")), "{error}");
    }
    for arguments in [
        &["--repeat", "0"][..],
        &["--repeat", "70000"],
        &["--kind", "noise"],
        &["--current", "much"],
    ] {
        let (code, out, error) = excite(arguments, directory.path());
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}");
        assert!(error.starts_with("error: invalid value"), "{error}");
    }
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
}

/// The drive need not be controllable yet: no gains exist for it, and it can be identified.
#[test]
fn a_drive_without_gains_can_be_excited() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("drive.toml");
    fs::write(&path, DRIVE.replace("stiffness = 300.0", "stiffness = 1e6")).unwrap();
    let arguments = [path.to_str().unwrap(), "--from", "10"];
    let (code, text, error) = excite(&arguments, directory.path());
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(
        text.contains(" to 400.000 Hz") || text.contains(" to 399."),
        "{text}"
    );
}
