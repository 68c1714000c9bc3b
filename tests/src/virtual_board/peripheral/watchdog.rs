//! Independent watchdog [21]: once started, it resets the processor unless it is fed in time.

use super::{Peripheral, Unknown};

/// Its own oscillator, Hz, nominal.
const LSI: u64 = 32_000;
/// Counts until it heeds a new prescaler or reload value, which are taken over into its own clock (21.4.4).
const UPDATE: u64 = 5;

/// The registers.
#[derive(Clone, Debug)]
pub struct Watchdog {
    unlocked: bool,
    prescaler: u32,
    reload: u32,
    /// When it had so many counts left, in processor cycles; nothing before it is started.
    since: Option<u64>,
    left: u64,
    processor_hz: u64,
    /// Reload values that are not heeded yet, and from when on they are.
    later: Option<(u64, u32)>,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            unlocked: false,
            prescaler: 0,
            reload: 0xFFF,
            since: None,
            left: 0,
            processor_hz: 16_000_000,
            later: None,
        }
    }
}

impl Watchdog {
    /// The bus tells the frequency of the processor, in whose cycles time is kept. The time that has passed
    /// stays what it is.
    pub fn set_processor_hz(&mut self, hz: u64, now: u64) {
        if let Some(since) = &mut self.since
            && hz != self.processor_hz
        {
            *since = now.saturating_sub((now - *since) * hz / self.processor_hz.max(1));
        }
        self.processor_hz = hz;
    }

    /// When it will reset the processor.
    #[must_use]
    pub fn expires(&self) -> Option<u64> {
        let cycles = self.left * self.divider() * self.processor_hz / LSI;
        self.since.map(|since| since + cycles)
    }

    /// Cycles of its oscillator per count.
    fn divider(&self) -> u64 {
        4 << self.prescaler.min(6)
    }

    /// Another prescaler: what is left is counted at another rate from now on.
    fn set_prescaler(&mut self, prescaler: u32, now: u64) {
        let divider = self.divider();
        if let Some(since) = &mut self.since {
            let per_count = (self.processor_hz * divider).max(1);
            self.left = self.left.saturating_sub((now - *since) * LSI / per_count);
            *since = now;
        }
        self.prescaler = prescaler;
    }

    /// Another reload value, which a running watchdog heeds somewhat later.
    fn set_reload(&mut self, reload: u32, now: u64) {
        if self.since.is_none() {
            self.reload = reload;
            return;
        }
        self.heed(now);
        let after = UPDATE * self.divider() * self.processor_hz / LSI;
        self.later = Some((now + after, reload));
    }

    /// Takes over what was set long enough ago.
    fn heed(&mut self, now: u64) {
        if let Some((at, reload)) = self.later
            && now >= at
        {
            self.reload = reload;
            self.later = None;
        }
    }

    /// The counter begins at the reload value.
    fn load(&mut self, now: u64) {
        self.heed(now);
        self.since = Some(now);
        self.left = u64::from(self.reload) + 1;
    }

    /// Whether it was started.
    #[must_use]
    pub fn started(&self) -> bool {
        self.since.is_some()
    }
}

impl Peripheral for Watchdog {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, Unknown> {
        Ok(match offset {
            0x04 => self.prescaler,
            0x08 => self.reload,
            // The key register is write-only.
            0x00 => 0,
            // RVU: the reload value is being taken over.
            0x0C => u32::from(self.later.is_some_and(|(at, _)| now < at)) << 1,
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), Unknown> {
        match (offset, value) {
            (0x00, 0x5555) => self.unlocked = true,
            (0x00, 0xCCCC) if self.since.is_none() => self.load(now),
            (0x00, 0xAAAA) => {
                self.unlocked = false;
                if self.since.is_some() {
                    self.load(now);
                }
            }
            (0x00, _) => self.unlocked = false,
            (0x04, value) if self.unlocked => self.set_prescaler(value & 0b111, now),
            (0x08, value) if self.unlocked => self.set_reload(value & 0xFFF, now),
            (0x04 | 0x08, _) => {}
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expires_unless_fed() {
        let mut watchdog = Watchdog::default();
        watchdog.set_processor_hz(32_000_000, 0);
        watchdog.write(0x08, 10, 0).unwrap();
        assert_eq!(watchdog.read(0x08, 0), Ok(0xFFF));
        watchdog.write(0x00, 0x5555, 0).unwrap();
        watchdog.write(0x04, 1, 0).unwrap();
        watchdog.write(0x08, 99, 0).unwrap();
        assert_eq!(watchdog.expires(), None);
        watchdog.write(0x00, 0xCCCC, 5).unwrap();
        // 100 ticks of 8 periods of 32 kHz are 25 ms.
        assert_eq!(watchdog.expires(), Some(5 + 800_000));
        watchdog.write(0x00, 0xAAAA, 500).unwrap();
        assert_eq!(watchdog.expires(), Some(500 + 800_000));
    }

    /// As a program does that has something long to do, and is done with it.
    #[test]
    fn another_period_while_it_runs() {
        let mut watchdog = Watchdog::default();
        watchdog.set_processor_hz(32_000_000, 0);
        watchdog.write(0x00, 0x5555, 0).unwrap();
        watchdog.write(0x08, 99, 0).unwrap();
        watchdog.write(0x00, 0xCCCC, 0).unwrap();
        // 100 ticks of 4 periods; half of them are left, which now have 256.
        assert_eq!(watchdog.expires(), Some(400_000));
        watchdog.write(0x04, 6, 200_000).unwrap();
        assert_eq!(watchdog.expires(), Some(200_000 + 50 * 256_000));
        // Another reload value is heeded after five counts, by the next time it is fed; it cannot be started twice.
        watchdog.write(0x08, 9, 300_000).unwrap();
        watchdog.write(0x00, 0xCCCC, 300_000).unwrap();
        assert_eq!(watchdog.expires(), Some(200_000 + 50 * 256_000));
        watchdog.write(0x00, 0xAAAA, 300_000).unwrap();
        assert_eq!(watchdog.read(0x0C, 300_000), Ok(2));
        assert_eq!(watchdog.expires(), Some(300_000 + 100 * 256_000));
        assert_eq!(watchdog.read(0x0C, 1_600_000), Ok(0));
        watchdog.write(0x00, 0xAAAA, 1_600_000).unwrap();
        assert_eq!(watchdog.expires(), Some(1_600_000 + 10 * 256_000));
        watchdog.write(0x04, 0, 1_700_000).unwrap();
        watchdog.write(0x00, 0x5555, 1_700_000).unwrap();
        watchdog.write(0x04, 0, 1_728_000).unwrap();
        assert_eq!(watchdog.expires(), Some(1_728_000 + 10 * 4_000));
    }
}
