//! Reset and clock control [7]: oscillators that are ready at once, the clock tree, and which
//! peripheral has its clock.

use super::{Peripheral, Unknown};

/// Crystal of the board, Hz.
const HSE: u64 = 8_000_000;
const HSI: u64 = 16_000_000;

/// Bits of CR and CIR.
const HSEON: u32 = 1 << 16;
const CSSON: u32 = 1 << 19;
const PLLON: u32 = 1 << 24;
const CSSF: u32 = 1 << 7;
const CSSC: u32 = 1 << 23;

/// Bits of CSR: the low-speed oscillator is on and ready, flags are removed, and these.
const LSION: u32 = 1;
const RMVF: u32 = 1 << 24;
const CAUSES: u32 = 0xFE00_0000;
const PINRSTF: u32 = 1 << 26;
const SFTRSTF: u32 = 1 << 28;
const IWDGRSTF: u32 = 1 << 29;
/// After the power came; the oscillator is off.
const POWERED: u32 = 0x0E00_0000;

/// Why the processor starts again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The power came.
    Power,
    /// The reset pin was low.
    Pin,
    /// The program asked for it.
    Request,
    /// The independent watchdog was not fed.
    Watchdog,
}

/// The registers.
#[derive(Clone, Debug)]
pub struct Rcc {
    cr: u32,
    pll: u32,
    cfgr: u32,
    pll_i2s: u32,
    /// AHB1, AHB2, AHB3, -, APB1, APB2: resets from 0x10, enables from 0x30.
    resets: [u32; 6],
    enables: [u32; 6],
    csr: u32,
    /// Interrupt flags.
    cir: u32,
    crystal_failed: bool,
}

impl Default for Rcc {
    fn default() -> Self {
        Self {
            cr: 0x83,
            pll: 0x2400_3010,
            cfgr: 0,
            pll_i2s: 0x2000_3000,
            resets: [0; 6],
            enables: [0x0010_0000, 0, 0, 0, 0, 0],
            csr: POWERED,
            cir: 0,
            crystal_failed: false,
        }
    }
}

impl Rcc {
    /// Registers as after a reset; what has caused resets is kept until the program has removed it. A crystal
    /// that has failed does not come back.
    pub fn reset(&mut self, cause: Cause) {
        let caused = self.csr & CAUSES;
        *self = Self {
            csr: match cause {
                Cause::Power => POWERED,
                // Every other one pulls the pin low, too.
                Cause::Pin => caused | PINRSTF,
                Cause::Request => caused | PINRSTF | SFTRSTF,
                Cause::Watchdog => caused | PINRSTF | IWDGRSTF,
            },
            crystal_failed: self.crystal_failed,
            ..Self::default()
        };
    }

    /// Frequency of the processor, Hz.
    #[must_use]
    pub fn processor_hz(&self) -> u64 {
        let source = match self.cfgr & 0b11 {
            0b01 => HSE,
            0b10 => {
                let input = if self.pll & 1 << 22 != 0 { HSE } else { HSI };
                let (m, n) = (u64::from(self.pll & 0x3F), u64::from(self.pll >> 6 & 0x1FF));
                let p = 2 * (u64::from(self.pll >> 16 & 0b11) + 1);
                input / m.max(1) * n / p
            }
            _ => HSI,
        };
        match self.cfgr >> 4 & 0xF {
            divider @ 8.. => source >> [1, 2, 3, 4, 6, 7, 8, 9][divider as usize - 8],
            _ => source,
        }
    }

    /// The crystal stops; whether the clock security system has noticed, switched over to the internal
    /// oscillator and asks for the non-maskable interrupt [7.2.7].
    pub fn fail_crystal(&mut self) -> bool {
        self.crystal_failed = true;
        let watched = self.cr & CSSON != 0 && self.cr & HSEON != 0;
        if watched {
            // Crystal and PLL off, internal oscillator on and chosen.
            self.cr = self.cr & !(HSEON | PLLON | CSSON) | 1;
            self.cfgr &= !0b11;
            self.cir |= CSSF;
        }
        watched
    }

    /// Processor cycles per cycle of the timers on APB1: these run at twice the bus frequency
    /// when the bus is divided [7.2].
    #[must_use]
    pub fn cycles_per_timer_cycle(&self) -> u64 {
        match self.cfgr >> 10 & 0b111 {
            divider @ 0b101.. => 1 << (divider - 0b100),
            _ => 1,
        }
    }

    /// Processor cycles per cycle of the bus APB2 [7.3.3].
    #[must_use]
    pub fn cycles_per_apb2_cycle(&self) -> u64 {
        match self.cfgr >> 13 & 0b111 {
            divider @ 0b100.. => 1 << (divider - 0b011),
            _ => 1,
        }
    }

    /// Whether a peripheral on AHB1 has its clock.
    #[must_use]
    pub fn ahb1(&self, bit: u32) -> bool {
        self.enables[0] >> bit & 1 == 1
    }

    /// Whether a peripheral on APB1 has its clock.
    #[must_use]
    pub fn apb1(&self, bit: u32) -> bool {
        self.enables[4] >> bit & 1 == 1
    }

    /// Whether a peripheral on APB2 has its clock.
    #[must_use]
    pub fn apb2(&self, bit: u32) -> bool {
        self.enables[5] >> bit & 1 == 1
    }
}

impl Peripheral for Rcc {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        let bus = |offset: u32, base: u32| ((offset - base) / 4) as usize;
        match offset {
            // Each ready bit follows its enable bit at once.
            0x00 => {
                let ready = (self.cr & 0x0501_0001) << 1;
                let dead = if self.crystal_failed { HSEON << 1 } else { 0 };
                Ok(self.cr & !0x0A02_0002 | ready & !dead)
            }
            0x0C => Ok(self.cir),
            0x04 => Ok(self.pll),
            // The switch status follows the switch.
            0x08 => Ok(self.cfgr & !0b1100 | (self.cfgr & 0b11) << 2),
            0x10..0x28 => Ok(self.resets[bus(offset, 0x10)]),
            0x30..0x48 => Ok(self.enables[bus(offset, 0x30)]),
            // The internal low-speed oscillator is ready when it is on.
            0x74 => Ok(self.csr | (self.csr & LSION) << 1),
            0x84 => Ok(self.pll_i2s),
            _ => Err(Unknown),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        let bus = |offset: u32, base: u32| ((offset - base) / 4) as usize;
        match offset {
            0x00 => self.cr = value,
            0x04 => self.pll = value,
            0x08 => self.cfgr = value,
            // The flag is cleared by its own bit alone.
            0x0C if value & CSSC != 0 => self.cir &= !CSSF,
            0x0C => {}
            0x10..0x28 => self.resets[bus(offset, 0x10)] = value,
            0x30..0x48 => self.enables[bus(offset, 0x30)] = value,
            0x74 => {
                let kept = if value & RMVF == 0 { CAUSES } else { 0 };
                self.csr = self.csr & kept | value & LSION;
            }
            0x84 => self.pll_i2s = value,
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// APB2 at 84 MHz is the processor's clock divided by 2.
    #[test]
    fn second_bus() {
        let mut rcc = Rcc::default();
        assert_eq!(rcc.cycles_per_apb2_cycle(), 1);
        for (divider, cycles) in [(0b011, 1), (0b100, 2), (0b101, 4), (0b111, 16)] {
            rcc.write(0x08, divider << 13, 0).unwrap();
            assert_eq!(rcc.cycles_per_apb2_cycle(), cycles);
        }
        rcc.write(0x44, 1 << 4, 0).unwrap();
        assert!(rcc.apb2(4) && !rcc.apb2(5));
    }

    /// 8 MHz / 4 * 168 / 2 = 168 MHz, APB1 divided by 4: timers at 84 MHz.
    #[test]
    fn clock_tree() {
        let mut rcc = Rcc::default();
        assert_eq!(rcc.processor_hz(), 16_000_000);
        rcc.write(0x04, 1 << 22 | 168 << 6 | 4, 0).unwrap();
        rcc.write(0x08, 0b101 << 10 | 0b10, 0).unwrap();
        assert_eq!(
            (rcc.processor_hz(), rcc.cycles_per_timer_cycle()),
            (168_000_000, 2)
        );
        assert_eq!(rcc.read(0x08, 0).unwrap() & 0b1100, 0b1000);
        rcc.write(0x00, 0x0101_0001, 0).unwrap();
        assert_eq!(rcc.read(0x00, 0).unwrap(), 0x0303_0003);
        rcc.write(0x40, 1 << 1, 0).unwrap();
        assert!(rcc.apb1(1) && !rcc.apb1(0));
    }

    #[test]
    fn causes_of_resets_stay_until_they_are_removed() {
        let mut rcc = Rcc::default();
        assert_eq!(rcc.read(0x74, 0), Ok(POWERED));
        rcc.write(0x74, RMVF | LSION, 0).unwrap();
        assert_eq!(rcc.read(0x74, 0), Ok(0b11));
        rcc.reset(Cause::Watchdog);
        rcc.write(0x74, LSION, 0).unwrap();
        rcc.reset(Cause::Request);
        assert_eq!(rcc.read(0x74, 0), Ok(PINRSTF | SFTRSTF | IWDGRSTF));
        rcc.reset(Cause::Power);
        assert_eq!(rcc.read(0x74, 0), Ok(POWERED));
    }

    /// Without the clock security system nobody notices; with it the processor runs on at 16 MHz.
    #[test]
    fn a_dead_crystal() {
        let started = |css: u32| {
            let mut rcc = Rcc::default();
            rcc.write(0x04, 1 << 22 | 168 << 6 | 4, 0).unwrap();
            rcc.write(0x00, HSEON | PLLON | css | 1, 0).unwrap();
            rcc.write(0x08, 0b10, 0).unwrap();
            rcc
        };
        assert!(!started(0).fail_crystal());
        let mut rcc = started(CSSON);
        assert_eq!(rcc.processor_hz(), 168_000_000);
        assert!(rcc.fail_crystal());
        assert_eq!(rcc.processor_hz(), HSI);
        assert_eq!(rcc.read(0x0C, 0).unwrap(), CSSF);
        rcc.write(0x0C, CSSC, 0).unwrap();
        assert_eq!(rcc.read(0x0C, 0).unwrap(), 0);
        // It does not come back.
        rcc.write(0x00, HSEON | 1, 0).unwrap();
        assert_eq!(rcc.read(0x00, 0).unwrap() & HSEON << 1, 0);
    }
}
