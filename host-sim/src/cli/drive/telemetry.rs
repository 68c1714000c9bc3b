//! `host-sim drive telemetry`.

use super::files::{CsvFile, McapFile};
use super::motion::require_duration;
use super::{Ends, go_on};
use crate::error::{Error, Result};
use crate::link::passed;
use crate::output::Unfinished;
use crate::simulate::corridor::Record;
use clap::Args;
use std::io::{ErrorKind, Stdout, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Read what the drive measures, estimates and commands, one record for each control period.
///
/// As CSV on standard output, until Ctrl-C or for some time; it is what `identify` and `learn` read. For example
/// `host-sim drive --port /dev/ttyACM0 telemetry --for 2 --csv log.csv`. With --json a record is a line. What the
/// line cannot take is missed, and counted on standard error. With --mcap alone the records go to that file, which
/// `PlotJuggler` and Foxglove open: `... telemetry --for 10 --mcap run.mcap`.
#[derive(Debug, Args)]
pub(super) struct TelemetryCommand {
    /// Of every so manieth control period.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    every: u16,
    /// For how long, by the drive's clock.
    #[arg(long = "for", value_name = "SECONDS")]
    duration: Option<f64>,
    /// Where the CSV goes; the file is there at the end.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Where the records go as MCAP; the file is there at the end.
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
}

/// How long a record is waited for before Ctrl-C is looked for.
const GLANCE: Duration = Duration::from_millis(50);
/// How long none may come, s, and in records.
const SILENCE: (f64, f64) = (1.0, 3.0);

impl TelemetryCommand {
    pub(super) fn check(&self, json: bool) -> Result<()> {
        if json && self.csv.is_some() {
            return Err(Error::Usage("--json and --csv exclude each other".into()));
        }
        require_duration(self.duration)
    }

    pub(super) fn run(&self, ends: &mut Ends) -> Result<()> {
        let place = Path::new("standard output");
        let mut into = match &self.csv {
            Some(path) => Output::File(Box::new(CsvFile::create(path)?)),
            None if ends.json => Output::Lines,
            None if self.mcap.is_some() => Output::Nowhere,
            None => Output::Csv(Box::new(CsvFile::new(std::io::stdout(), place))),
        };
        let mcap = self.mcap.as_deref().map(McapFile::create);
        let mut mcap = mcap.transpose()?;
        ends.drive.subscribe(self.every)?;
        let taken = self.take(ends, |ends, record, time| {
            if let Some(mcap) = &mut mcap {
                mcap.add(ends.drive.origin(), record)?;
            }
            let added = match &mut into {
                Output::Csv(csv) => csv.add(ends.drive.origin(), record, time),
                Output::File(csv) => csv.add(ends.drive.origin(), record, time),
                Output::Lines => line(record).map_err(Error::write(place)),
                Output::Nowhere => Ok(()),
            };
            match added {
                // Its reader has gone away.
                Err(Error::Write { source, .. }) if source.kind() == ErrorKind::BrokenPipe => {
                    Ok(false)
                }
                added => added.map(|()| true),
            }
        });
        // What was recorded is kept, whatever happened.
        let csv = match into {
            Output::File(csv) => csv.finish(),
            _ => Ok(()),
        };
        let finished = mcap.map_or(Ok(()), McapFile::finish).and(csv);
        let (taken, missed) = taken?;
        finished?;
        ends.drive.subscribe(0)?;
        if missed > 0 {
            eprintln!("warning: {missed} records were missed, and {taken} were taken");
        } else if !ends.quiet {
            eprintln!("{taken} records, none was missed");
        }
        Ok(())
    }

    /// Gives away each record with its time from the first one on, s, for as long as they are wanted. How many
    /// there were, and how many were missed.
    fn take(
        &self,
        ends: &mut Ends,
        mut give: impl FnMut(&Ends, &Record, f64) -> Result<bool>,
    ) -> Result<(u64, u64)> {
        let period = ends.drive.origin().period;
        let patience = SILENCE.0.max(SILENCE.1 * f64::from(self.every) * period);
        let (mut taken, mut missed) = (0_u64, 0_u64);
        // Periods since the first record, and the period of the last one.
        let mut so_far = None;
        let mut silent = 0.0;
        while go_on() {
            let Some(record) = ends.drive.record(GLANCE)? else {
                silent += GLANCE.as_secs_f64();
                if silent > patience {
                    let why = format!("no telemetry has come for {patience:.1} s");
                    return Err(Error::Link(why));
                }
                continue;
            };
            silent = 0.0;
            let periods = so_far.map_or(0, |(periods, last)| {
                // The time of a drive that was reset goes on.
                let gap = u64::from(passed(last, record.period).unwrap_or(1));
                missed += (gap / u64::from(self.every)).saturating_sub(1);
                periods + gap
            });
            so_far = Some((periods, record.period));
            let time = periods as f64 * period;
            // Half a period is more than what rounding makes of it.
            let over = |duration| time > duration - 0.5 * period;
            if self.duration.is_some_and(over) || !give(ends, &record, time)? {
                break;
            }
            taken += 1;
        }
        Ok((taken, missed))
    }
}

/// Where records go.
enum Output {
    Csv(Box<CsvFile<Stdout>>),
    File(Box<CsvFile<Unfinished>>),
    /// Standard output, a JSON object in each line.
    Lines,
    Nowhere,
}

fn line(record: &Record) -> std::io::Result<()> {
    let text = serde_json::to_string(record)?;
    let mut out = std::io::stdout();
    writeln!(out, "{text}")?;
    out.flush()
}
