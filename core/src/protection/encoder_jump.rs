//! Whether the encoder's direction is still certain.

use crate::encoder::Reading;
use crate::fault::Fault;

pub(super) fn step(reading: &Reading) -> Option<Fault> {
    reading.jump.then_some(Fault::EncoderJump)
}
