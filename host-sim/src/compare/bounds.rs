//! The bound of every plant of the comparison.

use super::{cases, scenario};
use crate::design::Design;
use crate::simulate::bound::{Bound, bound};

/// The least time on each of [`cases`], in their order; a current that comes late makes it so much longer.
#[must_use]
pub fn bounds(design: &Design) -> Vec<Bound> {
    let period = design.drive.control.sample_time;
    let cases = cases(design);
    let each = cases.iter().map(|case| {
        let mut found = bound(&design.drive, &case.plant, scenario())?;
        // At rest at the start, nothing moves until the first current is there.
        let late = case.late as f64 * period;
        found.settled += late;
        found.rest += late;
        Ok(found)
    });
    each.collect()
}
