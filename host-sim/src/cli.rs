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
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

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
        let arguments = arranged(arguments);
        let mut command = taking_numbers(Self::command());
        let matches = command.try_get_matches_from_mut(&arguments);
        let read = matches.and_then(|matches| {
            Self::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
        });
        read.map_err(|error| {
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

/// The arguments as clap understands them.
///
/// It takes no command behind a flag, where it could be a file for the main job: what is quiet goes to the end. It
/// knows a negative number by its digits, but not with a negative exponent: that is written out.
fn arranged(arguments: &[OsString]) -> Vec<OsString> {
    // What stands behind this is taken as it is.
    let end = arguments.iter().position(|argument| argument == "--");
    let (all, rest) = arguments.split_at(end.unwrap_or(arguments.len()));
    let is_quiet = |argument: &&OsString| *argument == "--quiet" || *argument == "-q";
    let (quiet, all): (Vec<_>, Vec<_>) = all.iter().partition(is_quiet);
    let all = all.into_iter().map(written_out);
    let quiet = quiet.into_iter().chain(rest).cloned();
    all.chain(quiet).collect()
}

/// A negative number without an exponent; any other argument as it is.
fn written_out(argument: &OsString) -> OsString {
    let digits = argument.to_str().and_then(|text| text.strip_prefix('-'));
    let digits =
        digits.filter(|digits| digits.starts_with(|c: char| c.is_ascii_digit() || c == '.'));
    let number = digits.and_then(|digits| digits.parse::<f64>().ok());
    let number = number.filter(|number| number.is_finite());
    number.map_or_else(|| argument.clone(), |number| format!("-{number}").into())
}

/// A whole number that has no sign.
fn not_negative<T: std::str::FromStr>(text: &str) -> std::result::Result<T, String> {
    let number = text.parse();
    number.map_err(|_| "must be a whole number, and not negative".into())
}

/// The same command and those below it, whose values may be negative numbers: what is not allowed is said by those
/// who know what is.
fn taking_numbers(command: clap::Command) -> clap::Command {
    command
        .allow_negative_numbers(true)
        .mut_subcommands(taking_numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &[&str]) -> std::result::Result<Cli, String> {
        let arguments = [&["host-sim"], line].concat();
        let arguments: Vec<OsString> = arguments.iter().map(OsString::from).collect();
        Cli::read(&arguments).map_err(|error| error.to_string())
    }

    /// Wherever it stands, before the command, behind it or behind the command below that.
    #[test]
    fn quiet_may_stand_anywhere() {
        for line in [
            &[][..],
            &["my-drive.toml", "--json"],
            &["bound", "0.03"],
            &["capture", "--json"],
            &["compare", "my-drive.toml"],
            &["completions", "bash"],
            &["design"],
            &["drive", "--port", "p", "move", "-1e-3"],
            &["excite", "--csv"],
            &["identify", "a.csv", "b.csv"],
            &["learn", "a.csv"],
            &["man", "pages"],
            &["moves", "--seed", "3"],
            &["paper"],
            &["record", "dump.bin"],
            &["schema", "--plant"],
            &["simulate", "--move", "0.1", "-0.1"],
            &["sweep", "s.toml", "--shard", "1/2"],
            &["sweep", "merge", "all.parquet", "1.parquet"],
            &["tune", "--friction", "0:1"],
        ] {
            let plain = format!("{:?}", read(line).unwrap_or_else(|error| panic!("{error}")));
            let expected = plain.replace("quiet: false", "quiet: true");
            assert_ne!(plain, expected);
            for at in 0..=line.len() {
                for flag in ["--quiet", "-q"] {
                    let mut with = line.to_vec();
                    with.insert(at, flag);
                    let found = read(&with).unwrap_or_else(|error| panic!("{with:?}: {error}"));
                    assert_eq!(format!("{found:?}"), expected, "{with:?}");
                }
            }
        }
    }

    /// Every option and argument that takes one takes it with a sign, without `=`, and says itself what is wrong with it.
    #[test]
    fn negative_numbers_are_values() {
        for number in ["-1", "-0.5", "-1e-3", "-2.5E-1", "-.5", "-1e3"] {
            let value: f64 = number.parse().unwrap();
            for line in [
                &["--move", "0.1", number][..],
                &["simulate", "--move", number, "0.1", "--json"],
                &["bound", "--distance", number],
                &["tune", "--distance", number],
                &["moves", "--distance", number],
                &["excite", "--travel", number],
                &["learn", "a.csv", "--move", number],
                &["drive", "--port", "p", "move", number],
                &["drive", "--port", "p", "jog", number],
                &["drive", "--port", "p", "jog", "1", "--for", number],
                &["drive", "--port", "p", "set-position", number],
                &["drive", "--port", "p", "telemetry", "--for", number],
            ] {
                let found = read(line).unwrap_or_else(|error| panic!("{line:?}: {error}"));
                let found = format!("{found:?}");
                assert!(found.contains(&format!("{value:?}")), "{line:?}: {found}");
            }
        }
        for (line, rule) in [
            (
                &["simulate", "--duration", "-1"][..],
                "must be from 0.001 to 1000 s",
            ),
            (&["tune", "--plants", "-1"], "-1 is not in 1..=100000"),
            (
                &["tune", "--seed", "-1"],
                "must be a whole number, and not negative",
            ),
            (
                &["sweep", "s.toml", "--shard", "-1/2"],
                "must be I/N with I from 1",
            ),
            (&["tune", "--friction", "-1:b"], "must be two numbers"),
        ] {
            let error = read(line).unwrap_err();
            assert!(error.contains(rule), "{line:?}: {error}");
        }
        for range in [
            "--stiffness",
            "--last-load",
            "--force-constant",
            "--friction",
        ] {
            let found = format!("{:?}", read(&["tune", range, "-1:0", "--json"]).unwrap());
            assert!(found.contains("Range([-1.0, 0.0])"), "{found}");
        }
    }
}
