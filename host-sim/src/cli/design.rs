//! `host-sim design`: gains from a drive file.

use super::drive_argument::DriveArgument;
use super::progress::Progress;
use crate::design::Design;
use crate::design::assessment::Assessment;
use crate::error::Result;
use crate::output::{print, write_file};
use crate::report::{design, horizon};
use crate::simulate::corridor::gains_source;
use crate::simulate::stillness::stillness;
use clap::Args;
use std::path::PathBuf;

/// Design regulator and observer of a drive.
#[derive(Debug, Args)]
pub(super) struct DesignCommand {
    #[command(flatten)]
    drive: DriveArgument,
    /// Print the design as JSON, SI units.
    #[arg(long)]
    json: bool,
    /// Write the gains as Rust source for the firmware.
    #[arg(long, value_name = "PATH")]
    rust: Option<PathBuf>,
    /// Plot how the finite-horizon gain of eq. (14) tends to the constant one, as SVG.
    #[arg(long, value_name = "PATH")]
    plot: Option<PathBuf>,
}

impl DesignCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let progress = Progress::new(quiet, "design");
        let design = Design::new(&self.drive.load()?)?;
        let mut assessment = Assessment::new(&design)?;
        let sound = assessment.require_sound();
        if sound.is_ok() {
            assessment.checks.push(stillness(&design)?);
        }
        drop(progress);
        let origin = self.drive.name();
        if let (Some(path), true) = (&self.rust, sound.is_ok()) {
            write_file(path, gains_source(&design, &origin)?.as_bytes())?;
        }
        if let Some(path) = &self.plot {
            write_file(path, horizon::plot(&design)?.as_bytes())?;
        }
        if self.json {
            print(&format!("{:#}\n", design::json(&design, &assessment)?))?;
        } else if !quiet {
            let mut text = format!("design for {origin}\n{}", design::tables(&design)?);
            text += &design::protection(&design);
            // What is refused may have no plans either, and the refusal says why.
            match design::moves(&design) {
                Err(error) if sound.is_ok() => return Err(error),
                Err(error) => text += &format!("no planned moves: {error}\n"),
                Ok(moves) => text += &moves,
            }
            text += &design::assessment(&assessment);
            if let (Some(path), true) = (&self.rust, sound.is_ok()) {
                text += &format!("gains written to {}\n", path.display());
            }
            if let Some(path) = &self.plot {
                text += &format!("plot written to {}\n", path.display());
            }
            print(&text)?;
        }
        sound
    }
}
