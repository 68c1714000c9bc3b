//! Which drive this is, as the log and the link say it.

use crate::settings::{LOADS, Set};
use arso_core::Identity;
use arso_core::link::message::{Introduction, TAG, VERSION};

/// Which drive this is.
pub(crate) fn identity(set: &Set) -> Identity<'static> {
    Identity {
        kind: set.header.kind(),
        loads: LOADS as u8,
        sample_time: set.settings.sample_time,
        fingerprint: set.header.fingerprint,
    }
}

/// The same for who speaks to it over the link.
pub(crate) fn introduction(identity: &Identity<'_>, set: &Set) -> Introduction {
    Introduction {
        version: VERSION,
        tag: TAG,
        firmware: env!("CARGO_PKG_VERSION").try_into().unwrap_or_default(),
        kind: identity.kind.try_into().unwrap_or_default(),
        loads: identity.loads,
        sample_time: identity.sample_time,
        resolution: set.settings.encoder.resolution,
        fingerprint: identity.fingerprint,
    }
}
