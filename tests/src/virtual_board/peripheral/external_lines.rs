//! Lines of the external interrupts [12.3]: an edge on one makes it pending until the program clears it.

use super::{Peripheral, Unknown};

/// The registers, and the levels of the lines.
#[derive(Clone, Debug, Default)]
pub struct ExternalLines {
    interrupts: u32,
    events: u32,
    rising: u32,
    falling: u32,
    pending: u32,
    levels: u32,
}

impl ExternalLines {
    /// Level of a line.
    pub fn set(&mut self, line: u32, high: bool) {
        let bit = 1 << line;
        let was = self.levels & bit != 0;
        let edges = if high { self.rising } else { self.falling };
        if was != high {
            self.levels ^= bit;
            self.pending |= edges & bit & self.interrupts;
        }
    }

    /// Whether a line asks for its interrupt.
    #[must_use]
    pub fn interrupt(&self, line: u32) -> bool {
        self.pending & self.interrupts & 1 << line != 0
    }
}

impl Peripheral for ExternalLines {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        match offset {
            0x00 => Ok(self.interrupts),
            0x04 => Ok(self.events),
            0x08 => Ok(self.rising),
            0x0C => Ok(self.falling),
            0x14 => Ok(self.pending),
            _ => Err(Unknown),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        match offset {
            0x00 => self.interrupts = value,
            0x04 => self.events = value,
            0x08 => self.rising = value,
            0x0C => self.falling = value,
            // Writing one clears.
            0x14 => self.pending &= !value,
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_stays_until_it_is_cleared() {
        let mut lines = ExternalLines::default();
        lines.set(16, true);
        assert!(!lines.interrupt(16));
        lines.set(16, false);
        for offset in [0x00, 0x08] {
            lines.write(offset, 1 << 16, 0).unwrap();
        }
        lines.set(16, true);
        lines.set(16, false);
        assert!(lines.interrupt(16));
        lines.write(0x14, 1 << 16, 0).unwrap();
        assert!(!lines.interrupt(16));
    }
}
