//! What a sweep came to, law by law, gathered from rows as they pass.
//!
//! Settling times are whole control periods: how often each occurs takes as much memory for a million samples as
//! for a thousand.

use super::file::{Header, Identity};
use super::rows::{FAILURE, FAULT, LAW, SETTLING};
use super::shard::Shard;
use super::table::{Column, Schema, Table};
use crate::compare::Spread;
use serde::Serialize;
use std::collections::BTreeMap;

/// What came of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Of the program.
    pub version: String,
    /// Of the files that describe the sweep.
    pub sha256: String,
    /// Of all that is drawn.
    pub seed: u64,
    /// Which part, and of how many.
    pub shard: [u64; 2],
    /// Samples in it.
    pub samples: u64,
    /// Law by law.
    pub laws: Vec<OfLaw>,
}

/// What a law came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfLaw {
    /// Which.
    pub law: String,
    /// Settling time over all samples, s; what does not settle is longer than all.
    pub settling_time: Spread,
    /// Samples on which it does not settle, those that fault or fail among them.
    pub not_settled: u64,
    /// On which the drive stopped itself.
    pub faults: u64,
    /// On which there was no run.
    pub failed: u64,
    /// Why, on the first of them.
    pub failure: Option<String>,
}

/// Counts of one law.
#[derive(Default)]
struct Counts {
    /// How often each settling time occurs, by its bits: they are in the order of the times.
    settled: BTreeMap<u64, u64>,
    not_settled: u64,
    faults: u64,
    failed: u64,
    failure: Option<String>,
}

/// Gathers.
#[derive(Default)]
pub(super) struct Gathered {
    laws: Vec<(String, Counts)>,
}

impl Gathered {
    /// Looks at rows as they pass.
    pub(super) fn see(&mut self, schema: &Schema, rows: &Table) {
        let column = |wanted: &str| {
            let at = schema.iter().position(|(name, _)| name == wanted)?;
            rows.columns.get(at)
        };
        let (
            Some(Column::Text(laws)),
            Some(Column::Number(settled)),
            Some(Column::Integer(faults)),
            Some(Column::Text(failures)),
        ) = (
            column(LAW),
            column(SETTLING),
            column(FAULT),
            column(FAILURE),
        )
        else {
            return;
        };
        for (k, law) in laws.iter().enumerate() {
            let law = law.as_deref().unwrap_or_default();
            let at = self.laws.iter().position(|(name, _)| name == law);
            let at = at.unwrap_or_else(|| {
                self.laws.push((law.to_owned(), Counts::default()));
                self.laws.len() - 1
            });
            let counts = &mut self.laws[at].1;
            counts.faults += u64::from(faults[k].is_some());
            counts.failed += u64::from(failures[k].is_some());
            if counts.failure.is_none() {
                counts.failure.clone_from(&failures[k]);
            }
            match settled[k].filter(|_| faults[k].is_none()) {
                Some(time) => *counts.settled.entry(time.to_bits()).or_default() += 1,
                None => counts.not_settled += 1,
            }
        }
    }

    /// All of it.
    pub(super) fn summary(self, header: &Header) -> Summary {
        let Identity {
            version,
            sha256,
            seed,
            ..
        } = header.identity.clone();
        let shard: Shard = header.shard;
        let laws = self.laws.into_iter().map(|(law, counts)| OfLaw {
            law,
            settling_time: counts.spread(),
            not_settled: counts.not_settled,
            faults: counts.faults,
            failed: counts.failed,
            failure: counts.failure,
        });
        Summary {
            version,
            sha256,
            seed,
            shard: [shard.number(), shard.of()],
            samples: header.samples.end - header.samples.start,
            laws: laws.collect(),
        }
    }
}

impl Counts {
    fn spread(&self) -> Spread {
        let all = self.not_settled + self.settled.values().sum::<u64>();
        // The smallest time that the share keeps.
        let quantile = |hundredths: u64| {
            let rank = (u128::from(all) * u128::from(hundredths)).div_ceil(100) as u64;
            let mut passed = 0;
            let found = self.settled.iter().find(|(_, count)| {
                passed += *count;
                passed >= rank
            });
            found.map(|(bits, _)| f64::from_bits(*bits))
        };
        Spread {
            median: quantile(50),
            most: quantile(95),
            worst: quantile(100),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::table::{Cell, Kind};
    use super::*;

    /// The same as over a sorted list of all, whatever share does not settle.
    #[test]
    fn spreads_are_those_of_the_sorted_list() {
        let schema: Schema = vec![
            (LAW.into(), Kind::Text),
            (SETTLING.into(), Kind::Number),
            (FAULT.into(), Kind::Integer),
            (FAILURE.into(), Kind::Text),
        ];
        for count in [1_u64, 19, 20, 21, 100, 333] {
            for lost in [0, 1, count / 10, count] {
                let times: Vec<Option<f64>> = (0..count)
                    .map(|k| (k >= lost).then(|| ((k * 7919) % 97) as f64 * 1e-3))
                    .collect();
                let mut table = Table::new(&schema);
                for time in &times {
                    table.push(vec![
                        Cell::Text(Some("PD".into())),
                        Cell::Number(*time),
                        Cell::Integer(None),
                        Cell::Text(None),
                    ]);
                }
                let mut gathered = Gathered::default();
                gathered.see(&schema, &table);
                let found = gathered.laws.pop().unwrap().1;
                assert_eq!(found.spread(), Spread::of(&times), "{count} {lost}");
                assert_eq!(found.not_settled, lost);
            }
        }
    }
}
