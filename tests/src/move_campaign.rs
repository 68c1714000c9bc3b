//! Many random moves through the core: nothing is left ringing, no limit is broken, nothing hunts.
//!
//! ```text
//! requests drawn with a seed -> core <-> plant -> arrivals: residual, limits, counts      (retargets)
//! drives drawn with a seed, with friction and coarse encoders -> one move -> at rest?     (rest)
//! ```
//!
//! Everything is judged by the true motion of the plant and by the drive file, not by what the core says of
//! itself.

pub mod rest;
pub mod retargets;
