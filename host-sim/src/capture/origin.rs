//! Which drive a log is of.

use crate::design::Design;
use crate::error::{Error, Result};
use crate::machine::Kind;
use crate::simulate::corridor::fingerprint;
use arso_core::Identity;
use serde::Serialize;
use std::fmt;

/// What the drive says of itself, or what a drive file makes of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Origin {
    /// Linear or rotary.
    pub kind: Kind,
    /// Number of load masses.
    pub loads: usize,
    /// Control period, s.
    pub period: f64,
    /// Checksum of all settings.
    pub fingerprint: u32,
}

impl Origin {
    /// What the firmware of a design will say.
    ///
    /// # Errors
    /// [`Error::Report`](crate::error::Error::Report) when the settings cannot be serialised.
    pub fn of(design: &Design) -> Result<Self> {
        Ok(Self {
            kind: design.drive.kind,
            loads: design.loads(),
            period: short(design.drive.control.sample_time as f32),
            fingerprint: fingerprint(design)?,
        })
    }

    /// What the drive said; nothing where it names a kind of drive that there is not.
    pub(crate) fn said(identity: &Identity<'_>) -> Option<Self> {
        Some(Self {
            kind: Kind::named(identity.kind)?,
            loads: identity.loads.into(),
            period: short(identity.sample_time),
            fingerprint: identity.fingerprint,
        })
    }

    /// In one word, but for the control period: what [`Origin::marked`] reads.
    #[must_use]
    pub fn mark(&self) -> String {
        let (kind, loads) = (self.kind.name(), self.loads);
        format!("{kind}-{loads}-{:08x}", self.fingerprint)
    }

    /// From one word; nothing when it is none.
    #[must_use]
    pub fn marked(mark: &str, period: f64) -> Option<Self> {
        let (kind, rest) = mark.split_once('-')?;
        let (loads, fingerprint) = rest.split_once('-')?;
        Some(Self {
            kind: Kind::named(kind)?,
            loads: loads.parse().ok()?,
            period: short(period as f32),
            fingerprint: u32::from_str_radix(fingerprint, 16).ok()?,
        })
    }

    /// Of a record that says of which drive it is, what differs from a drive, in words; empty when nothing does.
    ///
    /// * `mark`: what it says, of a record with a `period`, s; `name` is its own
    /// * `design`: what ran, where there are gains for that
    ///
    /// # Errors
    /// [`Error::Input`] for what is no mark, [`Error::Usage`] for the other kind of drive.
    pub fn of_record(
        (name, mark, period): (&str, &str, f64),
        kind: Kind,
        design: Option<&Design>,
    ) -> Result<Vec<String>> {
        let said = Self::marked(mark, period).ok_or_else(|| Error::Input {
            place: name.to_owned(),
            message: format!(
                "drive[name] = \"{mark}\": must be kind, loads and fingerprint as `capture` writes them"
            ),
        })?;
        if said.kind != kind {
            return Err(Error::Usage(format!(
                "the log is of a {} drive, and the drive file describes a {} one",
                said.kind.name(),
                kind.name()
            )));
        }
        match design {
            Some(design) => Ok(said.differences(&Self::of(design)?)),
            None => Ok(Vec::new()),
        }
    }

    /// In words, what differs from another drive, this one first; empty when nothing does.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut found = Vec::new();
        if self.kind != other.kind {
            found.push(format!("{}, not {}", self.kind.name(), other.kind.name()));
        }
        if self.loads != other.loads {
            found.push(format!("{} loads, not {}", self.loads, other.loads));
        }
        if self.period != other.period {
            found.push(format!(
                "control period {} s, not {} s",
                self.period, other.period
            ));
        }
        if self.fingerprint != other.fingerprint {
            found.push(format!(
                "gains or other settings with fingerprint {:08x}, not {:08x}",
                self.fingerprint, other.fingerprint
            ));
        }
        found
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {} loads, control period {} s, fingerprint {:08x}",
            self.kind.name(),
            self.loads,
            self.period,
            self.fingerprint
        )
    }
}

/// The number that was meant: 0.001 and not 0.0010000000474974513.
pub(crate) fn short(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(value.into())
}
