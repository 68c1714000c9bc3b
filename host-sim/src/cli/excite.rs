//! `host-sim excite`: the current that the drive plays to be identified.

use super::drive_argument::DriveArgument;
use crate::error::Result;
use crate::excite::{self, ExcitationPlan, ExcitationRequest, excitation_file};
use crate::output::{print, significant, write_file};
use crate::report::excitation;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Form the excitation that the drive plays in open loop, for identification.
#[derive(Debug, Args)]
pub(super) struct ExciteCommand {
    #[command(flatten)]
    drive: DriveArgument,
    /// Which signal.
    #[arg(long, value_enum, default_value_t)]
    kind: Signal,
    /// Peak current; a quarter of the current limit when not given.
    #[arg(long, value_name = "A")]
    current: Option<f64>,
    /// Where the amplifier is switched off, measured from where the actuator begins; four times the
    /// travel predicted when not given. The machine then coasts: leave it room. The current is reduced
    /// until half of it is enough.
    #[arg(long, value_name = "M")]
    travel: Option<f64>,
    /// Lower end of the band; 0.2 times the slowest mode when not given.
    #[arg(long, value_name = "HZ")]
    from: Option<f64>,
    /// Upper end of the band; 1.5 times the fastest mode when not given, at most 0.4 / sample time.
    #[arg(long, value_name = "HZ")]
    to: Option<f64>,
    /// Period; 2.048 s when not given, or longer to hold the lower end of the band four times.
    #[arg(long, value_name = "S")]
    period: Option<f64>,
    /// How often the period is played.
    #[arg(
        long,
        value_name = "N",
        default_value_t = ExcitationRequest::default().repetitions,
        value_parser = clap::value_parser!(u16).range(1..)
    )]
    repeat: u16,
    /// Write the excitation as Rust source for the firmware.
    #[arg(long, value_name = "PATH")]
    rust: Option<PathBuf>,
    /// Draw current, spectrum and predicted motion, as SVG.
    #[arg(long, value_name = "PATH")]
    plot: Option<PathBuf>,
    /// Print what is known of the excitation as JSON, SI units; the CSV file is written all the same.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print every control period as CSV and write no CSV file.
    #[arg(long)]
    csv: bool,
    /// Where the CSV file goes.
    #[arg(long, value_name = "DIR", default_value = "target/host-sim")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Signal {
    /// Every odd multiple of 1 / period in the band, with equal current.
    #[default]
    Multisine,
    /// A linear sweep through the band and back, twice per period, the second time upside down.
    Chirp,
}

impl From<Signal> for excite::Signal {
    fn from(signal: Signal) -> Self {
        match signal {
            Signal::Multisine => excite::Signal::Multisine,
            Signal::Chirp => excite::Signal::Chirp,
        }
    }
}

impl ExciteCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let drive = self.drive.load()?;
        let plan = ExcitationPlan::new(
            &drive,
            &ExcitationRequest {
                signal: self.kind.into(),
                current: self.current,
                travel: self.travel,
                from: self.from,
                to: self.to,
                period: self.period,
                repetitions: self.repeat,
            },
        )?;
        let origin = self.drive.name();
        if let Some(path) = &self.rust {
            write_file(path, excitation_file(&plan, &drive, &origin).as_bytes())?;
        }
        if let Some(current) = plan.reduced_from {
            eprintln!(
                "warning: the travel of {} {} allows {} A instead of {} A",
                plan.travel,
                drive.kind.units().position,
                significant(plan.peak(), 3),
                significant(current, 3)
            );
        }
        if let Some(path) = &self.plot {
            write_file(path, excitation::plot(&plan, &drive)?.as_bytes())?;
        }
        if self.csv {
            return print(&excitation::csv(&plan));
        }
        let path = self.out.join("excitation.csv");
        write_file(&path, excitation::csv(&plan).as_bytes())?;
        if self.json {
            return print(&format!("{:#}\n", excitation::json(&plan, &drive)));
        }
        if quiet {
            return Ok(());
        }
        let mut text = format!("drive: {origin}\n{}", excitation::summary(&plan, &drive));
        if let Some(path) = &self.rust {
            text += &format!("Rust source: {}\n", path.display());
        }
        if let Some(path) = &self.plot {
            text += &format!("plot: {}\n", path.display());
        }
        text += &format!("CSV of every control period: {}\n", path.display());
        print(&text)
    }
}
