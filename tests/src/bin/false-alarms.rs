//! Counts false alarms of the protection over random drives and moves: see `arso_tests::false_alarms`.

use arso_tests::false_alarms::moves;
use clap::Parser;
use std::process::ExitCode;

/// Count the false alarms of healthy drives.
#[derive(Debug, Parser)]
struct Cli {
    /// Random drives.
    #[arg(long, default_value_t = 300)]
    drives: u64,
    /// Moves of each.
    #[arg(long, default_value_t = 34)]
    moves: usize,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let mut stopped = 0;
    for drive in 0..cli.drives {
        for alarm in moves(drive, cli.moves) {
            println!("{alarm}");
            stopped += 1;
        }
    }
    let made = cli.drives * cli.moves as u64;
    println!(
        "{stopped} false alarms in {made} moves of {} drives",
        cli.drives
    );
    ExitCode::from(u8::from(stopped > 0))
}
