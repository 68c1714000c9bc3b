//! TIM3 in encoder mode [18.3.12]: quadrature decoding of the edges on its two inputs.

use super::{Peripheral, Unknown};

/// Levels of the two phases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Phases {
    /// Channel 1.
    pub a: bool,
    /// Channel 2.
    pub b: bool,
}

impl Phases {
    /// The phases of an encoder at a position in counts: A leads B when it moves forward.
    #[must_use]
    pub fn at(count: i64) -> Self {
        let quarter = count.rem_euclid(4);
        Self {
            a: quarter == 1 || quarter == 2,
            b: quarter >= 2,
        }
    }
}

/// The registers and the levels behind the input filters.
#[derive(Clone, Debug)]
pub struct EncoderTimer {
    cr1: u32,
    smcr: u32,
    ccmr1: u32,
    ccer: u32,
    arr: u32,
    psc: u32,
    count: u32,
    filtered: Phases,
}

impl Default for EncoderTimer {
    fn default() -> Self {
        Self {
            cr1: 0,
            smcr: 0,
            ccmr1: 0,
            ccer: 0,
            arr: 0xFFFF,
            psc: 0,
            count: 0,
            filtered: Phases::default(),
        }
    }
}

impl EncoderTimer {
    /// How long a level of a channel must stand to pass its filter, in timer clocks [18.4.7,
    /// `ICxF`], with the sampling clock at the timer clock (CKD = 0).
    fn filter_clocks(&self, channel: u32) -> u32 {
        let (divider, samples) = match self.ccmr1 >> (4 + 8 * channel) & 0xF {
            0 => return 0,
            1 => (1, 2),
            2 => (1, 4),
            3 => (1, 8),
            4 => (2, 6),
            5 => (2, 8),
            6 => (4, 6),
            7 => (4, 8),
            8 => (8, 6),
            9 => (8, 8),
            10 => (16, 5),
            11 => (16, 6),
            12 => (16, 8),
            13 => (32, 5),
            14 => (32, 6),
            _ => (32, 8),
        };
        divider * samples
    }

    /// Registers as after reset; the levels of the inputs are the encoder's.
    pub fn reset(&mut self) {
        *self = Self {
            filtered: self.filtered,
            ..Self::default()
        };
    }

    /// New levels that nobody looks at: the ones that a program finds later.
    pub fn settle(&mut self, phases: Phases) {
        self.filtered = phases;
    }

    /// New levels on the inputs, which stand for a number of timer clocks.
    pub fn edge(&mut self, phases: Phases, clocks: u32) {
        // Each channel must select its own input.
        let selected = self.ccmr1 & 0x0303 == 0x0101;
        if !selected {
            self.settle(phases);
            return;
        }
        let mut seen = self.filtered;
        if clocks >= self.filter_clocks(0) {
            seen.a = phases.a;
        }
        if clocks >= self.filter_clocks(1) {
            seen.b = phases.b;
        }
        let before = std::mem::replace(&mut self.filtered, seen);
        if self.cr1 & 1 == 0 || before == seen {
            return;
        }
        // Inverted inputs: CC1P, CC2P.
        let level = |phases: Phases| Phases {
            a: phases.a != (self.ccer & 1 << 1 != 0),
            b: phases.b != (self.ccer & 1 << 5 != 0),
        };
        let (before, seen) = (level(before), level(seen));
        let on_a = before.a != seen.a;
        // Table 97: the direction follows from the edge and the level of the other input.
        let up = if on_a {
            seen.a != seen.b
        } else {
            seen.a == seen.b
        };
        let counts = match self.smcr & 0b111 {
            0b001 => !on_a,
            0b010 => on_a,
            0b011 => true,
            _ => false,
        };
        if counts {
            self.count = match (up, self.count) {
                (true, count) if count >= self.arr => 0,
                (true, count) => count + 1,
                (false, 0) => self.arr,
                (false, count) => count - 1,
            };
        }
    }

    /// The counter stands elsewhere all at once, without an edge on the inputs.
    pub fn upset(&mut self, counts: i32) {
        let range = i64::from(self.arr) + 1;
        self.count = (i64::from(self.count) + i64::from(counts)).rem_euclid(range) as u32;
    }

    /// The counter.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.count
    }
}

impl Peripheral for EncoderTimer {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        Ok(match offset {
            0x00 => self.cr1,
            0x08 => self.smcr,
            0x18 => self.ccmr1,
            0x20 => self.ccer,
            0x24 => self.count,
            0x28 => self.psc,
            0x2C => self.arr,
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        match offset {
            0x00 => self.cr1 = value,
            0x08 => self.smcr = value,
            0x18 => self.ccmr1 = value,
            0x20 => self.ccer = value,
            0x24 => self.count = value & 0xFFFF,
            0x28 => self.psc = value & 0xFFFF,
            0x2C => self.arr = value & 0xFFFF,
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoder() -> EncoderTimer {
        let mut timer = EncoderTimer::default();
        timer.write(0x18, 0x3131, 0).unwrap();
        timer.write(0x08, 3, 0).unwrap();
        timer.write(0x00, 1, 0).unwrap();
        timer
    }

    fn walk(timer: &mut EncoderTimer, from: i64, to: i64, clocks: u32) {
        let step = if to > from { 1 } else { -1 };
        let mut at = from;
        while at != to {
            at += step;
            timer.edge(Phases::at(at), clocks);
        }
    }

    #[test]
    fn every_edge_counts_in_both_directions_and_wraps() {
        let mut timer = decoder();
        walk(&mut timer, 0, 10, 100);
        assert_eq!(timer.count(), 10);
        walk(&mut timer, 10, -3, 100);
        assert_eq!(timer.count(), 0xFFFD);
        walk(&mut timer, -3, 65_536 + 5, 100);
        assert_eq!(timer.count(), 5);
    }

    #[test]
    fn a_reset_finds_the_encoder_where_it_is() {
        let mut timer = decoder();
        walk(&mut timer, 0, 1, 100);
        timer.reset();
        timer.settle(Phases::at(2));
        timer.write(0x18, 0x3131, 0).unwrap();
        timer.write(0x08, 3, 0).unwrap();
        timer.write(0x00, 1, 0).unwrap();
        walk(&mut timer, 2, 5, 100);
        assert_eq!(timer.count(), 3);
    }

    #[test]
    fn short_pulses_are_filtered() {
        let mut timer = decoder();
        walk(&mut timer, 0, 100, 7);
        assert_eq!(timer.count(), 0);
        walk(&mut timer, 100, 104, 8);
        assert_eq!(timer.count(), 4);
    }

    #[test]
    fn other_settings_do_not_decode() {
        for (offset, value) in [(0x18, 0x3030), (0x08, 0), (0x00, 0)] {
            let mut timer = decoder();
            timer.write(offset, value, 0).unwrap();
            walk(&mut timer, 0, 100, 100);
            assert_eq!(timer.count(), 0);
        }
        // Half the edges with one input only, and backwards with one input inverted.
        let mut timer = decoder();
        timer.write(0x08, 1, 0).unwrap();
        walk(&mut timer, 0, 100, 100);
        assert_eq!(timer.count(), 50);
        let mut timer = decoder();
        timer.write(0x20, 1 << 1, 0).unwrap();
        walk(&mut timer, 0, 100, 100);
        assert_eq!(timer.count(), 0x10000 - 100);
    }
}
