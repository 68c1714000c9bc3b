//! System timer (Armv7-M ARM, B3.3), clocked by the processor.

use super::{Peripheral, Unknown};

const ENABLE: u32 = 1;
const TICKINT: u32 = 1 << 1;
const COUNTFLAG: u32 = 1 << 16;

/// The registers.
#[derive(Clone, Debug, Default)]
pub struct SysTick {
    control: u32,
    reload: u32,
    /// When the counter was last at its reload value.
    since: u64,
}

impl SysTick {
    fn period(&self) -> u64 {
        u64::from(self.reload) + 1
    }

    /// When the counter next reaches zero.
    #[must_use]
    pub fn next_zero(&self) -> Option<u64> {
        (self.control & ENABLE != 0 && self.reload > 0).then(|| self.since + self.period())
    }

    /// Advances to a time; whether the exception becomes pending.
    pub fn advance(&mut self, now: u64) -> bool {
        let mut reached = false;
        while let Some(zero) = self.next_zero().filter(|zero| *zero <= now) {
            self.since = zero;
            self.control |= COUNTFLAG;
            reached = true;
        }
        reached && self.control & TICKINT != 0
    }
}

impl Peripheral for SysTick {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, Unknown> {
        match offset {
            0x0 => {
                let value = self.control;
                self.control &= !COUNTFLAG;
                Ok(value)
            }
            0x4 => Ok(self.reload),
            0x8 if self.control & ENABLE != 0 => {
                Ok((self.period() - 1).saturating_sub(now - self.since) as u32)
            }
            0x8 => Ok(0),
            _ => Err(Unknown),
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), Unknown> {
        match offset {
            0x0 => {
                if value & ENABLE != 0 && self.control & ENABLE == 0 {
                    self.since = now;
                }
                self.control = value & 0b111;
            }
            0x4 => self.reload = value & 0x00FF_FFFF,
            0x8 => {
                self.since = now;
                self.control &= !COUNTFLAG;
            }
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reaches_zero_every_reload_plus_one_cycles() {
        let mut timer = SysTick::default();
        timer.write(0x4, 999, 0).unwrap();
        assert_eq!(timer.next_zero(), None);
        timer.write(0x0, 0b111, 50).unwrap();
        assert_eq!(timer.read(0x8, 150), Ok(899));
        assert!(!timer.advance(1049));
        assert!(timer.advance(1050));
        assert_eq!(timer.next_zero(), Some(2050));
        assert_ne!(timer.read(0x0, 1050).unwrap() & COUNTFLAG, 0);
        assert_eq!(timer.read(0x0, 1050).unwrap() & COUNTFLAG, 0);
        timer.write(0x0, 0b101, 1060).unwrap();
        assert!(!timer.advance(5000));
    }
}
