//! The command line.
//!
//! `host-sim` alone does the main job: the paper's four experiments and a planned move on the embedded drive, the
//! same as `host-sim simulate`. A file for each subcommand: it parses, calls the library, and prints or
//! writes what `report` makes of the result; `wording` has the flags in errors, `drive_argument` the one way to
//! name a drive file.

mod bound;
mod capture;
mod compare;
mod design;
mod drive;
mod drive_argument;
mod excite;
mod identify;
mod interrupt;
mod learn;
mod moves;
mod paper;
mod progress;
mod record;
mod records;
mod shell;
mod simulate;
mod sweep;
mod tune;
mod watch;
mod wording;

use crate::error::Result;
use clap::{CommandFactory, Parser, Subcommand};

pub use wording::sentence;

use std::ffi::OsString;

/// Designs the gains of a drive that positions a flexible load with no sensor on it, and
/// simulates it with the control core of the firmware.
#[derive(Debug, Parser)]
#[command(version, args_conflicts_with_subcommands = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    main: simulate::Simulate,
    /// Print no results and no progress: errors, warnings, and the JSON or CSV that is asked for
    #[arg(long, short, global = true)]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    Design(design::DesignCommand),
    Bound(bound::BoundCommand),
    Capture(capture::CaptureCommand),
    Compare(compare::CompareCommand),
    Drive(drive::DriveCommand),
    Identify(identify::IdentifyCommand),
    Learn(learn::LearnCommand),
    Moves(moves::MovesCommand),
    Excite(excite::ExciteCommand),
    Paper(paper::PaperCommand),
    Record(record::RecordCommand),
    Simulate(simulate::Simulate),
    Sweep(sweep::SweepCommand),
    Tune(tune::TuneCommand),
    Completions(shell::CompletionsCommand),
    Man(shell::ManCommand),
    Schema(shell::SchemaCommand),
}

impl Cli {
    /// Reads the command line; what clap makes of it otherwise, unless a command is misspelt.
    ///
    /// # Errors
    /// What is wrong with it, or the help that was asked for.
    pub fn read(arguments: &[OsString]) -> std::result::Result<Self, clap::Error> {
        Self::try_parse_from(arguments).map_err(|error| {
            let word = arguments.get(1).and_then(|word| word.to_str());
            let misspelt = word
                .filter(|_| error.exit_code() != 0)
                .and_then(|word| Some((word, wording::meant(word)?)));
            match misspelt {
                Some((word, meant)) => Self::command().error(
                    clap::error::ErrorKind::InvalidSubcommand,
                    format!("there is no command '{word}': did you mean '{meant}'?"),
                ),
                None => error,
            }
        })
    }

    /// Does what the command line asks for.
    ///
    /// # Errors
    /// Whatever ends it early; see [`Error::exit_code`](crate::error::Error::exit_code).
    pub fn run(self) -> Result<()> {
        let quiet = self.quiet;
        match self.command {
            None => self.main.run(quiet),
            Some(Command::Design(command)) => command.run(quiet),
            Some(Command::Bound(command)) => command.run(quiet),
            Some(Command::Capture(command)) => command.run(quiet),
            Some(Command::Compare(command)) => command.run(quiet),
            Some(Command::Drive(command)) => command.run(quiet),
            Some(Command::Identify(command)) => command.run(quiet),
            Some(Command::Learn(command)) => command.run(quiet),
            Some(Command::Moves(command)) => command.run(quiet),
            Some(Command::Excite(command)) => command.run(quiet),
            Some(Command::Paper(command)) => command.run(quiet),
            Some(Command::Record(command)) => command.run(quiet),
            Some(Command::Simulate(command)) => command.run(quiet),
            Some(Command::Sweep(command)) => command.run(quiet),
            Some(Command::Tune(command)) => command.run(quiet),
            Some(Command::Completions(command)) => command.run(),
            Some(Command::Man(command)) => command.run(quiet),
            Some(Command::Schema(command)) => command.run(),
        }
    }
}
