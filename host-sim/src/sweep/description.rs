//! The file of a sweep, read and checked as far as it can be by itself.

use super::distribution::{Stated, WORDS};
use crate::error::{Error, Result};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;
use toml::{Spanned, Value};

/// Most samples, and longest runs, s.
const MOST: u64 = 1_000_000_000;
const LONGEST: f64 = 1000.0;
/// Evaluations for each rival: fewest and most.
const EVALUATIONS: std::ops::RangeInclusive<u64> = 20..=1_000_000;

/// Tables and keys as TOML has them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    seed: Option<Spanned<u64>>,
    samples: Option<Spanned<u64>>,
    drive: Option<String>,
    plant: Option<String>,
    step: Option<Spanned<f64>>,
    #[serde(rename = "move")]
    planned: Option<Spanned<f64>>,
    duration: Spanned<f64>,
    laws: Spanned<Vec<Spanned<String>>>,
    evaluations: Option<Spanned<u64>>,
    #[serde(default)]
    vary: BTreeMap<Spanned<String>, Value>,
}

/// How the drive goes, and how far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Way {
    /// By a raw step, m.
    Step(f64),
    /// By a planned move, m.
    Move(f64),
}

/// What a sweep file says.
pub(super) struct Description {
    name: String,
    text: String,
    /// Of all that is drawn.
    pub(super) seed: u64,
    /// How many are drawn for each point of the grid.
    pub(super) samples: u64,
    /// The drive file as it is named; the embedded one when it is not.
    pub(super) drive: Option<String>,
    /// The plant file; the drive itself when there is none.
    pub(super) plant: Option<String>,
    /// How it goes.
    pub(super) way: Way,
    /// Of each run, s.
    pub(super) duration: f64,
    /// The laws and where each stands.
    pub(super) laws: Vec<(String, Range<usize>)>,
    /// For each rival.
    pub(super) evaluations: usize,
    /// What varies, in the order of the names.
    pub(super) vary: Vec<Vary>,
}

/// A key that varies.
pub(super) struct Vary {
    /// As it is written.
    pub(super) key: String,
    /// Where it stands.
    pub(super) span: Range<usize>,
    /// How it varies.
    pub(super) stated: Stated,
}

impl Description {
    /// * `text`: TOML
    /// * `name`: of the file, for messages
    ///
    /// # Errors
    /// [`Error::Input`].
    pub(super) fn parse(text: &str, name: &str) -> Result<Self> {
        let place = Place { text, name };
        let raw: Raw = toml::from_str(text).map_err(|error| {
            place.error(error.span(), error.message().trim().replace('\n', "; "))
        })?;
        let way = match (&raw.step, &raw.planned) {
            (Some(step), None) => Way::Step(*step.get_ref()),
            (None, Some(planned)) => Way::Move(*planned.get_ref()),
            (Some(_), Some(planned)) => {
                let message = "step and move: only one of the two can be made".into();
                return Err(place.error(Some(planned.span()), message));
            }
            (None, None) => {
                return Err(place.error(None, "missing step or move: how far it goes".into()));
            }
        };
        let duration = *raw.duration.get_ref();
        if !(duration > 0.0 && duration <= LONGEST) {
            let message = format!("duration = {duration}: must be above 0 and at most {LONGEST} s");
            return Err(place.error(Some(raw.duration.span()), message));
        }
        let whole = |key: &str,
                     value: Option<&Spanned<u64>>,
                     otherwise: u64,
                     allowed: std::ops::RangeInclusive<u64>| {
            let Some(value) = value else {
                return Ok(otherwise);
            };
            if allowed.contains(value.get_ref()) {
                return Ok(*value.get_ref());
            }
            let (low, high) = allowed.into_inner();
            let message = format!("{key} = {}: must be from {low} to {high}", value.get_ref());
            Err(place.error(Some(value.span()), message))
        };
        let samples = whole("samples", raw.samples.as_ref(), 1, 1..=MOST)?;
        let evaluations = whole("evaluations", raw.evaluations.as_ref(), 400, EVALUATIONS)?;
        let laws: Vec<(String, Range<usize>)> = raw
            .laws
            .get_ref()
            .iter()
            .map(|law| (law.get_ref().clone(), law.span()))
            .collect();
        if laws.is_empty() {
            let message = "laws = []: must name one law at least".into();
            return Err(place.error(Some(raw.laws.span()), message));
        }
        for (k, (law, span)) in laws.iter().enumerate() {
            if laws[..k].iter().any(|(before, _)| before == law) {
                return Err(place.error(Some(span.clone()), format!("law \"{law}\" twice")));
            }
        }
        let vary = raw.vary.into_iter().map(|(key, value)| {
            let (span, key) = (key.span(), key.into_inner());
            let wrong =
                |why: &str| place.error(Some(span.clone()), format!("vary.\"{key}\": {why}"));
            let table = value.as_table().filter(|table| !table.is_empty());
            let table = table.ok_or_else(|| {
                wrong("must be a table with one of uniform, log_uniform, normal, choice, grid")
            })?;
            if table
                .keys()
                .all(|word| !WORDS.contains(&word.as_str()) && table[word].is_table())
            {
                return Err(wrong("a key with dots must stand in quotes"));
            }
            let stated = value
                .try_into::<Stated>()
                .map_err(|error| wrong(&error.message().trim().replace('\n', "; ")))?;
            Ok(Vary { key, span, stated })
        });
        let vary = vary.collect::<Result<Vec<_>>>()?;
        Ok(Self {
            name: name.into(),
            text: text.into(),
            seed: raw.seed.map_or(0, Spanned::into_inner),
            samples,
            drive: raw.drive,
            plant: raw.plant,
            way,
            duration,
            laws,
            evaluations: evaluations as usize,
            vary,
        })
    }

    /// What is wrong, and where.
    pub(super) fn error(&self, span: Option<&Range<usize>>, message: String) -> Error {
        let (text, name) = (&self.text[..], &self.name[..]);
        Place { text, name }.error(span.cloned(), message)
    }
}

/// A text and its name.
struct Place<'a> {
    text: &'a str,
    name: &'a str,
}

impl Place<'_> {
    fn error(&self, span: Option<Range<usize>>, message: String) -> Error {
        let before = span.and_then(|span| self.text.get(..span.start));
        let line = before.map(|before| 1 + before.matches('\n').count());
        Error::Input {
            place: line.map_or(self.name.into(), |line| format!("{}:{line}", self.name)),
            message,
        }
    }
}
