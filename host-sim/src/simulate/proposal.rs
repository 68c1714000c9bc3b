//! Gains for a machine that was learned, tried before they are proposed.

use super::benefit::Benefit;
use super::scenario::Scenario;
use super::stillness::stillness;
use crate::design::Design;
use crate::design::assessment::sound;
use crate::design::checks::Check;
use crate::drive::{Drive, PlantFile};
use crate::error::{Error, Result};

/// Gains for a machine, once they have shown that they can move it.
#[derive(Debug)]
pub struct Proposal {
    /// The gains.
    pub design: Design,
    /// What is to be said of them.
    pub checks: Vec<Check>,
    /// What they buy.
    pub benefit: Benefit,
}

impl Proposal {
    /// Designs for a machine, and moves it with the old gains and the new ones.
    ///
    /// * `old`: the design that it has, which may be refused, or none
    /// * `drive`: the machine as it was learned
    /// * `distance`: of the move, m; none: [`usual_distance`]
    ///
    /// # Errors
    /// As [`Design::new`], [`sound`] and [`Benefit::new`]; [`Error::Design`] where the drive would stop itself.
    pub fn new(
        old: std::result::Result<&Design, &Error>,
        drive: &Drive,
        distance: Option<f64>,
    ) -> Result<Self> {
        let design = Design::new(drive)?;
        let mut checks = sound(&design)?;
        checks.push(stillness(&design)?);
        let distance = distance.unwrap_or_else(|| usual_distance(drive));
        let benefit = Benefit::new(old, &design, &PlantFile::from(drive), distance)?;
        if let Some(fault) = benefit.after.fault {
            return Err(Error::Design(format!(
                "with the new gains the drive stops with fault {fault} in the planned move"
            )));
        }
        Ok(Self {
            design,
            checks,
            benefit,
        })
    }
}

/// The planned move of the experiments, or as much as the travel has room for from the origin, m.
#[must_use]
pub fn usual_distance(drive: &Drive) -> f64 {
    let usual = Scenario::PLANNED.target;
    match drive.protection.travel {
        Some([lowest, highest]) if highest < usual && -lowest > highest => lowest.max(-usual),
        Some([_, highest]) => highest.min(usual),
        None => usual,
    }
}
