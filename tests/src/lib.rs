//! Independent truth for the tests of the drive.
#![forbid(unsafe_code)]

pub mod drives;
pub mod reference;
#[cfg(feature = "virtual-board")]
pub mod virtual_board;

/// Where `tests/build-firmware` leaves the firmware.
#[cfg(feature = "virtual-board")]
#[must_use]
pub fn firmware_elf() -> std::path::PathBuf {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    root.join("target/firmware/thumbv7em-none-eabihf/release/arso-firmware")
}
