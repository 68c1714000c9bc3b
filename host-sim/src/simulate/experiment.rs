//! An experiment as it is asked for, a named one or planned moves, and all that its report needs.

use super::bound::{Bound, bound, bound_from};
use super::metrics::Metrics;
use super::scenario::Scenario;
use super::sequence::{Move, MoveSequence, simulate_moves};
use super::watch::{watched, watched_moves};
use super::{Law, Run, simulate};
use crate::design::Design;
use crate::drive::PlantFile;
use crate::error::Result;
use crate::machine::Kind;

/// Length of a named experiment, s.
const DURATION: f64 = 1.2;
/// Longest experiment, in control periods: every one is kept.
const LONGEST: f64 = 1e6;

/// Whether an experiment can be so long.
///
/// * `duration`, `period`: s
/// * `last`: when the last thing is asked for, s
///
/// # Errors
/// What it must be.
pub fn require_duration(duration: f64, period: f64, last: f64) -> std::result::Result<(), String> {
    // Written so that what is no number is refused.
    let long_enough = duration / period >= 2.0;
    if !long_enough {
        return Err(format!(
            "must be two control periods of {period} s at least"
        ));
    }
    if duration / period > LONGEST {
        return Err(format!(
            "must be {LONGEST} control periods of {period} s at most"
        ));
    }
    if last > 0.0 && duration <= last {
        return Err(format!("the last move begins at {last} s only"));
    }
    Ok(())
}

/// What is simulated.
#[derive(Clone, Debug)]
pub enum Experiment {
    /// One of [`SCENARIOS`](super::scenario::SCENARIOS).
    Named(&'static Scenario),
    /// Planned moves.
    Moves(MoveSequence),
}

/// Where a run is sent, and from when on.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    /// s.
    pub from: f64,
    /// m.
    pub target: f64,
}

/// One run, or the part of it that belongs to one of several moves, as it is judged.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Name of the experiment, or of the move.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// The move, and when it was asked for (s); none of a named experiment.
    pub asked: Option<(Move, f64)>,
    /// The control law.
    pub law: Law,
    /// Its figures.
    pub metrics: Metrics,
    /// The bound of its motion.
    pub bound: Bound,
}

/// An experiment under both laws.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// All of it under the core.
    pub core: Run,
    /// All of it with the true state fed back.
    pub full_state: Run,
    /// The figures, core first.
    pub judged: Vec<Judged>,
}

impl Experiment {
    /// Its name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Named(scenario) => scenario.name,
            Self::Moves(sequence) if sequence.moves().len() == 1 => "move",
            Self::Moves(_) => "moves",
        }
    }

    /// What it shows.
    #[must_use]
    pub fn title(&self, kind: Kind) -> String {
        match self {
            Self::Named(scenario) => scenario.title(kind),
            Self::Moves(sequence) => {
                let distances = sequence
                    .moves()
                    .iter()
                    .map(|one| milli(one.distance).to_string());
                let distances = distances.collect::<Vec<_>>().join(", ");
                format!("planned, by {distances} {}", kind.units().milli_position)
            }
        }
    }

    /// Its length where none is asked for, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        match self {
            Self::Named(_) => DURATION,
            Self::Moves(sequence) => sequence.duration(),
        }
    }

    /// Its targets, in order.
    #[must_use]
    pub fn aims(&self) -> Vec<Aim> {
        match self {
            Self::Named(scenario) => vec![Aim {
                from: 0.0,
                target: scenario.target,
            }],
            Self::Moves(sequence) => {
                let each = sequence.moves().iter().map(|one| Aim {
                    from: sequence.time(one),
                    target: one.target,
                });
                each.collect()
            }
        }
    }

    /// The core's run.
    ///
    /// # Errors
    /// As [`simulate`].
    pub fn simulate(&self, design: &Design, plant: &PlantFile, duration: f64) -> Result<Run> {
        match self {
            Self::Named(scenario) => simulate(design, plant, scenario, Law::Core, duration),
            Self::Moves(sequence) => simulate_moves(design, plant, sequence, Law::Core, duration),
        }
    }

    /// Both runs, watched for a while after their end, with their figures and bounds.
    ///
    /// # Errors
    /// As [`simulate`].
    pub fn judge(&self, design: &Design, plant: &PlantFile, duration: f64) -> Result<Outcome> {
        let kind = design.drive.kind;
        match self {
            Self::Named(scenario) => {
                let of = |law| watched(design, plant, scenario, law, duration);
                let (core, full_state) = (of(Law::Core)?, of(Law::FullState)?);
                let bound = bound(&design.drive, plant, scenario);
                let judged = [&core, &full_state].map(|(run, metrics)| Judged {
                    name: scenario.name.into(),
                    title: scenario.title(kind),
                    asked: None,
                    law: run.law,
                    metrics: metrics.clone(),
                    bound: bound.clone(),
                });
                Ok(Outcome {
                    core: core.0,
                    full_state: full_state.0,
                    judged: judged.into(),
                })
            }
            Self::Moves(sequence) => {
                let of = |law| watched_moves(design, plant, sequence, law, duration);
                let ((core, of_core), (full_state, of_full_state)) =
                    (of(Law::Core)?, of(Law::FullState)?);
                let mut judged = Vec::new();
                let moves = sequence.moves().iter().zip(of_core).zip(of_full_state);
                for (number, ((one, core), full_state)) in moves.enumerate() {
                    // From where the machine is when it is asked for.
                    let Some(start) = core.0.samples.first() else {
                        continue;
                    };
                    let bound = bound_from(&design.drive, plant, &start.truth, one.target);
                    let name = match sequence.moves().len() {
                        1 => "move".to_owned(),
                        _ => format!("move {}", number + 1),
                    };
                    let at = sequence.time(one);
                    let title = format!(
                        "planned, by {} to {} {}, asked for at {at:.3} s",
                        milli(one.distance),
                        milli(one.target),
                        kind.units().milli_position,
                    );
                    judged.extend([core, full_state].map(|(run, metrics)| Judged {
                        name: name.clone(),
                        title: title.clone(),
                        asked: Some((*one, at)),
                        law: run.law,
                        metrics,
                        bound: bound.clone(),
                    }));
                }
                Ok(Outcome {
                    core,
                    full_state,
                    judged,
                })
            }
        }
    }
}

/// A length in thousandths, with no more figures than it has.
fn milli(length: f64) -> f64 {
    (1e9 * length).round() / 1e6
}
