//! `host-sim drive watch`: the drive in the terminal.

mod charts;
mod draw;
mod model;
#[cfg(test)]
mod tests;
mod watching;

use super::files::{CsvFile, McapFile};
use super::{Ends, go_on};
use crate::capture::Origin;
use crate::error::{Error, Result};
use crate::output::Unfinished;
use crate::simulate::corridor::Record;
use clap::Args;
use model::{Model, Subject};
use std::io::IsTerminal;
use std::path::PathBuf;
use watching::watch;

/// Show what the drive is doing, in the terminal, as it goes on.
///
/// State, masses, current, curves of the last 10 s, faults; for example
/// `host-sim drive --port /dev/ttyACM0 watch --mcap run.mcap`. Keys: q ends it and leaves the drive as it is, s brings
/// the machine to rest. What it shows can be recorded meanwhile; MCAP is
/// what Foxglove and `PlotJuggler` open.
#[derive(Debug, Args)]
pub(super) struct WatchCommand {
    /// A record of every so manieth control period; 100 records a second without it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    every: Option<u16>,
    /// Where the records go as CSV; the file is there at the end.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Where the records go as MCAP; the file is there at the end.
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
}

/// Records a second, unless another number is asked for.
const RATE: f64 = 100.0;
impl WatchCommand {
    pub(super) fn check(json: bool) -> Result<()> {
        if json {
            let why = "--json and the command watch exclude each other: use telemetry --json";
            return Err(Error::Usage(why.into()));
        }
        if !std::io::stdout().is_terminal() {
            let why =
                "watch draws in a terminal, and standard output is none: use telemetry to record";
            return Err(Error::Usage(why.into()));
        }
        Ok(())
    }

    /// * `port`: where the drive is
    pub(super) fn run(&self, ends: &mut Ends, port: &str) -> Result<()> {
        let drive = &mut ends.drive;
        let period = drive.origin().period;
        let every = (1.0 / (RATE * period)).round();
        let every = every.clamp(1.0, f64::from(u16::MAX)) as u16;
        let mut files = Files {
            csv: self.csv.as_deref().map(CsvFile::create).transpose()?,
            mcap: self.mcap.as_deref().map(McapFile::create).transpose()?,
        };
        let mut model = Model::new(Subject {
            port: port.to_owned(),
            firmware: drive.introduction().firmware.to_string(),
            origin: *drive.origin(),
            resolution: drive.resolution(),
            every: self.every.unwrap_or(every),
        });
        let watched = watch(drive, &mut model, &mut files);
        // What was recorded is kept, whatever happened.
        let csv = files.csv.map_or(Ok(()), CsvFile::finish);
        let finished = files.mcap.map_or(Ok(()), McapFile::finish).and(csv);
        watched?;
        finished?;
        if !ends.quiet {
            let Model { taken, missed, .. } = model;
            eprintln!("{taken} records, {missed} were missed");
        }
        Ok(())
    }
}

/// Where records go beside the terminal.
struct Files {
    csv: Option<CsvFile<Unfinished>>,
    mcap: Option<McapFile>,
}

impl Files {
    /// * `time`: from the first record on, s
    fn add(&mut self, origin: &Origin, record: &Record, time: f64) -> Result<()> {
        if let Some(csv) = &mut self.csv {
            csv.add(origin, record, time)?;
        }
        if let Some(mcap) = &mut self.mcap {
            mcap.add(origin, record)?;
        }
        Ok(())
    }
}
