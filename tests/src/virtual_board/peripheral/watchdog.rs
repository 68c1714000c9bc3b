//! Independent watchdog [21]: once started, it resets the processor unless it is fed in time.

use super::{Peripheral, Unknown};

/// Its own oscillator, Hz, nominal.
const LSI: u64 = 32_000;

/// The registers.
#[derive(Clone, Debug)]
pub struct Watchdog {
    unlocked: bool,
    prescaler: u32,
    reload: u32,
    /// When it was last fed, in processor cycles; nothing before it is started.
    fed: Option<u64>,
    processor_hz: u64,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            unlocked: false,
            prescaler: 0,
            reload: 0xFFF,
            fed: None,
            processor_hz: 16_000_000,
        }
    }
}

impl Watchdog {
    /// The bus tells the frequency of the processor, in whose cycles time is kept. The time since it was fed
    /// stays what it is.
    pub fn set_processor_hz(&mut self, hz: u64, now: u64) {
        if let Some(fed) = &mut self.fed
            && hz != self.processor_hz
        {
            *fed = now.saturating_sub((now - *fed) * hz / self.processor_hz.max(1));
        }
        self.processor_hz = hz;
    }

    /// When it will reset the processor.
    #[must_use]
    pub fn expires(&self) -> Option<u64> {
        let ticks = (u64::from(self.reload) + 1) << (2 + self.prescaler.min(6));
        self.fed.map(|fed| fed + ticks * self.processor_hz / LSI)
    }

    /// Whether it was started.
    #[must_use]
    pub fn started(&self) -> bool {
        self.fed.is_some()
    }
}

impl Peripheral for Watchdog {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        Ok(match offset {
            0x04 => self.prescaler,
            0x08 => self.reload,
            // The key register is write-only; updates of the others are done at once.
            0x00 | 0x0C => 0,
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), Unknown> {
        match (offset, value) {
            (0x00, 0x5555) => self.unlocked = true,
            (0x00, 0xCCCC) => self.fed = Some(now),
            (0x00, 0xAAAA) => {
                self.unlocked = false;
                self.fed = self.fed.map(|_| now);
            }
            (0x00, _) => self.unlocked = false,
            (0x04, value) if self.unlocked => self.prescaler = value & 0b111,
            (0x08, value) if self.unlocked => self.reload = value & 0xFFF,
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
}
