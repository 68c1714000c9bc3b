//! Flash interface [3.9]: wait states and caches, which this board stores and does not time.

use super::{Peripheral, Unknown};

/// The access control register.
#[derive(Clone, Debug, Default)]
pub struct FlashInterface {
    acr: u32,
}

impl Peripheral for FlashInterface {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        if offset == 0 {
            Ok(self.acr)
        } else {
            Err(Unknown)
        }
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        if offset == 0 {
            self.acr = value;
            Ok(())
        } else {
            Err(Unknown)
        }
    }
}
