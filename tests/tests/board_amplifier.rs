//! A drive with another amplifier: 5 A, 2.5 mA per code, no current at code 2080, a higher code is less current.
//! The firmware of the default drive has been told.
#![cfg(feature = "virtual-board")]

use arso_tests::virtual_board::harm::{Amplifier, Scale};
use arso_tests::virtual_board::image::Image;
use arso_tests::virtual_board::{Rig, Stop};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::simulate::corridor::settings_image;
use host_sim::simulate::scenario::Scenario;

fn start() -> (Rig, PlantFile) {
    let mut drive = Drive::default_drive();
    drive.actuator.current_limit = 5.0;
    drive.actuator.current_resolution = 2.5e-3;
    drive.actuator.zero_code = 2080;
    drive.actuator.inverted = true;
    let mut image = Image::parse(&arso_tests::firmware()).unwrap();
    let design = Design::new(&drive).unwrap();
    image.keep_settings(&settings_image(&design).unwrap());
    let plant = PlantFile::from(&drive);
    let rig = Rig::start(&image, &drive, &plant, |_| ()).unwrap();
    (rig, plant)
}

/// The load arrives, and the converter asks for just what the drive commands.
#[test]
fn a_drive_of_five_amperes_arrives() {
    let (mut rig, plant) = start();
    assert_eq!(rig.board.bus().current_reference(), Some(2080));
    rig.commission().expect("it commissions");
    let scenario = Scenario::named("fig3").unwrap();
    let periods = rig.experiment(scenario, &plant, 1200).unwrap();
    let state = rig.plant().state();
    for mass in 0..4 {
        assert!((state[2 * mass] - scenario.target).abs() < 20e-6, "{state}");
    }
    // A step forward begins with current forward: a lower code.
    let first = periods[0].code.unwrap();
    assert!(first < 2000, "{first}");
    assert_eq!(rig.board.bus().current_reference(), Some(2080));
}

/// With an amplifier of the default drive the signs are wrong: found before the loop is closed.
#[test]
fn another_amplifier_is_found() {
    let (mut rig, _) = start();
    rig.amplifier = Amplifier::new(Scale {
        step: 2.5e-3,
        zero_code: 2080.0,
    });
    assert!(matches!(rig.commission(), Err(Stop::NotCommissioned)));
    // It is left coasting, without friction, but slowly.
    assert!(rig.plant().state()[1].abs() < 0.5);
}
