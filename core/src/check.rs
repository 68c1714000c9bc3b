//! What settings must be so that the core can run them: each part checks its own with these.

use core::fmt;

/// Why settings cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingsError {
    /// The named value must be finite and greater than zero.
    NotPositive(&'static str),
    /// The named value must be finite.
    NotFinite(&'static str),
    /// The named value must be finite and not negative.
    Negative(&'static str),
    /// The counter must be 2 to 32 bits wide.
    CounterBits,
    /// The nominal mass and force constant together with their deviations must be positive.
    Deviation,
    /// The lower end of the travel must lie below the upper one.
    Travel,
    /// The rows of a plan must lie in the table, and each displacement reach farther than the one before.
    Plans,
    /// The change of the anchored observer must be zero where one state does not act on another, and its output `q_2`.
    Structure,
    /// There must be at least one load.
    NoLoad,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPositive(name) => write!(f, "{name} must be finite and greater than zero"),
            Self::NotFinite(name) => write!(f, "{name} must be finite"),
            Self::Negative(name) => write!(f, "{name} must be finite and not negative"),
            Self::CounterBits => f.write_str("the encoder counter must be 2 to 32 bits wide"),
            Self::Deviation => f.write_str(
                "nominal mass and force constant plus their deviations must be positive",
            ),
            Self::Travel => f.write_str("the lower end of the travel must lie below the upper one"),
            Self::Plans => f.write_str(
                "the rows of a plan must lie in the table, and each reach farther than the one before",
            ),
            Self::Structure => f.write_str(
                "observer.change must be zero where no state acts on another, and observer.output the second lag",
            ),
            Self::NoLoad => f.write_str("there must be at least one load"),
        }
    }
}

impl core::error::Error for SettingsError {}

pub(crate) fn positive(name: &'static str, value: f32) -> Result<(), SettingsError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(SettingsError::NotPositive(name))
    }
}

pub(crate) fn not_negative(name: &'static str, value: f32) -> Result<(), SettingsError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(SettingsError::Negative(name))
    }
}

pub(crate) fn finite<'a>(
    name: &'static str,
    values: impl IntoIterator<Item = &'a f32>,
) -> Result<(), SettingsError> {
    if values.into_iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(SettingsError::NotFinite(name))
    }
}
