//! Whether the encoder's direction is still certain.

use super::Trip;
use crate::encoder::Reading;
use crate::fault::Fault;

pub(super) fn step(reading: &Reading) -> Result<(), Trip> {
    if reading.jump {
        return Err(Trip {
            fault: Fault::EncoderJump,
            value: reading.displacement,
        });
    }
    Ok(())
}
