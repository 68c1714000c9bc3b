//! The bus: which address is which peripheral, clock gating, bit-band, and seeded faults.

use super::nvic::Nvic;
use super::peripheral::converter::Converter;
use super::peripheral::cycle_counter::CycleCounter;
use super::peripheral::encoder_timer::EncoderTimer;
use super::peripheral::external_lines::ExternalLines;
use super::peripheral::flash::FlashInterface;
use super::peripheral::gpio::Gpio;
use super::peripheral::power::Power;
use super::peripheral::rcc::Rcc;
use super::peripheral::system_control::SystemControl;
use super::peripheral::systick::SysTick;
use super::peripheral::tick_timer::TickTimer;
use super::peripheral::watchdog::Watchdog;
use super::peripheral::{Peripheral, Unknown};

/// Interrupt of the voltage detector, and its external line.
const VOLTAGE: usize = 1;
const VOLTAGE_LINE: u32 = 16;
/// Interrupt of TIM2.
const TIM2: usize = 28;

/// Bits that a fault forces in every write to one register.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// Address of the register.
    pub address: u32,
    /// Which bits.
    pub mask: u32,
    /// What they become.
    pub value: u32,
}

/// All peripherals, and the time in processor cycles.
#[derive(Clone, Debug, Default)]
pub struct Bus {
    /// Processor cycles since reset.
    pub now: u64,
    /// Interrupt controller.
    pub nvic: Nvic,
    /// System control block.
    pub system: SystemControl,
    /// Clocks.
    pub rcc: Rcc,
    /// Ports A, B, C.
    pub ports: [Gpio; 3],
    /// Time base of the control.
    pub tick: TickTimer,
    /// Quadrature decoder.
    pub encoder: EncoderTimer,
    /// Current reference.
    pub converter: Converter,
    /// Watchdog.
    pub watchdog: Watchdog,
    /// A fault in a register write, and how often it acted.
    pub patch: Option<Patch>,
    /// See `patch`.
    pub patched: u32,
    /// Control periods begun: update events of the time base.
    pub ticks: u64,
    /// Supply.
    pub power: Power,
    lines: ExternalLines,
    flash: FlashInterface,
    cycle_counter: CycleCounter,
    systick: SysTick,
    debug_freeze: [u32; 2],
}

/// What lies behind an address.
enum Target<'a> {
    /// A peripheral with its clock.
    Model(&'a mut dyn Peripheral),
    /// A peripheral without its clock: reads zero, ignores writes.
    Unclocked,
}

impl Bus {
    /// The bus after reset.
    #[must_use]
    pub fn new() -> Self {
        Self {
            ports: [
                Gpio::new(0xA800_0000, 0x6400_0000),
                Gpio::new(0x0000_0280, 0x0000_0100),
                Gpio::default(),
            ],
            ..Self::default()
        }
    }

    /// Brings the timers up to the present and the interrupt lines with them.
    pub fn advance(&mut self) {
        let now = self.now;
        if self.tick.advance(now) {
            self.ticks += 1;
        }
        if self.systick.advance(now) {
            self.nvic.pend_systick();
        }
        self.nvic.set_line(TIM2, self.tick.interrupt());
        self.lines.set(VOLTAGE_LINE, self.power.too_low());
        self.nvic
            .set_line(VOLTAGE, self.lines.interrupt(VOLTAGE_LINE));
    }

    /// The crystal stops; whether the processor has a clock still.
    pub fn fail_crystal(&mut self) -> bool {
        let watched = self.rcc.fail_crystal();
        self.watchdog
            .set_processor_hz(self.rcc.processor_hz(), self.now);
        if watched {
            self.nvic.pend_non_maskable();
        }
        watched
    }

    /// When something will happen next without the processor's doing.
    #[must_use]
    pub fn next_event(&self) -> Option<u64> {
        let events = [
            self.tick.next_update(),
            self.systick.next_zero(),
            self.watchdog.expires(),
        ];
        events.into_iter().flatten().min()
    }

    /// Code on the pin of the current reference, if converter and pin are set up for it.
    #[must_use]
    pub fn current_reference(&self) -> Option<u16> {
        use super::peripheral::gpio::Mode;
        self.converter
            .output()
            .filter(|_| self.ports[0].mode(4) == Mode::Analog)
    }

    /// Whether the encoder's phases reach the decoder.
    #[must_use]
    pub fn encoder_connected(&self) -> bool {
        use super::peripheral::gpio::Mode;
        let port = &self.ports[2];
        [6, 7]
            .iter()
            .all(|pin| port.mode(*pin) == Mode::Alternate(2))
            && self.rcc.apb1(1)
    }

    fn target(&mut self, address: u32) -> Result<(Target<'_>, u32), Unknown> {
        let rcc = &self.rcc;
        let (clocked, base, model): (bool, u32, &mut dyn Peripheral) = match address {
            0x4000_0000..0x4000_0400 => (rcc.apb1(0), 0x4000_0000, &mut self.tick),
            0x4000_0400..0x4000_0800 => (rcc.apb1(1), 0x4000_0400, &mut self.encoder),
            0x4000_3000..0x4000_3400 => (true, 0x4000_3000, &mut self.watchdog),
            0x4000_7000..0x4000_7400 => (rcc.apb1(28), 0x4000_7000, &mut self.power),
            0x4000_7400..0x4000_7800 => (rcc.apb1(29), 0x4000_7400, &mut self.converter),
            0x4001_3C00..0x4001_4000 => (true, 0x4001_3C00, &mut self.lines),
            0x4002_0000..0x4002_0C00 => {
                let port = (address - 0x4002_0000) / 0x400;
                let base = 0x4002_0000 + 0x400 * port;
                (rcc.ahb1(port), base, &mut self.ports[port as usize])
            }
            0x4002_3800..0x4002_3C00 => (true, 0x4002_3800, &mut self.rcc),
            0x4002_3C00..0x4002_4000 => (true, 0x4002_3C00, &mut self.flash),
            0xE000_1000..0xE000_2000 => (true, 0xE000_1000, &mut self.cycle_counter),
            0xE000_E010..0xE000_E020 => (true, 0xE000_E010, &mut self.systick),
            0xE000_ED00..0xE000_F000 => (true, 0xE000_ED00, &mut self.system),
            _ => return Err(Unknown),
        };
        let target = if clocked {
            Target::Model(model)
        } else {
            Target::Unclocked
        };
        Ok((target, address - base))
    }

    /// Reads a word.
    ///
    /// # Errors
    /// No model knows the register.
    pub fn read(&mut self, address: u32) -> Result<u32, Unknown> {
        let now = self.now;
        match address {
            0x4200_0000..0x4400_0000 => {
                let (word, bit) = bit_band(address);
                return Ok(self.read(word)? >> bit & 1);
            }
            0xE000_E100..0xE000_E500 => return self.nvic.read(address - 0xE000_E100),
            // ICSR: the active exception.
            0xE000_ED04 => return Ok(self.nvic.active()),
            0xE000_ED18..0xE000_ED24 => {
                return Ok(self
                    .nvic
                    .system_priority((address - 0xE000_ED18) as usize / 4));
            }
            0xE000_EDFC => return Ok(u32::from(self.cycle_counter.trace) << 24),
            // Which clocks stop while a debugger halts the processor [38.16.3].
            0xE004_2008 | 0xE004_200C => {
                return Ok(self.debug_freeze[(address as usize - 0xE004_2008) / 4]);
            }
            _ => {}
        }
        match self.target(address)? {
            (Target::Model(model), offset) => model.read(offset, now),
            (Target::Unclocked, _) => Ok(0),
        }
    }

    /// Writes a word.
    ///
    /// # Errors
    /// No model knows the register.
    pub fn write(&mut self, address: u32, value: u32) -> Result<(), Unknown> {
        if let 0x4200_0000..0x4400_0000 = address {
            let (word, bit) = bit_band(address);
            let rest = self.read(word)? & !(1 << bit);
            return self.write(word, rest | (value & 1) << bit);
        }
        let mut value = value;
        if let Some(patch) = self.patch.filter(|patch| patch.address == address) {
            let patched = value & !patch.mask | patch.value & patch.mask;
            self.patched += u32::from(patched != value);
            value = patched;
        }
        let now = self.now;
        self.tick.set_ratio(self.rcc.cycles_per_timer_cycle());
        self.watchdog.set_processor_hz(self.rcc.processor_hz(), now);
        match address {
            0xE000_E100..0xE000_E500 => self.nvic.write(address - 0xE000_E100, value)?,
            0xE000_ED18..0xE000_ED24 => {
                self.nvic
                    .set_system_priority((address - 0xE000_ED18) as usize / 4, value);
            }
            0xE000_EDFC => self.cycle_counter.trace = value >> 24 & 1 == 1,
            0xE004_2008 | 0xE004_200C => {
                self.debug_freeze[(address as usize - 0xE004_2008) / 4] = value;
            }
            _ => match self.target(address)? {
                (Target::Model(model), offset) => model.write(offset, value, now)?,
                (Target::Unclocked, _) => {}
            },
        }
        // A peripheral in reset has its reset values.
        if address == 0x4002_3820 {
            if value & 1 != 0 {
                self.tick = TickTimer::default();
            }
            if value >> 1 & 1 != 0 {
                self.encoder = EncoderTimer::default();
            }
            if value >> 29 & 1 != 0 {
                self.converter = Converter::default();
            }
        }
        self.advance();
        Ok(())
    }
}

/// Word and bit behind an address of the peripheral bit-band alias [2.3.3].
fn bit_band(address: u32) -> (u32, u32) {
    let offset = address - 0x4200_0000;
    (0x4000_0000 + ((offset / 32) & !3), offset / 4 % 32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_bit_band_and_unknown_registers() {
        let mut bus = Bus::new();
        // TIM3 without its clock: nothing sticks.
        bus.write(0x4000_042C, 7).unwrap();
        assert_eq!(bus.read(0x4000_042C), Ok(0));
        // APB1ENR bit 1 through the alias.
        bus.write(0x4200_0000 + 0x2_3840 * 32 + 4, 1).unwrap();
        assert_eq!(bus.read(0x4002_3840), Ok(2));
        assert_eq!(bus.read(0x4200_0000 + 0x2_3840 * 32 + 4), Ok(1));
        bus.write(0x4000_042C, 7).unwrap();
        assert_eq!(bus.read(0x4000_042C), Ok(7));
        // Reset by APB1RSTR.
        bus.write(0x4002_3820, 2).unwrap();
        assert_eq!(bus.read(0x4000_042C), Ok(0xFFFF));
        for address in [0x4000_04FC, 0x4001_0000, 0x5000_0000, 0xE000_EF90] {
            assert_eq!(bus.read(address), Err(Unknown), "{address:#x}");
            assert_eq!(bus.write(address, 0), Err(Unknown), "{address:#x}");
        }
    }

    #[test]
    fn a_patch_changes_what_is_written() {
        let mut bus = Bus::new();
        bus.patch = Some(Patch {
            address: 0x4002_3840,
            mask: 2,
            value: 0,
        });
        bus.write(0x4002_3840, 3).unwrap();
        assert_eq!((bus.read(0x4002_3840), bus.patched), (Ok(1), 1));
        bus.write(0x4002_3840, 1).unwrap();
        assert_eq!(bus.patched, 1);
    }
}
