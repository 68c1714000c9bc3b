//! Errors as the user of the command line reads them: the sentences of [`Error`], with parameters named
//! by the flags that set them.

use super::Cli;
use crate::error::Error;
use clap::CommandFactory;
use std::path::Path;

/// Every parameter that an error can name, and its flag.
const FLAGS: [(&str, &str); 23] = [
    ("approach", "--velocity"),
    ("at", "--at"),
    ("back-off", "--back-off"),
    ("current", "--current"),
    ("distance", "--distance"),
    ("duration", "--for"),
    ("experiment", "--run"),
    ("force-constant", "--force-constant"),
    ("friction", "--friction"),
    ("from", "--from"),
    ("hold", "--hold"),
    ("last-load", "--last-load"),
    ("move", "--move"),
    ("period", "--period"),
    ("port", "--port"),
    ("position", "--position"),
    ("repetitions", "--repeat"),
    ("stiffness", "--stiffness"),
    ("stop", "--stop"),
    ("target", "X"),
    ("to", "--to"),
    ("travel", "--travel"),
    ("velocity", "V"),
];

/// The sentence of an error.
#[must_use]
pub fn sentence(error: &Error) -> String {
    match error {
        Error::Parameter { .. } | Error::Usage(_) | Error::Identification(_) => {
            let sentence = error.to_string();
            FLAGS.iter().fold(sentence, |sentence, (parameter, flag)| {
                sentence.replace(&format!("`{parameter}`"), flag)
            })
        }
        Error::Read { path, source } if source.kind() == std::io::ErrorKind::NotFound => {
            match path.to_str().and_then(meant) {
                Some(meant) => format!("{error}; did you mean the command '{meant}'?"),
                None => error.to_string(),
            }
        }
        Error::PlantOnly { .. } => format!("{error} (simulate --plant)"),
        _ => error.to_string(),
    }
}

/// How alike two words are that one may have been meant by the other, from 0 to 1.
const ALIKE: f64 = 0.8;

/// The command that was meant by a word that is no command, no option and no file.
pub(super) fn meant(word: &str) -> Option<String> {
    let command = Cli::command();
    let names = command.get_subcommands().map(clap::Command::get_name);
    let names: Vec<&str> = names.collect();
    let other = names.contains(&word) || word.contains(['.', '/', '-']) || Path::new(word).exists();
    let likeness = names
        .iter()
        .map(|name| (strsim::normalized_damerau_levenshtein(word, name), name))
        .filter(|(alike, _)| !other && *alike >= ALIKE.min(1.0 - 1.5 / word.len().max(2) as f64));
    let best = likeness.max_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, name)| (*name).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_become_flags() {
        let error = Error::parameter("travel", 0.1, "allow more, or raise `from`");
        assert_eq!(
            sentence(&error),
            "--travel 0.1: allow more, or raise --from"
        );
        let error = Error::Parameter {
            parameter: "hold",
            values: vec!["a".into(), "b".into()],
            rule: "must be c".into(),
        };
        assert_eq!(sentence(&error), "--hold a --hold b: must be c");
        for (word, expected) in [
            ("simulte", Some("simulate")),
            ("desing", Some("design")),
            ("idenify", Some("identify")),
            ("mna", Some("man")),
            ("design", None),
            ("my-drive.toml", None),
            ("motor", None),
        ] {
            assert_eq!(meant(word).as_deref(), expected, "{word}");
        }
        // What a file says is not touched.
        let error = Error::Input {
            place: "drive.toml:3".into(),
            message: "unknown field `current`".into(),
        };
        assert_eq!(sentence(&error), "drive.toml:3: unknown field `current`");
    }
}
