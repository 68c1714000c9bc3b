//! Random moves through the core, whole: see `arso_tests::move_campaign`.

use arso_tests::move_campaign::rest::{drives, plants};
use arso_tests::move_campaign::retargets::retargets;
use clap::Parser;
use std::process::ExitCode;

/// Count moves that ring, break a limit, hunt or hang.
#[derive(Debug, Parser)]
struct Cli {
    /// Random retargets, jogs and stops on the nominal plant.
    #[arg(long, default_value_t = 10_000)]
    requests: usize,
    /// Random drives with friction and coarse encoders.
    #[arg(long, default_value_t = 300)]
    drives: u64,
    /// Plants of the default drive with friction and model error.
    #[arg(long, default_value_t = 200)]
    plants: u64,
    /// What is drawn follows from this.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    println!("seed {}", cli.seed);
    let retargets = retargets(cli.requests, cli.seed);
    println!("nominal plant: {retargets}");
    let mut passed = retargets.passed();
    for (name, endings) in [
        ("random drives", drives(cli.drives, cli.seed)),
        (
            "default drive on random plants",
            plants(cli.plants, cli.seed),
        ),
    ] {
        println!("{name}: {endings}");
        passed &= endings.hunting() + endings.hanging() + endings.failed.len() == 0;
    }
    ExitCode::from(u8::from(!passed))
}
