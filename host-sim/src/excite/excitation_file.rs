//! The excitation as files: Rust source for the firmware, and CSV.

use super::Play;
use crate::drive::Drive;
use crate::report::time;
use std::fmt::Write;

/// Entries of the table on a line of the source.
const PER_LINE: usize = 16;

/// `firmware/src/excitation.rs`, complete. `origin` says where the drive was described.
#[must_use]
pub fn source(play: &Play, drive: &Drive, origin: &str) -> String {
    let position = drive.kind.units().position;
    let [from, to] = play.band();
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "//! Excitation of the drive. GENERATED from {origin}; do not edit.\n\
         //!\n\
         //! `cargo run --release -- excite [DRIVE.toml] --rust firmware/src/excitation.rs`\n\
         //!\n\
         //! {} from {from:.3} to {to:.3} Hz, {:.3} A at most, predicted travel {:.3e} {position}.\n\
         \n\
         use arso_core::Excitation;\n\
         \n\
         /// Control period that the excitation was made for, s.\n\
         pub const SAMPLE_TIME: f32 = {:?};\n\
         \n\
         /// What the drive plays to be identified.\n\
         #[rustfmt::skip]\n\
         pub const EXCITATION: Excitation = Excitation {{\n\
         {I}unit: {:?}, // A\n\
         {I}repetitions: {},\n\
         {I}travel: {:?}, // {position}\n\
         {I}profile: &[\n",
        play.signal.name(),
        play.peak(),
        play.prediction.travel,
        play.sample_time as f32,
        play.unit as f32,
        play.repetitions,
        play.travel as f32,
    );
    for line in play.table.chunks(PER_LINE) {
        let entries: Vec<String> = line.iter().map(i16::to_string).collect();
        let _ = writeln!(text, "{I}{I}{},", entries.join(", "));
    }
    let _ = write!(text, "{I}],\n}};\n");
    text
}

/// One level of indentation.
const I: &str = "    ";

/// One row per control period of the whole play; the current is held from the row's time to the
/// next.
#[must_use]
pub fn csv(play: &Play) -> String {
    let mut text = String::from("time[s],current[A]\n");
    for (k, current) in play.currents().enumerate() {
        // Whole microseconds, as everywhere.
        let time = time(k as f64 * play.sample_time);
        let _ = writeln!(text, "{time},{current}");
    }
    text
}
