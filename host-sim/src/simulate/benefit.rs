//! What new gains buy: the same planned move on the same machine with the old ones and with them, and the least
//! time in which any control could do it.

use super::Law;
use super::bound::{Bound, bound_from};
use super::metrics::Metrics;
use super::scenario::Scenario;
use super::sequence::MoveSequence;
use super::watch::watched_moves;
use crate::design::Design;
use crate::design::assessment::require_sound_at_first_look;
use crate::drive::PlantFile;
use crate::error::{Error, Result};
use crate::machine::chain_of;

/// Old and new gains on one machine.
#[derive(Debug)]
pub struct Benefit {
    /// The move, m.
    pub distance: f64,
    /// With the old gains; or why they cannot make it.
    pub before: Result<Metrics>,
    /// With the new ones.
    pub after: Metrics,
    /// Of any control.
    pub bound: Bound,
}

impl Benefit {
    /// Simulates the move with both.
    ///
    /// * `old`, `new`: the designs; the old one may be refused, or none
    /// * `plant`: what is there
    /// * `distance`: m
    ///
    /// # Errors
    /// Where the new design cannot make the move; [`Error::Parameter`] for a distance that is none.
    pub fn new(
        old: std::result::Result<&Design, &Error>,
        new: &Design,
        plant: &PlantFile,
        distance: f64,
    ) -> Result<Self> {
        let (after, distance) = moved(new, plant, distance)?;
        let before = match old {
            Ok(old) => {
                require_sound_at_first_look(old).and_then(|()| Ok(moved(old, plant, distance)?.0))
            }
            Err(error) => Err(Error::Design(match error {
                Error::Design(why) => why.clone(),
                other => other.to_string(),
            })),
        };
        let chain = chain_of(&plant.actuator, &plant.loads, plant.friction.viscous);
        let start = Scenario::PLANNED.initial_state(&chain);
        Ok(Self {
            distance,
            before,
            after,
            bound: bound_from(&new.drive, plant, &start, distance),
        })
    }
}

/// A planned move, watched after its end, and its distance in whole counts, m.
fn moved(design: &Design, plant: &PlantFile, distance: f64) -> Result<(Metrics, f64)> {
    let sequence = MoveSequence::new(design, &[distance], &[])?;
    let (_, parts) = watched_moves(design, plant, &sequence, Law::Core, sequence.duration())?;
    let metrics = parts.into_iter().next_back().map(|part| part.1);
    let metrics = metrics.ok_or_else(|| Error::Simulation("there was no move".into()))?;
    let distance = sequence
        .moves()
        .first()
        .map_or(distance, |one| one.distance);
    Ok((metrics, distance))
}
