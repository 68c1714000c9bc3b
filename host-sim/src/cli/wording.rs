//! Errors as the user of the command line reads them: the sentences of [`Error`], with parameters named
//! by the flags that set them.

use crate::error::Error;

/// Every parameter that an error can name, and its flag.
const FLAGS: [(&str, &str); 8] = [
    ("current", "--current"),
    ("experiment", "--run"),
    ("from", "--from"),
    ("hold", "--hold"),
    ("period", "--period"),
    ("repetitions", "--repeat"),
    ("to", "--to"),
    ("travel", "--travel"),
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
        Error::PlantOnly { .. } => format!("{error} (simulate --plant)"),
        _ => error.to_string(),
    }
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
        // What a file says is not touched.
        let error = Error::Input {
            place: "drive.toml:3".into(),
            message: "unknown field `current`".into(),
        };
        assert_eq!(sentence(&error), "drive.toml:3: unknown field `current`");
    }
}
