//! Which settings the drive runs with, and whether a board can run them.
//!
//! Today they are compiled in: [`GAINS`] is written by `host-sim design --rust`, and the profile to be
//! played by `host-sim excite --rust`.

use crate::board::Capabilities;
use crate::excitation;

pub use crate::excitation::EXCITATION;
pub use crate::gains::{GAINS, KIND, LOADS, Observer, PLANS};

/// The control period, µs.
pub const PERIOD_US: u32 = (GAINS.sample_time * 1e6 + 0.5) as u32;

const _: () = assert!(
    excitation::SAMPLE_TIME == GAINS.sample_time,
    "excitation and gains are made for different control periods"
);

const _: () = assert!(
    GAINS.amplifier.step > 0.0 && GAINS.amplifier.step == GAINS.limits.current_resolution,
    "current_resolution of the drive must be what one code of the converter means to the amplifier"
);

/// Holds the settings against what a board can do, at compile time.
///
/// # Panics
/// Where they do not fit, which then does not compile.
pub const fn require_fit(board: &Capabilities) {
    assert!(
        GAINS.encoder.counter_bits == board.counter_bits,
        "counter_bits of the drive must be the width of the board's counter"
    );
    assert!(
        GAINS.limits.current_limit <= GAINS.amplifier.reach(board.converter_codes),
        "current_limit is beyond what the converter's codes reach on both sides of zero_code"
    );
    assert!(
        board.converter_codes <= 32_768,
        "the last moves are kept in steps of the converter, 32767 either way"
    );
    let error = GAINS.sample_time * 1e6 - PERIOD_US as f32;
    // f32 holds the period to seven figures.
    let tolerance = 1e-6 * PERIOD_US as f32;
    assert!(
        error < tolerance && error > -tolerance,
        "sample_time must be a whole number of microseconds"
    );
    let (shortest, longest) = board.periods;
    assert!(
        PERIOD_US >= shortest && PERIOD_US <= longest,
        "sample_time is outside what the board's timer can do"
    );
}
