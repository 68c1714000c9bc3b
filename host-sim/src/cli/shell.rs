//! What makes the program at home on a machine: `completions` for the shell, `man` pages, and the `schema` of
//! drive files for an editor.

use super::Cli;
use crate::drive;
use crate::error::{Error, Result};
use crate::output::{print, write_file};
use clap::{Args, CommandFactory};
use std::path::PathBuf;

/// Print the completions of a shell.
///
/// bash: `host-sim completions bash > ~/.local/share/bash-completion/completions/host-sim`
#[derive(Debug, Args)]
pub(super) struct CompletionsCommand {
    /// Which shell.
    shell: clap_complete::Shell,
}

impl CompletionsCommand {
    pub(super) fn run(self) -> Result<()> {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "host-sim", &mut text);
        print(&String::from_utf8_lossy(&text))
    }
}

/// Write the manual pages, one for each command.
#[derive(Debug, Args)]
pub(super) struct ManCommand {
    /// Where to, for example ~/.local/share/man/man1.
    #[arg(value_name = "DIR")]
    directory: PathBuf,
}

impl ManCommand {
    pub(super) fn run(self, quiet: bool) -> Result<()> {
        let mut command = Cli::command()
            .name("host-sim")
            .disable_help_subcommand(true);
        command.build();
        let pages = std::iter::once((String::from("host-sim"), command.clone()));
        let below = command.get_subcommands().flat_map(|sub| {
            let name = format!("host-sim-{}", sub.get_name());
            let below = sub.get_subcommands().map({
                let name = name.clone();
                move |below| (format!("{name}-{}", below.get_name()), below.clone())
            });
            std::iter::once((name, sub.clone())).chain(below)
        });
        for (name, command) in pages.chain(below) {
            let mut page = Vec::new();
            clap_mangen::Man::new(command)
                .render(&mut page)
                .map_err(|error| Error::Report(format!("a manual page: {error}")))?;
            write_file(&self.directory.join(format!("{name}.1")), &page)?;
        }
        if quiet {
            return Ok(());
        }
        print(&format!("manual pages: {}\n", self.directory.display()))
    }
}

/// Print the JSON schema of a drive file, with units and a sentence on each key, for editors.
#[derive(Debug, Args)]
pub(super) struct SchemaCommand {
    /// Of a plant file instead.
    #[arg(long)]
    plant: bool,
}

impl SchemaCommand {
    pub(super) fn run(self) -> Result<()> {
        print(&format!("{:#}\n", drive::schema(self.plant)))
    }
}
