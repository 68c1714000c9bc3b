//! Whether the actuator is where it may be.
//!
//! Only once zero is known: before, the drive has no idea where on the axis it stands. A drive that starts
//! outside its travel may move back into it, but no farther out.

use super::Trip;
use crate::fault::Fault;
use crate::units::{Place, Position, Travel};

/// Counts beyond the place where it starts that are holding it, not leaving.
const HOLDING: i64 = 50;

impl Travel {
    /// The travel of a run that starts at a place.
    pub(super) fn from(self, start: Place) -> Self {
        if self.contains(start) {
            return self;
        }
        let [below, above] =
            [-HOLDING, HOLDING].map(|counts| Place(start.0.saturating_add(counts)));
        Self {
            lowest: self.lowest.min(below),
            highest: self.highest.max(above),
        }
    }
}

/// * `from_zero`: the same place in metres
pub(super) fn step(travel: Option<Travel>, place: Place, from_zero: Position) -> Result<(), Trip> {
    match travel {
        Some(travel) if !travel.contains(place) => Err(Trip {
            fault: Fault::Travel,
            value: from_zero.0,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRAVEL: Travel = Travel {
        lowest: Place(-1000),
        highest: Place(200_000),
    };

    #[test]
    fn both_ends_belong_to_it() {
        for (place, inside) in [
            (-1001, false),
            (-1000, true),
            (0, true),
            (200_000, true),
            (200_001, false),
            (i64::MIN, false),
            (i64::MAX, false),
        ] {
            let place = Place(place);
            assert_eq!(
                step(Some(TRAVEL), place, Position(0.0)).is_ok(),
                inside,
                "{place:?}"
            );
            assert!(step(None, place, Position(0.0)).is_ok());
        }
    }

    #[test]
    fn a_start_outside_leads_back_in_alone() {
        assert_eq!(TRAVEL.from(Place(7)), TRAVEL);
        let travel = TRAVEL.from(Place(300_000));
        assert!(travel.contains(Place(300_010)) && travel.contains(Place(-1000)));
        assert!(!travel.contains(Place(300_100)) && !travel.contains(Place(-1001)));
        assert!(TRAVEL.from(Place(i64::MIN)).contains(Place(i64::MIN)));
    }
}
