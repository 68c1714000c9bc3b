//! The release ELF on the virtual board, in closed loop with the plant of the simulation.
#![cfg(feature = "virtual-board")]

use arso_tests::virtual_board::image::Image;
use arso_tests::virtual_board::{Rig, Stop};
use host_sim::drive::{Drive, PlantFile};

fn image() -> Image {
    Image::parse(&std::fs::read(arso_tests::firmware_elf()).unwrap()).unwrap()
}

#[test]
fn smoke() {
    let drive = Drive::default_drive();
    let plant = PlantFile::from(&drive);
    let mut rig = match Rig::start(&image(), &drive, &plant, |_| {}) {
        Ok(rig) => rig,
        Err(stop) => panic!("{stop}"),
    };
    let go = |rig: &mut Rig, n| match rig.periods(n) {
        Ok(p) => p,
        Err(stop) => panic!("{stop}"),
    };
    println!("{:?}", go(&mut rig, 3));
    rig.switches(true, 1);
    let start = std::time::Instant::now();
    for _ in 0..10 {
        println!("{:?} {}", go(&mut rig, 30).last(), rig.plant().state()[4]);
    }
    println!("{:?} {:?} log {} stack {:?}", start.elapsed(), rig.board.interrupt_cost(), rig.log.len(), rig.board.stack_use());
    let _ = Stop::NoTick;
}
