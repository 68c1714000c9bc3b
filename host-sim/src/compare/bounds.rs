//! The bound of every plant of the comparison.

use super::{Case, cases, scenario};
use crate::design::Design;
use crate::simulate::bound::{Bound, bound};
use rayon::prelude::*;

/// The least time on each of [`cases`], in their order, found side by side; a current that comes late makes it
/// so much longer.
#[must_use]
pub fn bounds(design: &Design) -> Vec<Bound> {
    let of = |case: &Case| {
        let mut found = bound(&design.drive, &case.plant, scenario())?;
        // At rest at the start, nothing moves until the first current is there.
        let late = case.late as f64 * design.drive.control.sample_time;
        found.settled += late;
        found.rest += late;
        Ok(found)
    };
    cases(design).par_iter().map(of).collect()
}
