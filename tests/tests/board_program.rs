//! The program around the virtual board, as the user runs it: what a failed run and a foreign firmware end
//! with.
#![cfg(feature = "virtual-board")]

use std::process::Command;

/// Exit code and standard error of a run of the release ELF.
fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let elf = arso_tests::target_binary("arso-firmware");
    let output = Command::new(env!("CARGO_BIN_EXE_virtual-board"))
        .arg(elf)
        .args(arguments)
        .output()
        .unwrap();
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn a_run_that_fails_says_so() {
    let directory = std::env::temp_dir().join(format!("board-program-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    let drive = include_str!("../../host-sim/drive.toml");
    let file = |name: &str, text: &str| {
        let path = directory.join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let (code, error) = run(&["--scenario", "fig3"]);
    assert_eq!(code, Some(0), "{error}");

    let other = file("other.toml", &drive.replace("300.0", "310.0"));
    let (code, error) = run(&["--drive", &other]);
    assert_eq!(code, Some(2), "{error}");
    assert!(
        error.contains("the firmware is not this drive's"),
        "{error}"
    );
    // What it did on a machine that is not its own is not shown.
    assert_eq!(error.lines().count(), 1, "{error}");

    let rotary = drive.replacen("[actuator]", "kind = \"rotary\"\n[actuator]", 1);
    let (code, error) = run(&["--plant", &file("rotary.toml", &rotary)]);
    assert_eq!(code, Some(2), "{error}");
    assert!(error.contains("must be of the same kind"), "{error}");

    // A weight on the load: it ends where the springs let it.
    let force = "[[force]]\nmass = 3\nstart = 0.001\nduration = 100.0\nnewton = 0.3\n";
    let pulled = file("pulled.toml", &format!("{drive}\n{force}"));
    let (code, error) = run(&["--plant", &pulled]);
    assert_eq!(code, Some(1), "{error}");
    assert!(
        error.contains("from its target") || error.contains("fault"),
        "{error}"
    );
    std::fs::remove_dir_all(&directory).unwrap();
}
