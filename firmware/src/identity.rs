//! Which drive this is, as the log and the link say it.

use crate::settings::{GAINS, KIND, LOADS, PLANS};
use arso_core::Identity;
use arso_core::link::frame::CHECKSUM;
use arso_core::link::message::{Introduction, TAG, VERSION};
use crc::Digest;
use postcard::ser_flavors::Flavor;

/// Which drive this is.
pub(crate) fn identity() -> Identity<'static> {
    Identity {
        kind: KIND,
        loads: LOADS as u8,
        sample_time: GAINS.sample_time,
        fingerprint: fingerprint(),
    }
}

/// The same for who speaks to it over the link.
pub(crate) fn introduction(identity: &Identity<'_>) -> Introduction {
    Introduction {
        version: VERSION,
        tag: TAG,
        firmware: env!("CARGO_PKG_VERSION").try_into().unwrap_or_default(),
        kind: identity.kind.try_into().unwrap_or_default(),
        loads: identity.loads,
        sample_time: identity.sample_time,
        resolution: GAINS.encoder.resolution,
        fingerprint: identity.fingerprint,
    }
}

/// Checksum of the settings in their serialised form, which is never there as a whole.
fn fingerprint() -> u32 {
    struct Passing(Digest<'static, u32>);
    impl Flavor for Passing {
        type Output = u32;
        fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
            self.0.update(&[byte]);
            Ok(())
        }
        fn finalize(self) -> postcard::Result<u32> {
            Ok(self.0.finalize())
        }
    }
    // Nothing in it can fail: settings are numbers.
    postcard::serialize_with_flavor(&(&GAINS, PLANS), Passing(CHECKSUM.digest())).unwrap_or(0)
}
