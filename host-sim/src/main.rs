//! `host-sim`: see [`host_sim::cli`] for the command line.
#![forbid(unsafe_code)]

use clap::Parser;
use host_sim::cli::{Cli, sentence};
use std::process::ExitCode;

fn main() -> ExitCode {
    match Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", sentence(&error));
            ExitCode::from(error.exit_code())
        }
    }
}
