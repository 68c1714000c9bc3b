//! What is generated is up to date: gains and excitation in the firmware are those of the default drive,
//! and the faults in the README those of the core.

use arso_core::fault::Reaction;
use host_sim::design::Design;
use host_sim::drive::{DEFAULT_NAME, Drive};
use host_sim::excite::{ExcitationPlan, ExcitationRequest, excitation_file};
use host_sim::simulate::corridor::gains_source;

// The firmware's own files: that they compile against the core is part of the test.
#[path = "../../firmware/src/excitation.rs"]
mod excitation;
#[path = "../../firmware/src/gains.rs"]
mod gains;

#[test]
fn the_firmware_has_the_gains_of_the_default_drive() {
    let design = Design::new(&Drive::default_drive()).unwrap();
    let current = include_str!("../../firmware/src/gains.rs");
    assert!(
        gains_source(&design, DEFAULT_NAME).unwrap() == current,
        "firmware/src/gains.rs is not what the default drive designs: \
         run `cargo run --release -- design --rust firmware/src/gains.rs`"
    );
    assert_eq!(
        gains::GAINS,
        design.settings(gains::Observer::new, &design.protection())
    );
    assert_eq!(gains::PLANS, design.plans().unwrap().plans());
    assert_eq!(gains::KIND, design.drive.kind.name());
}

#[test]
fn the_firmware_has_the_excitation_of_the_default_drive() {
    let drive = Drive::default_drive();
    let play = ExcitationPlan::new(&drive, &ExcitationRequest::default()).unwrap();
    let current = include_str!("../../firmware/src/excitation.rs");
    assert!(
        excitation_file(&play, &drive, DEFAULT_NAME) == current,
        "firmware/src/excitation.rs is not what the default drive is excited with: \
         run `cargo run --release -- excite --rust firmware/src/excitation.rs`"
    );
    assert_eq!(excitation::EXCITATION.profile, play.table);
    assert_eq!(excitation::EXCITATION.repetitions, play.repetitions);
    assert_eq!(excitation::SAMPLE_TIME, gains::GAINS.sample_time);
}

/// The README's table of faults is the core's.
#[test]
fn the_readme_lists_every_fault() {
    let readme = include_str!("../../README.md");
    for fault in arso_core::Fault::ALL {
        let stop = match fault.reaction() {
            Reaction::Off => "off at once",
            Reaction::Brake => "off after braking",
        };
        let key = fault
            .setting()
            .map_or(String::new(), |key| format!("`{key}`"));
        let row = format!(
            "| {} `{}` | {} | {stop} | {key} |\n",
            fault.number(),
            fault.name(),
            fault.sentence(),
        );
        assert!(readme.contains(&row), "README.md has no row {row}");
    }
}
