//! `host-sim learn`: from the record of an ordinary move to new gains, and what they buy.

use super::progress::Progress;
use super::records::{DescribedDrive, held_by_default};
use super::watch::Watch;
use crate::design::checks::Check;
use crate::drive::Drive;
use crate::error::{Error, Result};
use crate::identify::{Columns, Experiment, Identification, drive_file};
use crate::output::{print, write_file};
use crate::report::learning::{self, Learned};
use crate::simulate::benefit::Benefit;
use crate::simulate::corridor::gains_source;
use crate::simulate::proposal::Proposal;
use crate::simulate::sequence::require_a_count;
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Learn the machine from records of its moves: a new drive file, new gains, and what they buy.
///
/// Identifies as `identify` does, designs as `design` does, and simulates a planned move on the machine that was
/// learned, with the gains of the old drive file and with the new ones. It proposes: nothing that is in use is
/// changed.
#[derive(Debug, Args)]
pub(super) struct LearnCommand {
    /// The record, or several of the same machine, as for `identify`.
    #[arg(required_unless_present = "watch", value_name = "RECORD")]
    record: Vec<PathBuf>,
    /// The drive file whose gains the machine ran with; the paper's rig when not given.
    #[arg(long, value_name = "DRIVE.toml")]
    drive: Option<PathBuf>,
    /// Names of the record's columns where they are others, as for `identify`.
    #[arg(long, value_name = "WHAT=NAME,…")]
    column: Vec<Columns>,
    /// Where the new drive file goes.
    #[arg(long, value_name = "PATH")]
    toml: Option<PathBuf>,
    /// Where the new gains go, as Rust source for the firmware.
    #[arg(
        long,
        value_name = "PATH",
        default_value = "target/host-sim/learned-gains.rs"
    )]
    rust: PathBuf,
    /// The planned move that shows what the new gains buy, m or rad; 0.03 when not given, or as much as the travel
    /// has room for.
    #[arg(long = "move", value_name = "DISTANCE")]
    distance: Option<f64>,
    /// Print all of it as JSON, SI units.
    #[arg(long)]
    json: bool,
    /// Learn nothing: follow a record that is still being written, and say after each move how far the load is
    /// from what the drive file says, until Ctrl-C.
    #[arg(long, value_name = "LOG.csv", conflicts_with_all = ["record", "toml", "rust", "distance"])]
    watch: Option<PathBuf>,
    /// Watch so many moves.
    #[arg(long, value_name = "N", requires = "watch", value_parser = super::not_negative::<usize>)]
    moves: Option<usize>,
}

/// Where the new drive file goes when nothing is said.
const LEARNED: &str = "target/host-sim/learned.toml";

impl LearnCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let file = DescribedDrive::load(self.drive.as_deref())?;
        if let Some(path) = &self.watch {
            let watch = Watch {
                path,
                drive: &file,
                columns: &self.column,
                moves: self.moves,
                json: self.json,
            };
            return watch.run();
        }
        let toml = self.toml.clone().unwrap_or_else(|| LEARNED.into());
        if self.toml.is_none() && file.is_at(&toml) {
            return Err(Error::Usage(format!(
                "the drive file is {LEARNED}, where the new one would go: say with --toml where it is to go"
            )));
        }
        if let Some(distance) = self.distance {
            require_a_count(&file.drive, distance)?;
        }
        let logs = file.logs(&self.record, &self.column)?;
        let experiment = Experiment::Excitation;
        // Meanwhile what the machine ran with; whatever is wrong with it is said where it is needed.
        let (identification, _) = rayon::join(
            || file.identified(&logs, experiment, &held_by_default(), quiet),
            || file.design().is_ok_and(|old| old.plans().is_ok()),
        );
        let identification = identification?;
        let text = drive_file(&file.text, &identification.quantities)?;
        let drive = Drive::parse(&text, &toml.display().to_string())?;
        write_file(&toml, text.as_bytes())?;
        let learned = Learned {
            old: &file.drive,
            new: &drive,
            identification: &identification,
        };
        let progress = Progress::new(quiet, "design");
        let proposed = self.propose(&file, &drive, &toml);
        drop(progress);
        if self.json {
            let mut files = json!({"drive": toml});
            if proposed.is_ok() {
                files["gains"] = json!(self.rust);
            }
            let refused = proposed.as_ref().err().map(ToString::to_string);
            let benefit = proposed.as_ref().map(|(benefit, _)| benefit);
            let benefit = benefit.map_err(|_| refused.as_deref().unwrap_or_default());
            let checks = proposed.as_ref().map_or(&[][..], |(_, checks)| checks);
            print(&format!(
                "{:#}\n",
                learning::json(&learned, benefit, checks, &files)
            ))?;
        } else if !quiet {
            let mut text = self.found(&identification);
            text += &learning::changes(&learned);
            if let Ok((benefit, checks)) = &proposed {
                text += &format!("\n{}", learning::benefit(&drive, benefit));
                text += &learning::warnings(checks);
            }
            text += &format!("\nDrive file: {}\n", toml.display());
            if proposed.is_ok() {
                text += &self.what_next(&file, &toml);
            }
            print(&text)?;
        }
        proposed.map(drop)
    }

    /// Gains for the machine that was learned, once they have shown that they can move it.
    fn propose(
        &self,
        old: &DescribedDrive,
        drive: &Drive,
        toml: &Path,
    ) -> Result<(Benefit, Vec<Check>)> {
        let Proposal {
            design,
            checks,
            benefit,
        } = Proposal::new(old.design(), drive, self.distance)?;
        let origin = toml.file_name().unwrap_or(toml.as_os_str());
        let source = gains_source(&design, &origin.to_string_lossy())?;
        write_file(&self.rust, source.as_bytes())?;
        Ok((benefit, checks))
    }

    fn found(&self, identification: &Identification) -> String {
        let records = self.record.iter().map(|path| path.display().to_string());
        format!(
            "learned from {}: the machine explains {:.1} % of the motion\n\n",
            records.collect::<Vec<_>>().join(", "),
            identification.fit_percent
        )
    }

    fn what_next(&self, old: &DescribedDrive, toml: &Path) -> String {
        let (gains, toml) = (self.rust.display(), toml.display());
        let keep = match &self.drive {
            Some(_) => format!("  cp {toml} {}\n", old.shown()),
            None => String::new(),
        };
        format!(
            "Gains: {gains}\n\nNothing has been changed. To use what was learned:\n{keep}  cp {gains} \
             firmware/src/gains.rs\n  cargo flash\n"
        )
    }
}
