//! The whole loop on the virtual board: firmware with the wrong gains moves a machine, its log is learned from, and
//! with settings made of that it moves the machine near its own limit. `tests/learn-on-board` does all but the last
//! move.
#![cfg(feature = "virtual-board")]

use arso_tests::virtual_board::Rig;
use arso_tests::virtual_board::image::Image;
use host_sim::chain::controlled_mass;
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile, SETTLING_BAND};
use host_sim::simulate::bound::bound;
use host_sim::simulate::corridor::settings_image;
use host_sim::simulate::scenario::Scenario;

const PERIODS: usize = 1200;
/// Settling time over the least that the machine allows.
const NEAR: f64 = 1.2;

/// When the controlled mass has come to stay, s, by what the machine beside the board does.
fn settling_time(image: &Image, drive: &Drive, plant: &PlantFile) -> f64 {
    let mut rig = Rig::start(image, drive, plant, |_| ()).unwrap();
    rig.commission().unwrap();
    let scenario = Scenario::named("move").unwrap();
    rig.begin(scenario, plant).unwrap();
    let mass = controlled_mass(drive.loads.len());
    let outside = (0..PERIODS).filter(|_| {
        assert!(rig.period().unwrap().enabled);
        let off = rig.plant().state()[2 * mass] - scenario.target;
        off.abs() > SETTLING_BAND * scenario.target
    });
    let last = outside.last().expect("it begins away from its target");
    assert!(last + 1 < PERIODS, "it does not settle");
    (last + 1) as f64 * drive.control.sample_time
}

#[test]
fn what_was_learned_moves_the_machine_near_its_limit() {
    let directory = arso_tests::built("learn-on-board");
    let built = "run tests/learn-on-board";
    let plant = PlantFile::load(&directory.join("plant.toml")).expect(built);
    let learned = Drive::load(Some(&directory.join("learned.toml"))).expect(built);
    let firmware = Image::parse(&arso_tests::firmware()).unwrap();
    let mut taught = firmware.clone();
    let design = Design::new(&learned).unwrap();
    taught.keep_settings(&settings_image(&design).unwrap());
    let scenario = Scenario::named("move").unwrap();
    let bound = bound(&learned, &plant, scenario).unwrap().settled;

    let first = settling_time(&firmware, &Drive::default_drive(), &plant);
    let second = settling_time(&taught, &learned, &plant);
    println!("bound {bound:.3} s, first move {first:.3} s, second {second:.3} s");
    // Otherwise there would have been nothing to learn.
    assert!(first > 1.5 * bound, "{first} {bound}");
    assert!(second <= NEAR * bound, "{second} {bound}");
}
