//! `host-sim capture`: the drive's log as table, CSV and plot.

use crate::capture::{Capture, read_defmt, read_text};
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::output::{print, write_file};
use crate::report::log;
use clap::Args;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Read the drive's log: raw defmt with --elf, else text as probe-rs prints it.
#[derive(Debug, Args)]
pub(super) struct CaptureCommand {
    /// The firmware that logs; the log is then a raw defmt stream.
    #[arg(long, value_name = "FW.elf")]
    elf: Option<PathBuf>,
    /// File with the log; standard input when neither this nor --tcp is given.
    #[arg(long, value_name = "FILE")]
    rtt: Option<PathBuf>,
    /// Server that streams the log, until it closes the connection or Ctrl-C.
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "rtt")]
    tcp: Option<String>,
    /// Description of the drive, for its control period; the paper's rig when not given.
    #[arg(long, value_name = "DRIVE.toml")]
    drive: Option<PathBuf>,
    /// Where plot and CSV go.
    #[arg(long, value_name = "DIR", default_value = "target/host-sim")]
    out: PathBuf,
    /// Print the records as CSV and write no files.
    #[arg(long)]
    csv: bool,
}

/// Ctrl-C was pressed: what has come so far is the log.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// A stream that ends at Ctrl-C. A second Ctrl-C ends the program, for a stream that says nothing.
struct UntilInterrupted<R>(R);

impl<R: Read> Read for UntilInterrupted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            if INTERRUPTED.load(Ordering::Relaxed) {
                return Ok(0);
            }
            match self.0.read(buffer) {
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                result => return result,
            }
        }
    }
}

/// How long a server may be silent before Ctrl-C is looked at again.
const SILENCE: Duration = Duration::from_millis(100);

impl CaptureCommand {
    pub(super) fn run(self) -> Result<()> {
        let drive = Drive::load(self.drive.as_deref())?;
        let (period, kind) = (drive.control.sample_time, drive.kind);
        let read_error = |path: &Path| {
            let path = path.to_owned();
            move |source| Error::Read { path, source }
        };
        let stream: Box<dyn Read> = match (&self.rtt, &self.tcp) {
            (Some(path), _) => Box::new(std::fs::File::open(path).map_err(read_error(path))?),
            (None, Some(address)) => {
                let connect = || {
                    let stream = TcpStream::connect(address)?;
                    stream.set_read_timeout(Some(SILENCE))?;
                    Ok(stream)
                };
                Box::new(connect().map_err(read_error(Path::new(address)))?)
            }
            (None, None) => Box::new(std::io::stdin().lock()),
        };
        let stream = UntilInterrupted(stream);
        ctrlc::set_handler(|| {
            if INTERRUPTED.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        })
        .map_err(|error| Error::Capture(format!("Ctrl-C cannot be caught: {error}")))?;
        // Messages are shown as they come, the records at the end.
        let message = |text: &str| eprintln!("{text}");
        let capture = match &self.elf {
            Some(path) => {
                let elf = std::fs::read(path).map_err(read_error(path))?;
                // The decoder's own panics are counted as damaged frames, not shown.
                std::panic::set_hook(Box::new(|_| ()));
                let capture = read_defmt(&elf, &path.display().to_string(), stream, message);
                let _ = std::panic::take_hook();
                capture?
            }
            None => read_text(stream, message)?,
        };
        if capture.records.is_empty() {
            return Err(Error::Capture(format!(
                "the log of {} bytes holds no control period ({} damaged frames)",
                capture.bytes, capture.malformed
            )));
        }
        if self.csv {
            print(&String::from_utf8_lossy(&log::csv(&capture, period, kind)?))?;
        } else {
            write_file(
                &self.out.join("log.csv"),
                &log::csv(&capture, period, kind)?,
            )?;
            write_file(
                &self.out.join("log.svg"),
                log::plot(&capture, period, kind)?.as_bytes(),
            )?;
            print(&format!(
                "{}Plot and CSV of every step: {}\n",
                log::table(&capture, period, kind),
                self.out.display()
            ))?;
        }
        warn_of_damage(&capture);
        Ok(())
    }
}

fn warn_of_damage(capture: &Capture) {
    if capture.malformed > 0 || capture.lost > 0 {
        eprintln!(
            "warning: {} damaged frames skipped, {} control periods missing",
            capture.malformed, capture.lost
        );
    }
}
