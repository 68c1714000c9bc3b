//! The gains in the firmware are those of the default drive.

use host_sim::corridor::gains_source;
use host_sim::design::Design;
use host_sim::drive::{DEFAULT_NAME, Drive};

// The firmware's own file: that it compiles against the core is part of the test.
#[path = "../../firmware/src/gains.rs"]
mod gains;

#[test]
fn the_firmware_has_the_gains_of_the_default_drive() {
    let design = Design::new(&Drive::default_drive()).unwrap();
    let current = include_str!("../../firmware/src/gains.rs");
    assert!(
        gains_source(&design, DEFAULT_NAME) == current,
        "firmware/src/gains.rs is not what the default drive designs: \
         run `cargo run --release -- design --rust firmware/src/gains.rs`"
    );
    assert_eq!(
        gains::GAINS,
        design.gains::<{ gains::LOADS }, { gains::STATES }>()
    );
}
