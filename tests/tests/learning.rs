//! One ordinary move teaches the drive, thinned; whole: `learn-campaign`.

use arso_tests::learning::{degradation, imperfections, lessons, wide};
use host_sim::design::Design;
use host_sim::drive::{DEFAULT_DRIVE, Drive};

const SEED: u64 = 7;
const DISTANCE: f64 = 0.03;

/// From the record of a first move with gains that do not fit, the second settles near the plant's own bound.
#[test]
fn the_second_move_settles_near_the_bound() {
    let drive = Drive::default_drive();
    let design = Design::new(&drive).unwrap();
    let all = lessons(&design, DEFAULT_DRIVE, &wide(&drive, 2, SEED), DISTANCE).unwrap();
    assert_eq!(all.learned(), 2, "{all}");
    assert!(all.second_over_bound() <= 1.2, "{all}");
}

/// Of what the model may lack, tried here; the campaign tries all.
const TRIED: [&str; 3] = ["lag 0.5 ms", "load friction 0.05 N", "backlash 100 um"];

/// What the model lacks is found, or refused, but never given as something else.
#[test]
fn nothing_that_real_machines_have_gives_a_wrong_machine() {
    let drive = Drive::default_drive();
    let design = Design::new(&drive).unwrap();
    let plants = wide(&drive, 1, SEED);
    let tried = |name: &str| TRIED.contains(&name);
    for imperfection in imperfections().iter().filter(|one| tried(one.name)) {
        let all = degradation(&design, &plants, DISTANCE, imperfection).unwrap();
        assert!(all.wrong.is_empty(), "{}: {all:?}", imperfection.name);
    }
}
