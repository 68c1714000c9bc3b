//! The bound of every plant of the comparison.

use super::{Case, cases, scenario};
use crate::design::Design;
use crate::error::NoSolution;
use crate::simulate::bound::{Bound, bound};
use std::thread;

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
    let of = &of;
    let cases = cases(design);
    thread::scope(|scope| {
        let each = cases.iter().map(|case| scope.spawn(move || of(case)));
        let each: Vec<_> = each.collect();
        let ended = |_| NoSolution("the search for the least time ended by itself".into());
        each.into_iter()
            .map(|search| search.join().unwrap_or_else(|why| Err(ended(why))))
            .collect()
    })
}
