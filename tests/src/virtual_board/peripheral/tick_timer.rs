//! TIM2 as a time base [18.4]: prescaler, auto-reload, update interrupt.

use super::{Peripheral, Unknown};

const CEN: u32 = 1;
const URS: u32 = 1 << 2;
const UIF: u32 = 1;

/// The timer; counts up only, which is all a time base needs.
#[derive(Clone, Debug)]
pub struct TickTimer {
    cr1: u32,
    cr2: u32,
    dier: u32,
    sr: u32,
    /// Prescaler as written, and as loaded at the last update.
    psc: u32,
    loaded_psc: u32,
    arr: u32,
    /// Counter at `since`; it runs from there while the timer is enabled.
    count: u64,
    since: u64,
    /// Processor cycles per timer clock.
    ratio: u64,
    /// Update events while the flag of the one before was still set.
    pub lost: u64,
}

impl Default for TickTimer {
    fn default() -> Self {
        Self {
            cr1: 0,
            cr2: 0,
            dier: 0,
            sr: 0,
            psc: 0,
            loaded_psc: 0,
            arr: u32::MAX,
            count: 0,
            since: 0,
            ratio: 1,
            lost: 0,
        }
    }
}

impl TickTimer {
    fn cycles_per_count(&self) -> u64 {
        self.ratio * (u64::from(self.loaded_psc) + 1)
    }

    fn counting(&self) -> bool {
        self.cr1 & CEN != 0
    }

    /// The bus tells the clock ratio when it gives access.
    pub fn set_ratio(&mut self, ratio: u64) {
        self.ratio = ratio;
    }

    /// When the next update event comes.
    #[must_use]
    pub fn next_update(&self) -> Option<u64> {
        let left = (u64::from(self.arr) + 1).saturating_sub(self.count);
        self.counting()
            .then(|| self.since + left * self.cycles_per_count())
    }

    /// Advances to a time; whether an update event came.
    pub fn advance(&mut self, now: u64) -> bool {
        let mut updated = false;
        while let Some(update) = self.next_update().filter(|update| *update <= now) {
            self.count = 0;
            self.since = update;
            self.loaded_psc = self.psc;
            self.lost += u64::from(self.sr & UIF != 0);
            self.sr |= UIF;
            updated = true;
        }
        updated
    }

    /// Level of the interrupt line.
    #[must_use]
    pub fn interrupt(&self) -> bool {
        self.sr & self.dier & UIF != 0
    }

    /// The update event that came last gives no interrupt: somebody has lost it.
    pub fn drop_update(&mut self) {
        self.sr &= !UIF;
    }

    /// An update event is signalled without the counter's doing.
    pub fn raise_update(&mut self) {
        self.sr |= UIF;
    }

    /// The counter stands still from now on.
    pub fn stop(&mut self, now: u64) {
        self.count = self.counter(now);
        self.cr1 &= !CEN;
    }

    fn counter(&self, now: u64) -> u64 {
        if self.counting() {
            self.count + (now - self.since) / self.cycles_per_count()
        } else {
            self.count
        }
    }
}

impl Peripheral for TickTimer {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, Unknown> {
        self.advance(now);
        Ok(match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x0C => self.dier,
            0x10 => self.sr,
            0x24 => self.counter(now) as u32,
            0x28 => self.psc,
            0x2C => self.arr,
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), Unknown> {
        self.advance(now);
        match offset {
            0x00 => {
                self.count = self.counter(now);
                self.since = now;
                self.cr1 = value;
            }
            0x04 => self.cr2 = value,
            0x0C => self.dier = value,
            // Flags are cleared by writing zero.
            0x10 => self.sr &= value,
            0x14 => {
                if value & 1 != 0 {
                    self.count = 0;
                    self.since = now;
                    self.loaded_psc = self.psc;
                    if self.cr1 & URS == 0 {
                        self.sr |= UIF;
                    }
                }
            }
            0x24 => {
                self.count = value.into();
                self.since = now;
            }
            0x28 => self.psc = value & 0xFFFF,
            0x2C => self.arr = value,
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn updates_come_at_prescaler_times_reload() {
        let mut timer = TickTimer::default();
        timer.set_ratio(2);
        timer.write(0x28, 83, 0).unwrap();
        timer.write(0x2C, 999, 0).unwrap();
        timer.write(0x00, URS, 0).unwrap();
        timer.write(0x14, 1, 100).unwrap();
        assert_eq!(timer.next_update(), None);
        timer.write(0x00, CEN, 200).unwrap();
        assert_eq!(timer.next_update(), Some(200 + 168_000));
        assert!(!timer.advance(168_199));
        assert!(timer.advance(168_200) && !timer.interrupt());
        timer.write(0x0C, 1, 168_300).unwrap();
        assert!(timer.interrupt());
        timer.write(0x10, !1, 168_300).unwrap();
        assert!(!timer.interrupt());
        assert_eq!(timer.read(0x24, 168_200 + 1680).unwrap(), 10);
        timer.advance(168_200 + 2 * 168_000);
        assert_eq!(timer.lost, 1);
    }
}
