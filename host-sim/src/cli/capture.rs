//! `host-sim capture`: the drive's log as table, CSV and plot.

use super::drive_argument::DriveArgument;
use super::interrupt::{INTERRUPTED, catch_interrupt};
use super::progress::Progress;
use crate::capture::{Capture, Live, Origin, read_defmt, read_text};
use crate::design::Design;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::output::{print, write_file};
use crate::report::log;
use clap::Args;
use std::fs::File;
use std::io::Read;
use std::net::TcpStream;
use std::path::PathBuf;

/// Read the drive's log: raw defmt with --elf, else text as probe-rs prints it.
///
/// Control period and units are those that the drive names in its log; a drive file is compared with it, and
/// stands in where the log does not say. Ctrl-C ends the log with what has come.
#[derive(Debug, Args)]
pub(super) struct CaptureCommand {
    #[command(flatten)]
    drive: DriveArgument,
    /// The firmware that logs; the log is then a raw defmt stream.
    #[arg(long, value_name = "FW.elf")]
    elf: Option<PathBuf>,
    /// File or pipe with the log; standard input when neither this nor --tcp is given.
    #[arg(long, value_name = "FILE")]
    rtt: Option<PathBuf>,
    /// Server that streams the log, until it closes the connection or Ctrl-C.
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "rtt")]
    tcp: Option<String>,
    /// Where plot and CSV go.
    #[arg(long, value_name = "DIR", default_value = "target/host-sim")]
    out: PathBuf,
    /// Print what the table holds as JSON, SI units; plot and CSV are written all the same.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print the records as CSV and write no files.
    #[arg(long)]
    csv: bool,
}

impl CaptureCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        // What cannot be used is said before anything is waited for.
        let drive = self.drive.load()?;
        let expected = match self.drive.path() {
            None => None,
            Some(_) => Some(Origin::of(&Design::new(&drive)?)?),
        };
        let elf = match &self.elf {
            None => None,
            Some(path) => Some((
                path.display().to_string(),
                std::fs::read(path).map_err(Error::read(path))?,
            )),
        };
        let server = match &self.tcp {
            None => None,
            Some(address) => Some(TcpStream::connect(address).map_err(Error::read(address))?),
        };
        // What has come by then is the log.
        catch_interrupt()?;
        let progress = Progress::new(quiet, "log");
        let stream = progress.counting(self.stream(server)?);
        // Messages are shown as they come, the records at the end.
        let message = |text: &str| progress.say(text);
        let capture = match &elf {
            Some((name, elf)) => {
                // The decoder's own panics are counted as damaged frames, not shown.
                std::panic::set_hook(Box::new(|_| ()));
                let capture = read_defmt(elf, name, stream, message);
                let _ = std::panic::take_hook();
                capture?
            }
            None => read_text(stream, message)?,
        };
        drop(progress);
        if capture.records.is_empty() {
            let raw = if elf.is_none() && capture.malformed > 0 {
                "; a raw defmt stream needs the firmware that logged it, with --elf"
            } else {
                ""
            };
            return Err(Error::Capture(format!(
                "the log of {} bytes holds no control period ({} damaged frames){raw}",
                capture.bytes, capture.malformed
            )));
        }
        self.write(&capture, &drive, quiet)?;
        self.warn(&capture, expected.as_ref());
        Ok(())
    }

    /// The log, which ends at Ctrl-C whatever its source does.
    fn stream(&self, server: Option<TcpStream>) -> Result<Box<dyn Read>> {
        let live = match (&self.rtt, server) {
            (Some(path), _) => {
                // A pipe without a writer blocks when it is opened, a file says what is wrong with it.
                if path.metadata().map_err(Error::read(path))?.is_file() {
                    let file = File::open(path).map_err(Error::read(path))?;
                    Live::new(move || Ok(file), &INTERRUPTED)
                } else {
                    let path = path.clone();
                    Live::new(move || File::open(path), &INTERRUPTED)
                }
                .map_err(Error::read(path))?
            }
            (None, Some(server)) => {
                Live::new(move || Ok(server), &INTERRUPTED).map_err(Error::read("the server"))?
            }
            (None, None) => Live::new(|| Ok(std::io::stdin()), &INTERRUPTED)
                .map_err(Error::read("standard input"))?,
        };
        Ok(Box::new(live))
    }

    fn write(&self, capture: &Capture, drive: &Drive, quiet: bool) -> Result<()> {
        let origin = capture.origins.first();
        let (period, kind) = origin.map_or((drive.control.sample_time, drive.kind), |origin| {
            (origin.period, origin.kind)
        });
        let csv = log::csv(capture, period, kind)?;
        if self.csv {
            return print(&String::from_utf8_lossy(&csv));
        }
        write_file(&self.out.join("log.csv"), &csv)?;
        write_file(
            &self.out.join("log.svg"),
            log::plot(capture, period, kind)?.as_bytes(),
        )?;
        if self.json {
            return print(&format!("{:#}\n", log::json(capture, period, kind)));
        }
        if quiet {
            return Ok(());
        }
        let of = origin.map_or(
            format!("not said by the log; taken from {}", self.drive.shown()),
            ToString::to_string,
        );
        print(&format!(
            "drive: {of}\n{}Plot and CSV of every step: {}\n",
            log::table(capture, period, kind),
            self.out.display()
        ))
    }

    fn warn(&self, capture: &Capture, expected: Option<&Origin>) {
        let file = self.drive.shown();
        match (capture.origins.first(), expected) {
            (None, Some(_)) => eprintln!(
                "warning: the log does not say which drive it is of: control period and units are those of \
                 {file}"
            ),
            (None, None) => eprintln!(
                "warning: the log does not say which drive it is of, and no drive file is given: control \
                 period and units are those of {file}"
            ),
            (Some(said), Some(expected)) => {
                let differences = said.differences(expected);
                if !differences.is_empty() {
                    eprintln!(
                        "warning: the log is not of the drive that {file} describes: it is of one with {}; \
                         control period and units are the log's",
                        differences.join(", ")
                    );
                }
            }
            (Some(_), None) => {}
        }
        if let [first, others @ ..] = &capture.origins[..] {
            for other in others {
                eprintln!(
                    "warning: the log is of more than one drive: later of one with {}; control period and \
                     units are those of the first",
                    other.differences(first).join(", ")
                );
            }
        }
        if !capture.restarts.is_empty() {
            eprintln!(
                "warning: the drive was reset {} times; how long that took is not known, its time goes on as \
                 if it took none",
                capture.restarts.len()
            );
        }
        if capture.malformed > 0 || capture.lost > 0 {
            eprintln!(
                "warning: {} damaged frames skipped, {} control periods missing",
                capture.malformed, capture.lost
            );
        }
        if self.elf.is_some() && capture.malformed > capture.records.len() as u64 {
            eprintln!("warning: more is damaged than whole: is the ELF the one that logged?");
        }
    }
}
