//! Independent truth for the tests of the drive.
#![forbid(unsafe_code)]

#[cfg(feature = "virtual-board")]
pub mod campaign;
pub mod coverage;
pub mod drives;
pub mod false_alarms;
pub mod learning;
pub mod move_campaign;
mod random_drive;
pub mod reference;
#[cfg(feature = "virtual-board")]
pub mod virtual_board;

/// Where `tests/build-firmware` leaves what it builds.
#[cfg(feature = "virtual-board")]
#[must_use]
pub fn target_binary(name: &str) -> std::path::PathBuf {
    built("firmware/thumbv7em-none-eabihf/release").join(name)
}

/// What a script leaves in the target folder.
#[cfg(feature = "virtual-board")]
#[must_use]
pub fn built(path: &str) -> std::path::PathBuf {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    root.join("target").join(path)
}

/// The firmware, as flashed.
///
/// # Panics
/// When it has not been built.
#[cfg(feature = "virtual-board")]
#[must_use]
pub fn firmware() -> Vec<u8> {
    let path = target_binary("arso-firmware");
    std::fs::read(&path)
        .unwrap_or_else(|_| panic!("run tests/build-firmware: {} is missing", path.display()))
}
