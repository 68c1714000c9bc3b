//! The core's step on a second Cortex-M4F emulator, QEMU (its machine `netduinoplus2` has the
//! memory map of the drive; none of its peripherals are used), over a recording: bit-identical to this
//! machine's `f32`. (`board_log.rs` shows the same for the release ELF on the virtual board.)
#![cfg(feature = "virtual-board")]

use arso_core::observer::Anchored;
use arso_core::{Controller, Counts, Current, Measurement, Mode, Place, Request};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::simulate::plant::Plant;
use std::process::Command;

/// Inputs of a drive from reset through commissioning to the end of a 30 mm step, in the format of
/// `tests/second-opinion`, and the bits that the core on this machine answers.
fn recording() -> (Vec<u8>, Vec<u32>) {
    let drive = Drive::default_drive();
    let design = Design::new(&drive).unwrap();
    let settings = design.settings(Anchored::<3, 9>::new, &design.protection());
    let mut controller = Controller::new(&settings, design.plans().unwrap().plans()).unwrap();
    let mut plant = Plant::new(&PlantFile::from(&drive), drive.control.sample_time);
    let (mut input, mut answer) = (Vec::new(), Vec::new());
    let mut current: Current = Current(0.0);
    let mut request = Some((1_u16, Request::Commission));
    let mut left = None;
    while left != Some(0) {
        let count = plant.count() as u16;
        input.extend(request.map_or(0, |(code, _)| code).to_le_bytes());
        input.extend(count.to_le_bytes());
        input.extend(current.0.to_le_bytes());
        if let Some((_, request)) = request {
            controller.request(request).unwrap();
        }
        let count = Counts(count.into());
        current = controller
            .step(Measurement {
                count,
                current,
                home: false,
            })
            .current;
        let record = controller.telemetry();
        answer.extend([current.0.to_bits(), record.reaction_force.to_bits()]);
        let loads = record.load_position.iter().chain(&record.load_velocity);
        answer.extend(loads.map(|value| value.to_bits()));
        plant.advance(current.0.into()).unwrap();
        request = match (request, controller.mode(), left) {
            (_, Mode::Ready, None) => Some((2, Request::Start)),
            (Some((2, _)), _, _) => Some((3, Request::Step(Place(30_000)))),
            _ => None,
        };
        if let Some((2, _)) = request {
            left = Some(1201);
        }
        left = left.map(|left: u32| left - 1);
    }
    (input, answer)
}

#[test]
fn qemu_gives_the_same_bits() {
    let (input, expected) = recording();
    let directory = std::env::temp_dir().join(format!("second-opinion-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    std::fs::write(directory.join("recording.bin"), &input).unwrap();
    let elf = arso_tests::target_binary("arso-second-opinion").canonicalize();
    let elf = elf.expect("built by: tests/build-firmware second-opinion");
    let status = Command::new("qemu-system-arm")
        .current_dir(&directory)
        .args([
            "-M",
            "netduinoplus2",
            "-nographic",
            "-semihosting-config",
            "enable=on,target=native",
        ])
        .args(["-monitor", "none", "-serial", "none", "-kernel"])
        .arg(elf)
        .status()
        .expect("qemu-system-arm is installed by tests/run");
    assert!(status.success());
    let bytes = std::fs::read(directory.join("commands.bin")).unwrap();
    std::fs::remove_dir_all(&directory).unwrap();
    let words = bytes
        .chunks_exact(4)
        .map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]));
    let found: Vec<u32> = words.collect();
    let steps = input.len() / 8;
    assert!(steps > 1200);
    assert_eq!(found.len(), expected.len());
    let different = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
    println!("{steps} steps, {} values, {different} differ", found.len());
    assert_eq!(different, 0);
    // The recording is worth it: the load did arrive.
    let last = f32::from_bits(expected[expected.len() - 6]);
    assert!((last - 0.03).abs() < 1e-4, "{last}");
}
