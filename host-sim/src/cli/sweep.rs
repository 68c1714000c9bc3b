//! `host-sim sweep`: many plants and drives under many laws, and parts of that put together.

use super::interrupt::{INTERRUPTED, catch_interrupt};
use super::progress::Progress;
use crate::error::{Error, Result};
use crate::output::print;
use crate::report::sweep;
use crate::sweep::{Shard, Summary, Sweep, Watch, merge};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::Ordering;

/// Run many plants and drives, drawn at random or on a grid, under many laws; a row of figures for each.
///
/// The file names the drive, how it goes, the laws, and which keys of drive and plant vary (README.md). The figures
/// go to a Parquet file. A sweep that was killed goes on where it was when the same command is given again.
/// --shard makes one part, on as many machines as there are; merge puts the parts together, to the very
/// bytes that one machine would have written.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct SweepCommand {
    #[command(subcommand)]
    merge: Option<Part>,
    /// Description of the sweep.
    #[arg(value_name = "SWEEP.toml", required = true)]
    file: Option<PathBuf>,
    /// Where the figures go; target/host-sim/SWEEP.parquet when not given, with --shard SWEEP-I-of-N.parquet.
    #[arg(long, value_name = "OUT.parquet")]
    out: Option<PathBuf>,
    /// Make one part of several, counted from 1.
    #[arg(long, value_name = "I/N", default_value_t = Shard::WHOLE, allow_hyphen_values = true)]
    shard: Shard,
    /// Print the summary as JSON, SI units.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Part {
    Merge(MergeCommand),
}

/// Put the parts of a sweep together: all of them, each once, all of the same sweep.
#[derive(Debug, Args)]
struct MergeCommand {
    /// The file of the whole sweep.
    #[arg(value_name = "OUT.parquet")]
    out: PathBuf,
    /// All parts, in any order.
    #[arg(value_name = "PART.parquet", required = true)]
    parts: Vec<PathBuf>,
    /// Print the summary as JSON, SI units.
    #[arg(long)]
    json: bool,
}

impl SweepCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        if let Some(Part::Merge(command)) = self.merge {
            return command.run(quiet);
        }
        let Some(file) = self.file else {
            return Err(Error::Usage("a sweep file is missing".into()));
        };
        let out = self.out.unwrap_or_else(|| default_out(&file, self.shard));
        let progress = Progress::new(quiet, "design");
        let sweep = Sweep::load(&file)?;
        // While rivals are tuned Ctrl-C ends it as it ends other programs: there is nothing to be kept.
        let caught = OnceLock::new();
        let summary = sweep.run(
            &out,
            self.shard,
            &Watch {
                preparing: &|done, of, what| progress.step(done, of, what),
                running: &|done, of| {
                    // Where it cannot be caught, what is kept is kept all the same.
                    let _ = caught.get_or_init(catch_interrupt);
                    progress.rate(done, of, "samples");
                },
                stop: &|| INTERRUPTED.load(Ordering::Relaxed),
            },
        )?;
        drop(progress);
        show(&summary, &out, self.json, quiet)
    }
}

impl MergeCommand {
    fn run(self, quiet: bool) -> Result<()> {
        let progress = Progress::new(quiet, "merging");
        let summary = merge(&self.out, &self.parts, &|done, of, what| {
            progress.step(done, of, what);
        })?;
        drop(progress);
        show(&summary, &self.out, self.json, quiet)
    }
}

fn show(summary: &Summary, out: &Path, json: bool, quiet: bool) -> Result<()> {
    if json {
        return print(&format!("{:#}\n", serde_json::json!(summary)));
    }
    if quiet {
        return Ok(());
    }
    print(&format!(
        "{}Figures: {}\n",
        sweep::text(summary),
        out.display()
    ))
}

fn default_out(file: &Path, shard: Shard) -> PathBuf {
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let name = match shard {
        Shard::WHOLE => format!("{name}.parquet"),
        _ => format!("{name}-{}-of-{}.parquet", shard.number(), shard.of()),
    };
    Path::new("target/host-sim").join(name)
}
