//! A thin slice of `move-campaign`: nothing rings, no limit is broken, nothing hunts or hangs.

use arso_tests::move_campaign::rest::{drives, plants};
use arso_tests::move_campaign::retargets::retargets;

#[test]
fn retargets_jogs_and_stops_arrive_without_vibration() {
    let found = retargets(200, 1);
    assert!(found.arrivals > 20 && found.passed(), "{found}");
}

#[test]
fn drives_with_friction_and_coarse_encoders_come_to_rest() {
    let found = drives(3, 1);
    assert_eq!((found.hunting(), found.hanging()), (0, 0), "{found}");
    assert!(found.failed.is_empty(), "{found}");
}

#[test]
fn friction_and_a_wrong_model_together_come_to_rest() {
    let found = plants(6, 1);
    assert_eq!((found.hunting(), found.hanging()), (0, 0), "{found}");
    assert!(found.failed.is_empty(), "{found}");
}
