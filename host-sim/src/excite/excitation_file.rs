//! The excitation as Rust source for the firmware.

use super::ExcitationPlan;
use crate::drive::Drive;
use std::fmt::Write;

/// Entries of the table on a line of the source.
const PER_LINE: usize = 16;

/// `firmware/src/excitation.rs`, complete. `origin` says where the drive was described.
#[must_use]
pub fn excitation_file(plan: &ExcitationPlan, drive: &Drive, origin: &str) -> String {
    let position = drive.kind.units().position;
    let [from, to] = plan.band();
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
        plan.signal.name(),
        plan.peak(),
        plan.prediction.travel,
        plan.sample_time as f32,
        plan.unit as f32,
        plan.repetitions,
        plan.travel as f32,
    );
    for line in plan.table.chunks(PER_LINE) {
        let entries: Vec<String> = line.iter().map(i16::to_string).collect();
        let _ = writeln!(text, "{I}{I}{},", entries.join(", "));
    }
    let _ = write!(text, "{I}],\n}};\n");
    text
}

/// One level of indentation.
const I: &str = "    ";
