//! `host-sim`: see [`host_sim::cli`] for the command line.
#![forbid(unsafe_code)]

use host_sim::cli::{Cli, sentence};
use std::ffi::OsString;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let cli = Cli::read(&arguments).unwrap_or_else(|error| error.exit());
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", sentence(&error));
            ExitCode::from(error.exit_code())
        }
    }
}
