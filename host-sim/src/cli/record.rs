//! `host-sim record`: the last moves of a drive, out of a dump of its memory.

use crate::capture::{LastMoves, RecordedMove, read_memory};
use crate::error::{Error, Result};
use crate::output::{print, write_file};
use crate::report::record;
use clap::Args;
use std::path::PathBuf;

/// Read the last moves that a drive keeps in its memory, from a dump that a debugger made of it.
///
/// The dump is binary, of the whole memory or of the record alone:
/// `probe-rs read --chip STM32F405RGTx b8 0x20000000 131072 --format binary --output ram.bin`. What is written is
/// what `identify` reads.
#[derive(Debug, Args)]
pub(super) struct RecordCommand {
    /// The dump.
    #[arg(value_name = "DUMP.bin")]
    dump: PathBuf,
    #[command(flatten)]
    wanted: Wanted,
}

impl RecordCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let dump = std::fs::read(&self.dump).map_err(Error::read(&self.dump))?;
        let last_moves = read_memory(&dump, &self.dump.display().to_string())?;
        match self.wanted.write(&last_moves)? {
            Some(written) if !quiet => print(&written),
            _ => Ok(()),
        }
    }
}

/// What is wanted of the last moves, wherever they come from.
#[derive(Debug, Args)]
pub(super) struct Wanted {
    /// Which move, by its number; the newest when not given.
    #[arg(long = "move", value_name = "N")]
    number: Option<u32>,
    /// Where the CSV goes.
    #[arg(long, value_name = "DIR", default_value = "target/host-sim")]
    out: PathBuf,
    /// Print the move as CSV and write no file.
    #[arg(long)]
    pub(super) csv: bool,
}

impl Wanted {
    /// Writes a move; what there is to be said then.
    pub(super) fn write(&self, last_moves: &LastMoves) -> Result<Option<String>> {
        let chosen = self.choose(&last_moves.moves)?;
        let csv = record::csv(chosen, &last_moves.origin)?;
        if self.csv {
            print(&String::from_utf8_lossy(&csv))?;
            return Ok(None);
        }
        let path = self.out.join("record.csv");
        write_file(&path, &csv)?;
        Ok(Some(format!(
            "{}Every step of move {}: {}\n",
            record::table(last_moves),
            chosen.number,
            path.display()
        )))
    }

    fn choose<'a>(&self, moves: &'a [RecordedMove]) -> Result<&'a RecordedMove> {
        let ([first, ..], [.., last]) = (moves, moves) else {
            return Err(Error::Capture(
                "the drive has not moved since its reset".into(),
            ));
        };
        let Some(number) = self.number else {
            return Ok(last);
        };
        let found = moves.iter().find(|one| one.number == number);
        found.ok_or_else(|| {
            let rule = format!(
                "must be one of the moves that the record has, {} to {}",
                first.number, last.number
            );
            Error::parameter("move", number, rule)
        })
    }
}
