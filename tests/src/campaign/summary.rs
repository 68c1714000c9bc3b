//! All runs of one fault in a row.

use super::faults::{FAULTS, Named};
use super::outcome::{Outcome, Verdict};
use super::run::run;
use super::stage::{Instant, Stage};
use super::workers::share;
use crate::virtual_board::Stop;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// All runs of one fault.
pub struct Row {
    /// The fault.
    pub name: &'static str,
    /// Those in motion, and those at rest.
    pub runs: [Vec<Outcome>; 2],
}

/// The whole campaign, the same on any number of threads.
///
/// # Errors
/// Whatever stops the firmware before anything is broken.
pub fn campaign(stage: &Stage, faults: &[Named], threads: usize) -> Result<Vec<Row>, Stop> {
    let mut work = Vec::new();
    for (number, fault) in faults.iter().enumerate() {
        let instants = stage.instants.iter().step_by(fault.every());
        work.extend(instants.map(|instant| (number, fault, instant)));
    }
    let outcomes = share(
        work.len(),
        threads,
        || stage.rig(),
        |number, rig| {
            let (_, fault, instant) = work[number];
            run(fault.fault, seed(fault, instant), instant, stage, rig)
        },
    )?;
    let mut rows: Vec<Row> = faults.iter().map(|fault| Row::new(fault.name)).collect();
    for ((fault, _, instant), outcome) in work.iter().zip(outcomes) {
        rows[*fault].runs[usize::from(!instant.moving)].push(outcome);
    }
    Ok(rows)
}

/// Chance differs between faults and instants, and for the same two it does not.
fn seed(fault: &Named, instant: &Instant) -> u64 {
    let name = fault.name.bytes().map(u64::from);
    name.fold(instant.period.into(), |seed, byte| {
        seed.wrapping_mul(31).wrapping_add(byte)
    })
}

/// The faults whose names contain a word; all for an empty one.
#[must_use]
pub fn faults_named(word: &str) -> Vec<Named> {
    let faults = FAULTS.iter().copied();
    faults.filter(|fault| fault.name.contains(word)).collect()
}

impl Row {
    fn new(name: &'static str) -> Self {
        let runs = [Vec::new(), Vec::new()];
        Self { name, runs }
    }

    /// Every run.
    pub fn all(&self) -> impl Iterator<Item = &Outcome> {
        self.runs.iter().flatten()
    }

    /// The worst that came of it.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let verdicts = self.all().map(|outcome| outcome.verdict);
        verdicts.max().unwrap_or(Verdict::Tolerated)
    }

    /// How many runs ended in a verdict, in motion and at rest.
    #[must_use]
    pub fn count(&self, verdict: Verdict) -> [usize; 2] {
        let is = |outcome: &&Outcome| outcome.verdict == verdict;
        [0, 1].map(|part| self.runs[part].iter().filter(is).count())
    }

    /// What switched the amplifier off, and how often.
    #[must_use]
    pub fn codes(&self) -> BTreeMap<&str, usize> {
        let mut codes = BTreeMap::new();
        for code in self.all().filter_map(|outcome| outcome.code.as_deref()) {
            *codes.entry(code).or_default() += 1;
        }
        codes
    }

    /// The largest of a value over all runs that have one.
    pub fn worst<T: PartialOrd>(&self, value: impl Fn(&Outcome) -> Option<T>) -> Option<T> {
        let values = self.all().filter_map(value);
        values.reduce(|most, value| if value > most { value } else { most })
    }

    /// Whether every run did what is wanted.
    #[must_use]
    pub fn meets_goal(&self) -> bool {
        self.all().all(Outcome::meets_goal)
    }

    /// For other programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let runs = |runs: &[Outcome]| runs.iter().map(Outcome::json).collect::<Vec<_>>();
        json!({
            "fault": self.name,
            "verdict": self.verdict().name(),
            "meets_goal": self.meets_goal(),
            "codes": self.codes(),
            "in_motion": runs(&self.runs[0]),
            "at_rest": runs(&self.runs[1]),
        })
    }
}
