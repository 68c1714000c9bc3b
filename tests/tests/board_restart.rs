//! The release ELF starts again in the midst of a motion, while the machine and the log go on.
#![cfg(feature = "virtual-board")]

use arso_tests::virtual_board::image::{FLASH, Image};
use arso_tests::virtual_board::rig::Switches;
use arso_tests::virtual_board::{Rig, Stop};
use host_sim::capture::read_defmt;
use host_sim::drive::{Drive, PlantFile};

/// A program that asks for a reset, behind the firmware's code:
/// `ldr r0, [pc, #4]; ldr r1, [pc, #8]; str r1, [r0]; b .`, and the two words.
const REQUEST: [u32; 4] = [0x4902_4801, 0xE7FE_6001, 0xE000_ED0C, 0x05FA_0004];

/// A rig, and where the program is.
fn start() -> (Rig, u32) {
    let mut image = Image::parse(&arso_tests::firmware()).unwrap();
    let used = image.flash.iter().rposition(|byte| *byte != 0xFF).unwrap();
    let at = (used + 1).next_multiple_of(16);
    let bytes = REQUEST.map(u32::to_le_bytes);
    image.flash[at..at + 16].copy_from_slice(bytes.as_flattened());
    let drive = Drive::default_drive();
    let rig = Rig::start(&image, &drive, &PlantFile::from(&drive), |_| {}).unwrap();
    (rig, FLASH + at as u32)
}

/// In the midst of a move.
fn moving() -> (Rig, u32) {
    let (mut rig, request) = start();
    rig.commission().unwrap();
    rig.switches(Switches::run(1));
    assert!(rig.periods(45).unwrap().pop().unwrap().enabled);
    (rig, request)
}

/// The amplifier is off, the encoder counts what the machine moves from here on, the log is whole, and the drive
/// is ready again.
fn goes_on(mut rig: Rig) {
    let resolution = Drive::default_drive().encoder.resolution;
    let position = |rig: &Rig| (rig.plant().state()[0] / resolution).round() as i64;
    let (begin, first) = (position(&rig), rig.board.bus().encoder.count() as u16);
    let mut most = 0;
    for period in rig.periods(300).unwrap() {
        assert!(!period.enabled);
    }
    for _ in 0..300 {
        rig.period().unwrap();
        let counted = rig.board.bus().encoder.count() as u16;
        let moved = position(&rig) - begin;
        assert_eq!(counted.wrapping_sub(first) as i16, moved as i16);
        most = moved.abs().max(most);
    }
    assert!(most > 100, "{most}");
    let capture = read_defmt(&arso_tests::firmware(), "firmware", &rig.log[..], |_| ()).unwrap();
    assert!(capture.malformed <= 1, "{}", capture.malformed);
    assert_eq!((capture.lost, capture.restarts.len()), (0, 1));
    let messages = capture.messages.iter();
    let ready = messages.filter(|message| message.starts_with("INFO drive ready"));
    assert_eq!(ready.count(), 2);
}

#[test]
fn firmware_that_asks_for_a_reset_starts_again() {
    let (mut rig, request) = moving();
    let position = rig.plant().state()[0];
    let now = rig.board.bus().now;
    rig.board.jump(request);
    // The run switch is closed still; the drive does not go on by itself.
    rig.switches(Switches::run(1));
    let period = rig.period().unwrap();
    assert_eq!((rig.resets, period.enabled), (1, false));
    assert!(rig.board.bus().now > now && (rig.plant().state()[0] - position).abs() < 0.01);
    goes_on(rig);
}

#[test]
fn a_power_cycle_starts_again() {
    let (mut rig, _) = moving();
    rig.power_cycle();
    assert!(!rig.period().unwrap().enabled);
    goes_on(rig);
}

/// What asks for a reset whenever it starts does not hang whoever runs it.
#[test]
fn a_reset_without_end_is_an_error() {
    let (mut rig, request) = start();
    rig.board.set_flash(4, &(request | 1).to_le_bytes());
    rig.board.jump(request);
    assert_eq!(rig.period(), Err(Stop::ResetRequested));
    assert_eq!(rig.resets, 1);
}
