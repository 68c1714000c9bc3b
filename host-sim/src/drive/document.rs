//! A drive or plant file: its text and name, the place of every value in it, and the checks of single
//! values, with a message that names file, line, key, value and what is allowed.

use super::schema::{Number, RawFile};
use crate::error::{Error, Result};
use crate::machine::{Kind, Units};
use std::ops::Range;
use std::path::Path;
use toml::Spanned;

pub(super) fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(Error::read(path))
}

/// Numbers beyond this are slips of the pen; within it nothing overflows in the design.
pub(super) const LARGEST: f64 = 1e9;
pub(super) const SMALLEST: f64 = 1e-9;

/// A file's text and name: turns spans into places.
pub(super) struct Document<'a> {
    text: &'a str,
    name: &'a str,
    kind: Kind,
}

impl<'a> Document<'a> {
    /// Reads a file as far as TOML and the kind of drive go.
    pub(super) fn open(text: &'a str, name: &'a str) -> Result<(Self, RawFile)> {
        let mut document = Self {
            text,
            name,
            kind: Kind::default(),
        };
        let raw: RawFile = toml::from_str(text).map_err(|error| {
            let mut message = error.message().trim().replace('\n', "; ");
            if error
                .span()
                .is_some_and(|span| document.decimal_comma(span.start))
            {
                message = "a number has a decimal point, not a comma".into();
            } else if message.starts_with("invalid type") {
                // Fields that are missing or unknown are named, those with a wrong value are not.
                let assigned = error.span().and_then(|span| document.assigned(span.start));
                message = assigned.map_or(message.clone(), |(key, _)| format!("{key}: {message}"));
            }
            document.error(error.span(), message)
        })?;
        if let Some(kind) = &raw.kind {
            document.kind = document.one_of(
                "kind",
                kind,
                &[("linear", Kind::Linear), ("rotary", Kind::Rotary)],
            )?;
        }
        Ok((document, raw))
    }

    /// Linear or rotary.
    pub(super) fn kind(&self) -> Kind {
        self.kind
    }

    pub(super) fn units(&self) -> &'static Units {
        self.kind.units()
    }

    /// A word that must be one of two or more.
    pub(super) fn one_of<T: Copy>(
        &self,
        key: &str,
        word: &Spanned<String>,
        allowed: &[(&str, T)],
    ) -> Result<T> {
        let found = allowed.iter().find(|(name, _)| name == word.get_ref());
        found.map(|(_, value)| *value).ok_or_else(|| {
            let names: Vec<_> = allowed
                .iter()
                .map(|(name, _)| format!("\"{name}\""))
                .collect();
            let message = format!(
                "{key} = \"{}\": must be {}",
                word.get_ref(),
                names.join(" or ")
            );
            self.error(Some(word.span()), message)
        })
    }

    /// Key and value of the line at this byte.
    fn assigned(&self, at: usize) -> Option<(&'a str, &'a str)> {
        let before = self.text.get(..at)?;
        let line = self.text.lines().nth(before.matches('\n').count())?;
        let (key, value) = line.split_once('=')?;
        Some((key.trim(), value.trim()))
    }

    /// Whether the line at this byte gives a key a number with a comma.
    fn decimal_comma(&self, at: usize) -> bool {
        let value = self.assigned(at).map_or("", |(_, value)| value);
        let value = value.split('#').next().unwrap_or("").trim();
        value.matches(',').count() == 1 && value.replace(',', ".").parse::<f64>().is_ok()
    }

    /// `file:line`, as far as known.
    pub(super) fn place(&self, span: Option<Range<usize>>) -> String {
        match span {
            Some(span) => {
                let before = self.text.get(..span.start).unwrap_or(self.text);
                let line = 1 + before.matches('\n').count();
                format!("{}:{line}", self.name)
            }
            None => self.name.to_owned(),
        }
    }

    pub(super) fn error(&self, span: Option<Range<usize>>, message: String) -> Error {
        Error::Input {
            place: self.place(span),
            message,
        }
    }

    pub(super) fn missing(&self, table: &str) -> Error {
        self.error(None, format!("missing table {table}"))
    }

    pub(super) fn checked(
        &self,
        key: &str,
        value: &Number,
        ok: bool,
        allowed: &str,
    ) -> Result<f64> {
        let number = *value.get_ref();
        if ok {
            Ok(number)
        } else {
            let message = format!("{key} = {number}: must be {allowed}");
            Err(self.error(Some(value.span()), message))
        }
    }

    pub(super) fn positive(&self, key: &str, value: &Number, unit: &str) -> Result<f64> {
        let number = *value.get_ref();
        let ok = (SMALLEST..=LARGEST).contains(&number);
        self.checked(
            key,
            value,
            ok,
            &format!("from {SMALLEST:e} to {LARGEST:e} {unit}"),
        )
    }

    pub(super) fn not_negative(
        &self,
        key: &str,
        value: Option<&Number>,
        unit: &str,
    ) -> Result<f64> {
        let Some(value) = value else { return Ok(0.0) };
        let number = *value.get_ref();
        let ok = (0.0..=LARGEST).contains(&number);
        self.checked(key, value, ok, &format!("from 0 to {LARGEST:e} {unit}"))
    }

    pub(super) fn deviation(
        &self,
        key: &str,
        value: Option<&Number>,
        nominal: f64,
        unit: &str,
    ) -> Result<f64> {
        let Some(value) = value else { return Ok(0.0) };
        let number = *value.get_ref();
        let ok = number.is_finite() && number.abs() <= 0.9 * nominal;
        let allowed = format!("within 90 % of the nominal {nominal} {unit}");
        self.checked(key, value, ok, &allowed)
    }
}
