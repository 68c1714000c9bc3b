//! Ctrl-C as the end of something that would go on for ever: once ends it in order, twice at once.

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};

/// Ctrl-C was pressed.
pub(super) static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C sets [`INTERRUPTED`].
pub(super) fn catch_interrupt() -> Result<()> {
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|error| Error::Capture(format!("Ctrl-C cannot be caught: {error}")))
}
