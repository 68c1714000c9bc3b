//! Breaks everything that can break around a firmware ELF on the virtual drive board, and tells what it made
//! of it.

use arso_tests::campaign::report::Report;
use arso_tests::campaign::stage::Stage;
use arso_tests::campaign::workers::processors;
use arso_tests::campaign::{flips, summary};
use arso_tests::virtual_board::Stop;
use clap::Parser;
use host_sim::drive::Drive;
use host_sim::error::Error;
use host_sim::output::{print, write_file};
use std::path::PathBuf;
use std::process::ExitCode;

/// Runs every fault of the list at many instants of a planned move and at rest, on the firmware that is flashed,
/// unmodified. Exit code 1 if it ran away or could not be stopped in any run.
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    /// The firmware.
    #[arg(value_name = "FW.elf")]
    elf: PathBuf,
    /// Description of the drive the firmware was built for; the paper's rig when not given.
    #[arg(long, value_name = "DRIVE.toml")]
    drive: Option<PathBuf>,
    /// Instants in motion, and as many at rest.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..=90))]
    instants: u32,
    /// Only faults with this in their name.
    #[arg(long, value_name = "WORD", default_value = "")]
    only: String,
    /// Flip single bits of memory as well, this many, one in each run.
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    flips: u32,
    /// Threads, which change nothing but the time it takes; as many as processors when not given.
    #[arg(long, value_name = "COUNT")]
    threads: Option<usize>,
    /// Print every run as JSON instead of the table.
    #[arg(long)]
    json: bool,
    /// Write the table, as Markdown.
    #[arg(long, value_name = "PATH.md")]
    write: Option<PathBuf>,
}

fn main() -> ExitCode {
    match Cli::parse().run() {
        Ok(false) => ExitCode::SUCCESS,
        Ok(true) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

impl Cli {
    /// Whether the drive was dangerous.
    fn run(self) -> Result<bool, Error> {
        let elf = std::fs::read(&self.elf).map_err(Error::read(&self.elf))?;
        let drive = Drive::load(self.drive.as_deref())?;
        let stage = Stage::set(elf, drive, self.instants).map_err(|message| Error::Input {
            place: self.elf.display().to_string(),
            message,
        })?;
        let stopped = |stop: Stop| Error::Simulation(stop.to_string());
        let threads = self.threads.unwrap_or_else(processors);
        let faults = summary::faults_named(&self.only);
        let rows = summary::campaign(&stage, &faults, threads).map_err(stopped)?;
        let flips = flips::flips(&stage, self.flips, threads).map_err(stopped)?;
        let name = self.elf.file_name().unwrap_or_default().to_string_lossy();
        let report = Report {
            firmware: &name,
            instants: self.instants,
            rows: &rows,
            flips: &flips,
        };
        if let Some(path) = &self.write {
            write_file(path, report.markdown().as_bytes())?;
        }
        if self.json {
            print(&format!("{:#}\n", report.json()))?;
        } else {
            print(&report.markdown())?;
        }
        Ok(report.dangerous())
    }
}
