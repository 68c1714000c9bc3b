//! `host-sim sweep`: every row is what `simulate` says of the same drive and plant; threads, shards and kills
//! leave no trace in the file; what does not belong together is not merged.

mod files;

use crate::common::{host_sim, ran};
use files::{Row, rows};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// One load on a soft spring: cheap to design and to simulate.
const DRIVE: &str = r#"
[actuator]
mass = 0.5
force_constant = 5.0
current_limit = 2.0
[encoder]
resolution = 1e-5
counter_bits = 16
[[load]]
mass = 0.3
stiffness = 40.0
damping = 0.2
[control]
sample_time = 10e-3
disturbance_cutoff = 60.0
reaction_force_cutoff = 60.0
observer = "anchored"
[cost]
current = 1.0
position = [20.0, 20.0]
velocity = [1.0, 1.0]
[move]
velocity = 0.1
table = 2000
"#;

/// Of the step that the experiments of `simulate` make, and of its time.
const HEAD: &str = "seed = 3\ndrive = \"drive.toml\"\nstep = 0.03\nduration = 1.2\n";

/// A folder with a drive and a sweep in it.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new(sweep: &str) -> Self {
        let bench = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        bench.write("drive.toml", DRIVE);
        bench.write("sweep.toml", &format!("{HEAD}{sweep}"));
        bench
    }

    /// Samples that differ in three respects, under both laws.
    fn drawn(samples: u32) -> Self {
        Self::new(&format!(
            "samples = {samples}\nlaws = [\"drive\", \"full state\"]\n[vary]\n\
             \"plant.load.*.stiffness\" = {{ uniform = [0.7, 1.3], relative = true }}\n\
             \"plant.load.1.mass\" = {{ normal = [0.3, 0.03], within = [0.2, 0.5] }}\n\
             \"plant.friction.coulomb\" = {{ choice = [0.0, 0.05] }}\n"
        ))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn command(&self, arguments: &[&str]) -> assert_cmd::Command {
        let mut command = host_sim();
        command.current_dir(self.folder.path()).args(arguments);
        command
    }

    fn sweep(&self, out: &str, more: &[&str]) -> Vec<u8> {
        let arguments = [&["sweep", "sweep.toml", "--out", out], more].concat();
        let (code, _, error) = ran(&mut self.command(&arguments));
        assert_eq!((code, error), (0, String::new()));
        std::fs::read(self.path(out)).unwrap()
    }

    fn refused(&self, arguments: &[&str]) -> String {
        let (code, text, error) = ran(&mut self.command(arguments));
        assert_eq!((code, text), (2, String::new()), "{error}");
        assert_eq!(error.trim_end().lines().count(), 1, "{error}");
        error
    }

    /// Begins a sweep and waits until some of it is kept that was not before.
    fn begin(&self, out: &str) -> Child {
        let before = self.kept(out);
        let child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
            .current_dir(self.folder.path())
            .args(["sweep", "sweep.toml", "--out", out])
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        self.wait(out, before);
        child
    }

    /// Waits until more chunks are kept than so many.
    fn wait(&self, out: &str, before: usize) {
        let until = Instant::now() + Duration::from_secs(60);
        while self.kept(out) <= before {
            assert!(Instant::now() < until, "nothing is kept");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// How many chunks are kept.
    fn kept(&self, out: &str) -> usize {
        let folder = std::fs::read_dir(self.path(&format!("{out}.parts")));
        let names = folder.into_iter().flatten().flatten();
        let whole = names.filter(|entry| !entry.file_name().to_string_lossy().starts_with('.'));
        whole.count()
    }
}

/// The figures of `simulate` for the step, under the core and with the true state.
fn simulated(bench: &Bench, drive: &str, plant: &str) -> [Value; 2] {
    bench.write("one-drive.toml", drive);
    bench.write("one-plant.toml", plant);
    let (code, text, error) = ran(&mut bench.command(&[
        "simulate",
        "one-drive.toml",
        "--plant",
        "one-plant.toml",
        "--scenario",
        "fig3",
        "--out",
        "plots",
        "--json",
    ]));
    assert_eq!((code, error), (0, String::new()));
    let json: Value = serde_json::from_str(&text).unwrap();
    [0, 1].map(|k| json["experiments"][k]["metrics"].clone())
}

/// A row's figures are those.
fn assert_same(row: &Row, expected: &Value) {
    for name in [
        "settling_time",
        "within_band_from",
        "within_tolerance_from",
        "overshoot",
        "peak_current",
        "offset",
    ] {
        assert_eq!(row.number(name), expected[name].as_f64(), "{name}");
    }
    let each = expected["residual_vibration"].as_array();
    let residual = |mass: usize| each.and_then(|each| each[mass].as_f64());
    assert_eq!(row.number("residual_vibration_actuator"), residual(0));
    assert_eq!(row.number("residual_vibration_load1"), residual(1));
    let largest = residual(0).into_iter().chain(residual(1)).reduce(f64::max);
    assert_eq!(row.number("residual_vibration"), largest);
    assert_eq!(row.text("end_state"), expected["end"]["state"].as_str());
}

#[test]
fn every_row_is_what_simulate_says_of_its_plant() {
    let bench = Bench::drawn(20);
    bench.sweep("all.parquet", &[]);
    let all = rows(&bench.path("all.parquet"));
    assert_eq!(all.len(), 40);
    for (k, row) in all.iter().enumerate() {
        assert_eq!(row.number("sample"), Some((k / 2) as f64));
        let stiffness = row.number("plant.load.*.stiffness").unwrap();
        let mass = row.number("plant.load.1.mass").unwrap();
        assert!((0.7..=1.3).contains(&stiffness) && (0.2..=0.5).contains(&mass));
    }
    for sample in [0, 13] {
        let pair = &all[2 * sample..2 * sample + 2];
        let value = |name: &str| pair[0].number(name).unwrap();
        let plant = DRIVE
            .replace(
                "= 40.0",
                &format!("= {}", 40.0 * value("plant.load.*.stiffness")),
            )
            .replace(
                "mass = 0.3",
                &format!("mass = {}", value("plant.load.1.mass")),
            );
        let coulomb = value("plant.friction.coulomb");
        let plant = format!("{plant}[friction]\ncoulomb = {coulomb}\n");
        let expected = simulated(&bench, DRIVE, &plant);
        assert_eq!(pair[0].text("law"), Some("drive"));
        assert_eq!(pair[1].text("law"), Some("full state"));
        assert_same(&pair[0], &expected[0]);
        assert_same(&pair[1], &expected[1]);
    }
}

/// A key of the drive is designed for anew, and without a plant file the plant is that drive; with one, it is not.
#[test]
fn keys_of_the_drive_are_designed_anew() {
    let grid = "laws = [\"drive\"]\n[vary]\n\
                \"drive.cost.current\" = { grid = [1.0, 4.0] }\n\
                \"drive.load.1.mass\" = { grid = [0.3, 0.4] }\n";
    let bench = Bench::new(grid);
    bench.sweep("own.parquet", &[]);
    bench.write(
        "sweep.toml",
        &format!("plant = \"drive.toml\"\n{HEAD}{grid}"),
    );
    bench.sweep("stated.parquet", &[]);
    let own = rows(&bench.path("own.parquet"));
    let stated = rows(&bench.path("stated.parquet"));
    assert_eq!((own.len(), stated.len()), (4, 4));
    for (own, stated) in own.iter().zip(&stated) {
        let value = |name: &str| own.number(name).unwrap();
        let drive = DRIVE
            .replace(
                "current = 1.0",
                &format!("current = {}", value("drive.cost.current")),
            )
            .replace(
                "mass = 0.3",
                &format!("mass = {}", value("drive.load.1.mass")),
            );
        assert_same(own, &simulated(&bench, &drive, &drive)[0]);
        assert_same(stated, &simulated(&bench, &drive, DRIVE)[0]);
    }
    assert_ne!(
        own[0].number("settling_time"),
        own[2].number("settling_time")
    );
}

/// A rival is the law of `compare`, tuned by the same search: on the plant as designed for, the same figures.
#[test]
fn rivals_are_those_of_the_comparison() {
    let bench = Bench::new("");
    // As long as the runs of the comparison: 15 periods of the slowest mode.
    let head = HEAD.replace("duration = 1.2", "duration = 6.45");
    let laws = "laws = [\"PD\", \"encoder filter\"]\nevaluations = 20\n";
    bench.write("sweep.toml", &format!("{head}{laws}"));
    bench.sweep("rivals.parquet", &[]);
    let (_, text, _) = ran(&mut bench.command(&[
        "compare",
        "drive.toml",
        "--evaluations",
        "20",
        "--plants",
        "0",
        "--json",
    ]));
    let comparison: Value = serde_json::from_str(&text).unwrap();
    let laws = comparison["laws"].as_array().unwrap();
    let found = rows(&bench.path("rivals.parquet"));
    assert_eq!(found.len(), 2);
    for row in found {
        let law = laws
            .iter()
            .find(|law| law["law"].as_str() == row.text("law"));
        let nominal = &law.unwrap()["outcomes"][0];
        assert_eq!(nominal["case"], "nominal");
        let metrics = &nominal["metrics"];
        let peak = metrics["peak_current"].as_f64();
        assert!(peak.is_some() && row.number("peak_current") == peak);
        assert_eq!(row.number("overshoot"), metrics["overshoot"].as_f64());
    }
}

#[test]
fn threads_shards_and_kills_leave_no_trace() {
    let bench = Bench::drawn(400);
    let whole = bench.sweep("whole.parquet", &[]);
    let mut one = bench.command(&["sweep", "sweep.toml", "--out", "one.parquet"]);
    assert_eq!(ran(one.env("RAYON_NUM_THREADS", "1")).0, 0);
    assert!(std::fs::read(bench.path("one.parquet")).unwrap() == whole);

    // In parts of unlike size, put together in any order.
    let parts = ["3.parquet", "1.parquet", "2.parquet"];
    for part in parts {
        let shard = format!("{}/3", &part[..1]);
        bench.sweep(part, &["--shard", &shard]);
    }
    let merge = ["sweep", "merge", "merged.parquet"];
    let (code, ..) = ran(&mut bench.command(&[&merge[..], &parts[..]].concat()));
    assert_eq!(code, 0);
    assert!(std::fs::read(bench.path("merged.parquet")).unwrap() == whole);

    // Killed, with two of the chunks damaged after that, one in a single bit; the output appears whole or not at all.
    let mut child = bench.begin("killed.parquet");
    bench.wait("killed.parquet", 1);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!bench.path("killed.parquet").exists());
    let folder = std::fs::read_dir(bench.path("killed.parquet.parts")).unwrap();
    let chunks = folder.flatten().map(|entry| entry.path());
    let chunks = chunks.filter(|path| path.extension().is_some_and(|e| e == "parquet"));
    let mut chunks: Vec<PathBuf> = chunks.collect();
    chunks.sort();
    let bytes = std::fs::read(&chunks[0]).unwrap();
    std::fs::write(&chunks[0], &bytes[..bytes.len() / 2]).unwrap();
    let mut bytes = std::fs::read(&chunks[1]).unwrap();
    let number = bytes.len() / 4;
    bytes[number] ^= 0x10;
    std::fs::write(&chunks[1], bytes).unwrap();
    assert!(bench.sweep("killed.parquet", &[]) == whole);
    assert_eq!(bench.kept("killed.parquet"), 0);
}

/// Ctrl-C says what is kept; what is kept once is not made again.
#[test]
fn ctrl_c_ends_tidily_and_what_is_kept_stays() {
    let bench = Bench::drawn(3000);
    let mut before = 0;
    for _ in 0..2 {
        let child = bench.begin("out.parquet");
        let pid = child.id().to_string();
        let sent = std::process::Command::new("kill")
            .args(["-INT", &pid])
            .status();
        assert!(sent.unwrap().success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        let error = String::from_utf8(output.stderr).unwrap();
        let kept = error
            .split("interrupted, ")
            .nth(1)
            .and_then(|rest| rest.split(' ').next());
        let kept: u64 = kept.and_then(|kept| kept.parse().ok()).expect(&error);
        assert!(error.contains("of 3000 samples are kept"), "{error}");
        assert!(
            kept >= before.max(150) && kept.is_multiple_of(150),
            "{error}"
        );
        assert_eq!(bench.kept("out.parquet") as u64, kept / 150);
        before = kept;
    }
}

#[test]
fn what_does_not_belong_together_is_not_merged() {
    let bench = Bench::drawn(6);
    for (out, shard) in [
        ("1.parquet", "1/3"),
        ("2.parquet", "2/3"),
        ("3.parquet", "3/3"),
        ("half.parquet", "2/2"),
    ] {
        bench.sweep(out, &["--shard", shard]);
    }
    std::fs::copy(bench.path("2.parquet"), bench.path("again.parquet")).unwrap();
    let other = std::fs::read_to_string(bench.path("sweep.toml")).unwrap();
    bench.write("sweep.toml", &other.replace("seed = 3", "seed = 4"));
    bench.sweep("other.parquet", &["--shard", "3/3"]);
    let bytes = std::fs::read(bench.path("3.parquet")).unwrap();
    std::fs::write(bench.path("cut.parquet"), &bytes[..bytes.len() - 9]).unwrap();
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 3] ^= 1;
    std::fs::write(bench.path("flipped.parquet"), flipped).unwrap();
    bench.write("whole.parquet", "what stood here");
    for (parts, sentence) in [
        (&["1.parquet", "2.parquet"][..], "1 of them are missing: 3"),
        (&["2.parquet"], "2 of them are missing: 1, 3"),
        (
            &["1.parquet", "2.parquet", "again.parquet"],
            "is part 2/3, and so is",
        ),
        (
            &["1.parquet", "2.parquet", "other.parquet"],
            "other.parquet: is of the sweep",
        ),
        (
            &["1.parquet", "half.parquet"],
            "is a part of 2, and 1.parquet 3",
        ),
        (
            &["1.parquet", "2.parquet", "cut.parquet"],
            "cut.parquet: is no whole Parquet file",
        ),
        (
            &["1.parquet", "2.parquet", "flipped.parquet"],
            "flipped.parquet: is damaged",
        ),
        (
            &["1.parquet", "sweep.toml"],
            "sweep.toml: is no whole Parquet file",
        ),
        (&["1.parquet", "none.parquet"], "cannot read none.parquet"),
    ] {
        let arguments = [&["sweep", "merge", "whole.parquet"], parts].concat();
        let error = bench.refused(&arguments);
        assert!(error.contains(sentence), "{parts:?}: {error}");
    }
    let stands = std::fs::read_to_string(bench.path("whole.parquet")).unwrap();
    assert_eq!(stands, "what stood here");
    // Not even into one of them.
    let part = std::fs::read(bench.path("1.parquet")).unwrap();
    let all = ["1.parquet", "2.parquet", "3.parquet"];
    let error = bench.refused(&[&["sweep", "merge", "./1.parquet"], &all[..]].concat());
    assert!(error.contains("that is one of its parts"), "{error}");
    assert_eq!(std::fs::read(bench.path("1.parquet")).unwrap(), part);
}

/// Before anything is run, which here would take for ever.
#[test]
fn where_the_figures_cannot_go_is_said_before_the_work() {
    let bench = Bench::drawn(100_000_000);
    for input in ["sweep.toml", "./drive.toml"] {
        let before = std::fs::read(bench.path(input)).unwrap();
        let error = bench.refused(&["sweep", "sweep.toml", "--out", input]);
        assert!(error.contains("the sweep is read from there"), "{error}");
        assert_eq!(std::fs::read(bench.path(input)).unwrap(), before);
    }
    std::fs::create_dir(bench.path("folder")).unwrap();
    let mut command = bench.command(&["sweep", "sweep.toml", "--out", "folder"]);
    let (code, text, error) = ran(&mut command);
    assert_eq!((code, text.as_str()), (1, ""));
    assert!(error.contains("cannot write folder"), "{error}");
    assert!(!bench.path("folder.parts").exists());
}

/// A force that begins when the experiment is over is no part of it, under any law.
#[test]
fn forces_after_the_experiment_change_no_figure() {
    let bench = Bench::new("laws = [\"drive\", \"PD\"]\nevaluations = 20\n");
    let without = bench.sweep("without.parquet", &[]);
    let force = "[[force]]\nmass = 0\nstart = 2.0\nduration = 1.0\nnewton = 2.0\n";
    let plant = DRIVE.split("[control]").next().unwrap();
    let sweep = std::fs::read_to_string(bench.path("sweep.toml")).unwrap();
    bench.write("sweep.toml", &format!("plant = \"plant.toml\"\n{sweep}"));
    bench.write("plant.toml", &format!("{plant}{force}"));
    let with = bench.sweep("with.parquet", &[]);
    // What they were made of differs, and is in the files.
    assert_ne!(without, with);
    let [without, with] = ["without.parquet", "with.parquet"].map(|name| rows(&bench.path(name)));
    for (without, with) in without.iter().zip(&with) {
        for figure in [
            "settling_time",
            "within_tolerance_from",
            "overshoot",
            "peak_current",
        ] {
            assert_eq!(without.number(figure), with.number(figure), "{figure}");
        }
    }
}

#[test]
fn what_cannot_be_swept_is_said_with_file_and_key() {
    let bench = Bench::new("");
    let laws = "laws = [\"drive\"]\n";
    for (text, sentence) in [
        (
            format!("{HEAD}laws = [\"PDD\"]"),
            "sweep.toml:5: law \"PDD\": must be one of \"drive\", \"full state\", ",
        ),
        (format!("{HEAD}laws = []"), "must name one law at least"),
        (format!("{HEAD}laws = [\"drive\", \"drive\"]"), "twice"),
        (
            format!("{HEAD}{laws}samples = 0"),
            "samples = 0: must be from 1",
        ),
        (
            format!("{HEAD}{laws}sample = 1"),
            "sweep.toml:6: unknown field `sample`",
        ),
        (format!("{HEAD}{laws}move = 0.1"), "only one of the two"),
        (
            HEAD.replace("step = 0.03", "step = 0.0") + laws,
            "step = 0: must be one count",
        ),
        (
            HEAD.replace("1.2", "0.01") + laws,
            "duration = 0.01: must be two control periods of 0.01 s at least",
        ),
        (
            HEAD.replace("drive.toml", "none.toml") + laws,
            "cannot read none.toml",
        ),
        (
            format!("{HEAD}{laws}[vary]\n\"plant.load.1.mas\" = {{ uniform = [1.0, 2.0] }}"),
            "sweep.toml:7: vary.\"plant.load.1.mas\": unknown field `mas`",
        ),
    ] {
        bench.write("sweep.toml", &text);
        let error = bench.refused(&["sweep", "sweep.toml"]);
        assert!(error.contains(sentence), "{text}: {error}");
    }
}

/// A sample that no plant can be has a row all the same, which says why, and the others theirs.
#[test]
fn what_fails_has_a_row_that_says_why() {
    let bench = Bench::new(
        "samples = 30\nlaws = [\"drive\"]\n[vary]\n\"plant.load.1.mass\" = { normal = [0.3, 0.3] }\n",
    );
    let (code, text, _) =
        ran(&mut bench.command(&["sweep", "sweep.toml", "--out", "out.parquet", "--json"]));
    assert_eq!(code, 0);
    let all = rows(&bench.path("out.parquet"));
    assert_eq!(all.len(), 30);
    let mut failed = 0;
    for row in &all {
        let negative = row.number("plant.load.1.mass").unwrap() < 1e-9;
        assert_eq!(row.text("failure").is_some(), negative);
        assert_eq!(row.number("peak_current").is_none(), negative);
        failed += u64::from(negative);
    }
    assert!(failed > 0);
    let summary: Value = serde_json::from_str(&text).unwrap();
    let law = &summary["laws"][0];
    assert_eq!(law["failed"].as_u64(), Some(failed));
    assert!(law["failure"].as_str().unwrap().contains("mass = -"));
    let settled = all
        .iter()
        .filter(|row| row.number("settling_time").is_some());
    assert_eq!(
        law["not_settled"].as_u64(),
        Some(30 - settled.count() as u64)
    );
}

/// The example that is shipped reads, whatever its number of samples.
#[test]
fn the_example_runs() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("sweeps/wide.toml");
    let text = std::fs::read_to_string(example).unwrap();
    let bench = Bench::new("");
    bench.write("sweep.toml", &text.replace("samples = 1000", "samples = 2"));
    bench.sweep("wide.parquet", &[]);
    let all = rows(&bench.path("wide.parquet"));
    assert_eq!(all.len(), 4);
    assert!(all.iter().all(|row| row.text("failure").is_none()));
}
