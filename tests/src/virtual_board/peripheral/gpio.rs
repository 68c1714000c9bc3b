//! A GPIO port [8.4]: modes, pulls, levels, alternate functions.

use super::{Peripheral, Unknown};

/// Mode of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Digital input.
    Input,
    /// Output of the port.
    Output,
    /// Output or input of a peripheral, by number.
    Alternate(u32),
    /// Analogue.
    Analog,
}

/// The registers of one port, and what is wired to it.
#[derive(Clone, Debug, Default)]
pub struct Gpio {
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    afr: [u32; 2],
    /// Levels that the board puts on the pins, and on which of them it does.
    levels: u32,
    wired: u32,
}

impl Gpio {
    /// Ports A and B have debug pins with other reset values.
    #[must_use]
    pub fn new(moder: u32, pupdr: u32) -> Self {
        Self {
            moder,
            pupdr,
            ..Self::default()
        }
    }

    /// The board puts the levels of another port on the pins.
    pub fn wire_like(&mut self, other: &Self) {
        self.levels = other.levels;
        self.wired = other.wired;
    }

    /// Mode of a pin.
    #[must_use]
    pub fn mode(&self, pin: u32) -> Mode {
        match self.moder >> (2 * pin) & 0b11 {
            0b00 => Mode::Input,
            0b01 => Mode::Output,
            0b10 => Mode::Alternate(self.afr[pin as usize / 8] >> (4 * (pin % 8)) & 0xF),
            _ => Mode::Analog,
        }
    }

    /// Whether a pin drives a high level.
    #[must_use]
    pub fn drives_high(&self, pin: u32) -> bool {
        self.mode(pin) == Mode::Output && self.odr >> pin & 1 == 1
    }

    /// Puts a level on a pin from outside.
    pub fn set_level(&mut self, pin: u32, high: bool) {
        self.levels = self.levels & !(1 << pin) | u32::from(high) << pin;
        self.wired |= 1 << pin;
    }

    /// Levels that an input sees: what is wired to it, else what its pull makes of it.
    fn inputs(&self) -> u32 {
        let pulled_up = (0..16).filter(|pin| self.pupdr >> (2 * pin) & 0b11 == 0b01);
        let pulled_up: u32 = pulled_up.map(|pin| 1 << pin).sum();
        self.levels & self.wired | pulled_up & !self.wired
    }
}

impl Peripheral for Gpio {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        Ok(match offset {
            0x00 => self.moder,
            0x04 => self.otyper,
            0x08 => self.ospeedr,
            0x0C => self.pupdr,
            0x10 => {
                let outputs = (0..16).filter(|pin| self.mode(*pin) == Mode::Output);
                let driven: u32 = outputs.map(|pin| 1 << pin).sum();
                self.odr & driven | self.inputs() & !driven & 0xFFFF
            }
            0x14 => self.odr,
            0x20 | 0x24 => self.afr[(offset as usize - 0x20) / 4],
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        match offset {
            0x00 => self.moder = value,
            0x04 => self.otyper = value,
            0x08 => self.ospeedr = value,
            0x0C => self.pupdr = value,
            0x14 => self.odr = value & 0xFFFF,
            // Set wins over reset.
            0x18 => self.odr = self.odr & !(value >> 16) | value & 0xFFFF,
            0x20 | 0x24 => self.afr[(offset as usize - 0x20) / 4] = value,
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_and_levels() {
        let mut port = Gpio::default();
        port.write(0x00, 0b10 << 12 | 0b01 << 24 | 0b11 << 8, 0)
            .unwrap();
        port.write(0x20, 2 << 24, 0).unwrap();
        assert_eq!(port.mode(6), Mode::Alternate(2));
        assert_eq!(
            (port.mode(12), port.mode(4), port.mode(0)),
            (Mode::Output, Mode::Analog, Mode::Input)
        );
        port.write(0x18, 1 << 12, 0).unwrap();
        assert!(port.drives_high(12));
        port.write(0x18, 1 << 28, 0).unwrap();
        assert!(!port.drives_high(12));
        port.set_level(2, true);
        port.set_level(12, true);
        assert_eq!(port.read(0x10, 0), Ok(0b100));
        assert_eq!(port.read(0x1C, 0), Err(Unknown));
        // A pull-up holds a pin that nothing is wired to.
        port.write(0x0C, 0b01 << 26 | 0b01 << 4, 0).unwrap();
        assert_eq!(port.read(0x10, 0), Ok(1 << 13 | 0b100));
        port.set_level(13, false);
        assert_eq!(port.read(0x10, 0), Ok(0b100));
    }
}
