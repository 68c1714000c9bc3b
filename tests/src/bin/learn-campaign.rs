//! One move teaches the drive, whole: see `arso_tests::learning`; and `arso_tests::coverage`.

use arso_tests::coverage::coverage;
use arso_tests::learning::{degradation, imperfections, lessons, wide};
use clap::Parser;
use host_sim::design::Design;
use host_sim::drive::{DEFAULT_DRIVE, Drive};
use host_sim::error::{Error, Result};
use std::path::PathBuf;
use std::process::ExitCode;

/// Count plants of which one move teaches the drive, and what a second then is.
#[derive(Debug, Parser)]
struct Cli {
    /// Drive file; the embedded one when not given.
    #[arg(long)]
    drive: Option<PathBuf>,
    /// Plants of the wide set.
    #[arg(long, default_value_t = 150)]
    plants: usize,
    /// Plants for each thing that the model lacks.
    #[arg(long, default_value_t = 30)]
    imperfect: usize,
    /// Of these things only those with this in their name.
    #[arg(long, default_value = "")]
    only: String,
    /// Drives drawn at random, whose figures are held against their intervals.
    #[arg(long, default_value_t = 200)]
    coverage: usize,
    /// Of these the first.
    #[arg(long, default_value_t = 0)]
    first: usize,
    /// m or rad.
    #[arg(long, default_value_t = 0.03)]
    distance: f64,
    /// What is drawn follows from this.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(passed) => ExitCode::from(u8::from(!passed)),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(cli: &Cli) -> Result<bool> {
    let text = match &cli.drive {
        None => DEFAULT_DRIVE.to_owned(),
        Some(path) => std::fs::read_to_string(path).map_err(Error::read(path))?,
    };
    let drive = Drive::load(cli.drive.as_deref())?;
    let design = Design::new(&drive)?;
    println!("seed {}", cli.seed);
    let mut passed = true;
    if cli.plants > 0 {
        let all = lessons(
            &design,
            &text,
            &wide(&drive, cli.plants, cli.seed),
            cli.distance,
        )?;
        print!("{all}");
        passed &= all.learned() == cli.plants;
    }
    if cli.imperfect > 0 {
        let plants = wide(&drive, cli.imperfect, cli.seed);
        let mut asked = imperfections();
        asked.retain(|one| one.name.contains(&cli.only));
        if asked.is_empty() {
            let all: Vec<_> = imperfections().iter().map(|one| one.name).collect();
            return Err(Error::Usage(format!(
                "--only {}: no such thing, there are: {}",
                cli.only,
                all.join("; ")
            )));
        }
        println!("| | right | refused | wrong |\n|---|---|---|---|");
        for imperfection in asked {
            let all = degradation(&design, &plants, cli.distance, &imperfection)?;
            println!(
                "| {} | {} | {} | {} |",
                imperfection.name,
                all.right,
                all.refused.len(),
                all.wrong.len()
            );
            for (remark, count) in &all.remarks {
                println!("    {count} x {remark}");
            }
            for refused in all.refused.iter().take(2) {
                println!("    refused: {refused}");
            }
            if !all.wrong.is_empty() {
                println!("    off by {:.3?}", all.wrong);
            }
            passed &= all.wrong.is_empty();
        }
    }
    if cli.coverage > 0 {
        let drives = cli.first..cli.first.saturating_add(cli.coverage);
        let all = coverage(drives, cli.seed, |one| println!("{one}"));
        print!("{all}");
        passed &= all.within_three(None) >= 0.98 && all.worst(None) <= 6.0;
    }
    Ok(passed)
}
