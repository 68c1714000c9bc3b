//! `host-sim design`: gains from a drive file.

use crate::design::Design;
use crate::design::assessment::Assessment;
use crate::drive::{DEFAULT_NAME, Drive};
use crate::error::Result;
use crate::output::{print, write_file};
use crate::report::{design, horizon};
use crate::simulate::corridor::gains_source;
use clap::Args;
use std::path::PathBuf;

/// Design regulator and observer of a drive.
#[derive(Debug, Args)]
pub(super) struct DesignCommand {
    /// Description of the drive; the paper's rig when not given.
    drive: Option<PathBuf>,
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
    pub(super) fn run(self) -> Result<()> {
        let drive = Drive::load(self.drive.as_deref())?;
        let design = Design::new(&drive)?;
        let assessment = Assessment::new(&design)?;
        let name = self.drive.as_ref().and_then(|path| path.file_name());
        let origin = name.map_or(DEFAULT_NAME.into(), |name| name.to_string_lossy());
        let sound = assessment.require_sound();
        if let (Some(path), true) = (&self.rust, sound.is_ok()) {
            write_file(path, gains_source(&design, &origin).as_bytes())?;
        }
        if let Some(path) = &self.plot {
            write_file(path, horizon::plot(&design)?.as_bytes())?;
        }
        if self.json {
            print(&format!("{:#}\n", design::json(&design, &assessment)?))?;
        } else {
            let mut text = format!("design for {origin}\n{}", design::tables(&design)?);
            text += &design::protection(&design);
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
