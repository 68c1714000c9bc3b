//! The program under test, and what a run of it came to.

use assert_cmd::Command;

/// The program, without arguments.
pub fn host_sim() -> Command {
    Command::new(assert_cmd::cargo::cargo_bin!("host-sim"))
}

/// Runs and returns exit code, standard output, standard error.
pub fn ran(command: &mut Command) -> (i32, String, String) {
    let output = command.output().unwrap();
    (
        output.status.code().unwrap(),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}
