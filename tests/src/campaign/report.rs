//! The campaign as a table and as JSON.

use super::flips::Flip;
use super::outcome::{Outcome, Verdict};
use super::run::STOP_WITHIN;
use super::summary::Row;
use super::{GOAL_PERIODS, GOAL_TRAVEL, RUNAWAY_BEYOND, RUNAWAY_VELOCITY};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// What was found, and how.
pub struct Report<'a> {
    /// Name of the firmware.
    pub firmware: &'a str,
    /// Instants in motion, and as many at rest.
    pub instants: u32,
    /// One row per fault.
    pub rows: &'a [Row],
    /// Flipped bits.
    pub flips: &'a [Flip],
}

impl Report<'_> {
    fn outcomes(&self) -> impl Iterator<Item = &Outcome> {
        let runs = self.rows.iter().flat_map(Row::all);
        runs.chain(self.flips.iter().map(|flip| &flip.outcome))
    }

    /// Whether the drive ran away or could not be stopped in any run.
    #[must_use]
    pub fn dangerous(&self) -> bool {
        self.outcomes().any(|outcome| outcome.verdict.is_danger())
    }

    /// Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "# Fault campaign\n\n{}: {} faults at {} instants of a planned move of 30 mm and {} at rest.\n\n\
             Goal: off within {GOAL_PERIODS} periods of the fault or {:.0} mm of travel, whichever is later, for \
             every fault that removes control; no runaway (faster than {RUNAWAY_VELOCITY} m/s or farther than \
             {:.0} mm beyond the range of the motion, energised, no fault); off within {STOP_WITHIN} periods of opening the run switch (wanted: 1).\n\n",
            self.firmware,
            self.rows.len(),
            self.instants,
            self.instants,
            1e3 * GOAL_TRAVEL,
            1e3 * RUNAWAY_BEYOND,
        );
        text += "| fault | detected in motion | at rest | by | periods until off | travel until off [mm] | \
                 largest force [N] | largest velocity [m/s] | beyond the range [mm] | run switch to off \
                 [periods] | verdict | goal |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n";
        for row in self.rows {
            text += &line(row);
        }
        text += &self.flipped();
        text += &format!("\n{}\n", self.total());
        text
    }

    fn flipped(&self) -> String {
        if self.flips.is_empty() {
            return String::new();
        }
        let mut kinds = BTreeMap::<String, usize>::new();
        for flip in self.flips {
            let outcome = &flip.outcome;
            let code = outcome.code.as_ref();
            let kind = code.map_or(String::new(), |code| format!(", {code}"));
            let kind = format!("{}{kind}", outcome.verdict.name());
            *kinds.entry(kind).or_default() += 1;
        }
        let kinds: Vec<_> = kinds
            .iter()
            .map(|(kind, count)| format!("{count} {kind}"))
            .collect();
        let dangers = self
            .flips
            .iter()
            .filter(|flip| flip.outcome.verdict.is_danger());
        let dangers: Vec<_> = dangers
            .map(|flip| format!("{:#010x} bit {}", flip.address, flip.bit))
            .collect();
        let slowest = self
            .flips
            .iter()
            .filter_map(|flip| flip.outcome.stop_periods);
        format!(
            "\n{} bits of memory flipped, the run switch opened after 50 periods: {}; slowest stop {} periods{}{}.\n",
            self.flips.len(),
            kinds.join("; "),
            slowest.max().unwrap_or(0),
            if dangers.is_empty() {
                ""
            } else {
                "; dangerous: "
            },
            dangers.join(", "),
        )
    }

    fn total(&self) -> String {
        let counts = Verdict::ALL.map(|verdict| {
            let rows = self.rows.iter();
            let runs: usize = rows
                .clone()
                .map(|row| row.count(verdict).iter().sum::<usize>())
                .sum();
            let faults = rows.filter(|row| row.verdict() == verdict).count();
            format!("{}: {runs} runs, worst of {faults} faults", verdict.name())
        });
        let met = self.rows.iter().filter(|row| row.meets_goal()).count();
        let stops = self.outcomes().filter_map(|outcome| outcome.stop_periods);
        format!(
            "{}. Goal met for {met} of {} faults. Slowest stop by the run switch: {} periods.",
            counts.join("; "),
            self.rows.len(),
            stops.max().unwrap_or(0),
        )
    }

    /// For other programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let flips = self.flips.iter().map(|flip| {
            json!({
                "address": flip.address,
                "bit": flip.bit,
                "period": flip.period,
                "outcome": flip.outcome.json(),
            })
        });
        json!({
            "firmware": self.firmware,
            "instants": self.instants,
            "faults": self.rows.iter().map(Row::json).collect::<Vec<_>>(),
            "flips": flips.collect::<Vec<_>>(),
            "dangerous": self.dangerous(),
        })
    }
}

fn line(row: &Row) -> String {
    let detected = row.count(Verdict::Detected);
    let detected = [0, 1].map(|part| format!("{}/{}", detected[part], row.runs[part].len()));
    let codes: Vec<_> = row
        .codes()
        .iter()
        .map(|(code, count)| format!("{code} {count}"))
        .collect();
    let off = |outcome: &Outcome| outcome.verdict == Verdict::Detected;
    let millimetres =
        |metres: Option<f64>| metres.map_or(String::new(), |x| format!("{:.2}", 1e3 * x));
    let whole = |number: Option<u32>| number.map_or(String::new(), |n| n.to_string());
    format!(
        "| {} | {} | {} | {} | {} | {} | {:.1} | {:.2} | {} | {} | {} | {} |\n",
        row.name,
        detected[0],
        detected[1],
        codes.join(", "),
        whole(row.worst(|o| o.periods.filter(|_| off(o)))),
        millimetres(row.worst(|o| off(o).then_some(o.travel))),
        row.worst(|o| Some(o.force)).unwrap_or(0.0),
        row.worst(|o| Some(o.velocity)).unwrap_or(0.0),
        millimetres(row.worst(|o| Some(o.beyond))),
        whole(row.worst(|o| o.stop_periods)),
        verdicts(row),
        if row.meets_goal() { "met" } else { "missed" },
    )
}

/// The worst verdict, and how often it came in motion and at rest.
fn verdicts(row: &Row) -> String {
    let worst = row.verdict();
    let [moving, resting] = row.count(worst);
    if moving + resting == row.all().count() {
        worst.name().into()
    } else {
        format!("{} ({moving} in motion, {resting} at rest)", worst.name())
    }
}
