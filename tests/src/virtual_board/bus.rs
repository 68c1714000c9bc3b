//! The bus: which address is which peripheral, clock gating, bit-band, and seeded faults.

use super::nvic::Nvic;
use super::peripheral::converter::Converter;
use super::peripheral::cycle_counter::CycleCounter;
use super::peripheral::dma::{self, Dma};
use super::peripheral::encoder_timer::EncoderTimer;
use super::peripheral::external_lines::ExternalLines;
use super::peripheral::flash::FlashInterface;
use super::peripheral::gpio::Gpio;
use super::peripheral::power::Power;
use super::peripheral::rcc::{Cause, Rcc};
use super::peripheral::system_control::SystemControl;
use super::peripheral::systick::SysTick;
use super::peripheral::tick_timer::TickTimer;
use super::peripheral::usart::{Pins, Usart};
use super::peripheral::watchdog::Watchdog;
use super::peripheral::{Peripheral, Unknown};

/// Interrupt of the voltage detector, and its external line.
const VOLTAGE: usize = 1;
const VOLTAGE_LINE: u32 = 16;
/// Interrupt of the flash interface.
const FLASH: usize = 4;
/// Interrupt of TIM2.
const TIM2: usize = 28;

/// Clock of USART1 on APB2, its data register, and the clock of DMA2 on AHB1.
const USART1: u32 = 4;
const USART1_DATA: u32 = 0x4001_1004;
const DMA2: u32 = 22;

/// What the DMA controller does in memory, which is not the bus's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// Puts a byte there.
    Store {
        /// Where.
        address: u32,
        /// What.
        byte: u8,
    },
    /// Fetches the byte there, for [`Bus::fetched`].
    Fetch {
        /// Where.
        address: u32,
    },
}

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
    /// Processor cycles since the board was new.
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
    /// Flash memory and its interface.
    pub flash: FlashInterface,
    usart: Usart,
    dma: Dma,
    lines: ExternalLines,
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

    /// A reset of the processor: peripherals as new. Time goes on, what the world puts on the pins stays, and so
    /// does what only the end of the power takes: the cause of the reset, the debugger's registers, flash.
    pub fn reset(&mut self) {
        let cause = if self.system.reset_requested {
            Cause::Request
        } else if self.watchdog.expires().is_some_and(|at| at <= self.now) {
            Cause::Watchdog
        } else {
            Cause::Pin
        };
        let (cycle_counter, debug_freeze) = (self.cycle_counter.clone(), self.debug_freeze);
        self.start_again(cause);
        self.cycle_counter = cycle_counter;
        self.debug_freeze = debug_freeze;
    }

    /// The power goes and comes back: of the part only flash stays.
    pub fn power_cycle(&mut self) {
        self.start_again(Cause::Power);
    }

    fn start_again(&mut self, cause: Cause) {
        let mut old = std::mem::replace(self, Self::new());
        for (port, old) in self.ports.iter_mut().zip(&old.ports) {
            port.wire_like(old);
        }
        old.rcc.reset(cause);
        old.encoder.reset();
        old.power.reset();
        old.usart.reset();
        old.usart.set_ratio(1);
        old.flash.reset();
        self.rcc = old.rcc;
        self.encoder = old.encoder;
        self.power = old.power;
        self.usart = old.usart;
        self.flash = old.flash;
        self.now = old.now;
        self.ticks = old.ticks;
        self.patch = old.patch;
        self.patched = old.patched;
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
        if self.usart.next_event().is_some_and(|at| at <= now) {
            self.usart.advance(now, self.usart_pins());
        }
        self.nvic.set_line(FLASH, self.flash.interrupt());
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
            self.usart.next_event(),
            self.flash.next_event(),
            self.due_stream().map(|_| self.now),
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

    /// Which of its pins USART1 has: PA9 and PA10 in their function 7.
    fn usart_pins(&self) -> Pins {
        use super::peripheral::gpio::Mode;
        let connected =
            |pin| self.rcc.apb2(USART1) && self.ports[0].mode(pin) == Mode::Alternate(7);
        Pins {
            transmits: connected(9),
            receives: connected(10),
        }
    }

    /// The world sends bytes to the drive. They pass one by one at the drive's rate; what the drive is
    /// not set up to receive is lost.
    pub fn send(&mut self, bytes: &[u8]) {
        let pins = self.usart_pins();
        self.usart.set_ratio(self.rcc.cycles_per_apb2_cycle());
        self.usart.send(bytes, self.now, pins);
    }

    /// Bytes of the world that have not passed.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.usart.waiting()
    }

    /// The world takes what the drive has sent since it last did.
    pub fn received(&mut self) -> Vec<u8> {
        self.usart.received()
    }

    /// The stream of the DMA controller whose peripheral asks for a transfer.
    fn due_stream(&self) -> Option<usize> {
        let due = |stream: usize, asked: bool| self.dma.waits(stream) && asked;
        let stream = if due(dma::RECEIVE, self.usart.asks_to_be_read()) {
            dma::RECEIVE
        } else if due(dma::TRANSMIT, self.usart.asks_for_a_byte()) {
            dma::TRANSMIT
        } else {
            return None;
        };
        (self.rcc.ahb1(DMA2) && self.rcc.apb2(USART1)).then_some(stream)
    }

    /// The next transfer of the DMA controller that is due, if one is; whoever has the memory carries
    /// it out.
    pub fn transfer(&mut self) -> Option<Transfer> {
        while let Some(stream) = self.due_stream() {
            // A stream that cannot reach its memory stops, and another may be due.
            let Some(address) = self.dma.step(stream) else {
                continue;
            };
            return Some(if stream == dma::RECEIVE {
                let byte = self.usart.take();
                Transfer::Store { address, byte }
            } else {
                Transfer::Fetch { address }
            });
        }
        None
    }

    /// The byte of a [`Transfer::Fetch`].
    pub fn fetched(&mut self, byte: u8) {
        self.usart.put(byte, self.now);
    }

    fn target(&mut self, address: u32) -> Result<(Target<'_>, u32), Unknown> {
        let rcc = &self.rcc;
        let (clocked, base, model): (bool, u32, &mut dyn Peripheral) = match address {
            0x4000_0000..0x4000_0400 => (rcc.apb1(0), 0x4000_0000, &mut self.tick),
            0x4000_0400..0x4000_0800 => (rcc.apb1(1), 0x4000_0400, &mut self.encoder),
            0x4000_3000..0x4000_3400 => (true, 0x4000_3000, &mut self.watchdog),
            0x4000_7000..0x4000_7400 => (rcc.apb1(28), 0x4000_7000, &mut self.power),
            0x4000_7400..0x4000_7800 => (rcc.apb1(29), 0x4000_7400, &mut self.converter),
            0x4001_1000..0x4001_1400 => (rcc.apb2(USART1), 0x4001_1000, &mut self.usart),
            0x4001_3C00..0x4001_4000 => (true, 0x4001_3C00, &mut self.lines),
            0x4002_0000..0x4002_0C00 => {
                let port = (address - 0x4002_0000) / 0x400;
                let base = 0x4002_0000 + 0x400 * port;
                (rcc.ahb1(port), base, &mut self.ports[port as usize])
            }
            0x4002_3800..0x4002_3C00 => (true, 0x4002_3800, &mut self.rcc),
            0x4002_3C00..0x4002_4000 => (true, 0x4002_3C00, &mut self.flash),
            0x4002_6400..0x4002_6800 => (rcc.ahb1(DMA2), 0x4002_6400, &mut self.dma),
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

    /// The word that a narrow write changes a part of.
    ///
    /// # Errors
    /// No model knows the register.
    pub fn beneath(&mut self, address: u32) -> Result<u32, Unknown> {
        match address {
            // Reading it would take what was received; it has one byte only.
            USART1_DATA => Ok(0),
            _ => self.read(address),
        }
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
        self.flash.set_processor_hz(self.rcc.processor_hz());
        self.usart.set_ratio(self.rcc.cycles_per_apb2_cycle());
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
        if address == 0x4002_3810 && value >> DMA2 & 1 != 0 {
            self.dma = Dma::default();
        }
        if address == 0x4002_3824 && value >> USART1 & 1 != 0 {
            self.usart.reset();
        }
        if address == 0x4002_3820 {
            if value & 1 != 0 {
                self.tick = TickTimer::default();
            }
            if value >> 1 & 1 != 0 {
                self.encoder.reset();
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

    /// USART1 at 1 Mbaud with its pins, as [`send`](Bus::send) and the drive need them; DMA for both
    /// directions: 4 bytes round at `0x2000_0100`, and 3 from `0x2000_0200`.
    fn with_serial_port() -> Bus {
        let mut bus = Bus::new();
        for (address, value) in [
            // APB2 at half the processor's clock; clocks of port A, DMA2, USART1.
            (0x4002_3808, 0b100 << 13),
            (0x4002_3830, 1 << 22 | 1),
            (0x4002_3844, 1 << 4),
            // PA9 and PA10.
            (0x4002_0024, 7 << 4 | 7 << 8),
            (0x4002_0000, 0xA800_0000 | 0b10 << 18 | 0b10 << 20),
            (0x4001_1008, 84),
            (0x4001_1014, 1 << 6 | 1 << 7),
            (0x4001_100C, 1 << 13 | 1 << 3 | 1 << 2),
            // Stream 2.
            (0x4002_6448, 0x4001_1004),
            (0x4002_644C, 0x2000_0100),
            (0x4002_6444, 4),
            (0x4002_6440, 4 << 25 | 1 << 10 | 1 << 8 | 1),
            // Stream 7.
            (0x4002_64C0, 0x4001_1004),
            (0x4002_64C4, 0x2000_0200),
            (0x4002_64BC, 3),
        ] {
            bus.write(address, value).unwrap();
        }
        bus
    }

    /// Carries out what is due at a time.
    fn transfers(bus: &mut Bus, memory: &mut [u8; 0x300], now: u64) {
        bus.now = now;
        bus.advance();
        while let Some(transfer) = bus.transfer() {
            match transfer {
                Transfer::Store { address, byte } => {
                    memory[address as usize - 0x2000_0000] = byte;
                }
                Transfer::Fetch { address } => bus.fetched(memory[address as usize - 0x2000_0000]),
            }
        }
    }

    #[test]
    fn serial_bytes_come_and_go_by_dma() {
        let mut bus = with_serial_port();
        let mut memory = [0; 0x300];
        memory[0x200..0x203].copy_from_slice(b"abc");
        assert_eq!(bus.next_event(), None);
        bus.now = 100;
        bus.send(&[1, 2, 3, 4, 5]);
        for byte in 1..=5 {
            let at = 100 + 1680 * byte;
            assert_eq!(bus.next_event(), Some(at));
            transfers(&mut bus, &mut memory, at);
        }
        assert_eq!(memory[0x100..0x105], [5, 2, 3, 4, 0]);
        assert_eq!((bus.read(0x4002_6444), bus.next_event()), (Ok(3), None));

        // Enabled, the transmitter's stream is due at once.
        bus.now = 20_000;
        bus.write(0x4002_64B8, 4 << 25 | 1 << 10 | 1 << 6 | 1)
            .unwrap();
        assert_eq!(bus.next_event(), Some(20_000));
        transfers(&mut bus, &mut memory, 20_000);
        // One byte is on the line, one waits behind it.
        assert_eq!(bus.read(0x4002_64BC), Ok(1));
        transfers(&mut bus, &mut memory, 20_000 + 1680);
        assert_eq!(bus.received(), b"a");
        assert_eq!(bus.read(0x4002_64B8).unwrap() & 1, 0);
        assert_eq!(bus.read(0x4002_6404).unwrap() >> 27 & 1, 1);
        transfers(&mut bus, &mut memory, 20_000 + 2 * 1680);
        transfers(&mut bus, &mut memory, 20_000 + 3 * 1680);
        assert_eq!((bus.received(), bus.next_event()), (b"bc".to_vec(), None));
    }

    #[test]
    fn serial_bytes_need_clock_and_pins() {
        for (address, value) in [
            (0x4002_3844, 0),
            (0x4002_0000, 0xA800_0000),
            (0x4002_0024, 0),
        ] {
            let mut bus = with_serial_port();
            bus.write(address, value).unwrap();
            bus.send(&[1]);
            assert_eq!((bus.waiting(), bus.next_event()), (0, None), "{address:#x}");
        }
        // Without the controller's clock its streams do nothing; in reset they are gone.
        let mut bus = with_serial_port();
        bus.write(0x4002_3830, 1).unwrap();
        bus.send(&[1]);
        transfers(&mut bus, &mut [0; 0x300], 1680);
        assert_eq!(
            (bus.read(0x4001_1000).unwrap() >> 5 & 1, bus.next_event()),
            (1, None)
        );
        // A narrow write of DR does not take what was received.
        assert_eq!(bus.beneath(0x4001_1004), Ok(0));
        assert_eq!(bus.read(0x4001_1004), Ok(1));
        let mut bus = with_serial_port();
        bus.write(0x4002_3810, 1 << 22).unwrap();
        bus.write(0x4002_3824, 1 << 4).unwrap();
        assert_eq!(
            (bus.read(0x4002_6440), bus.read(0x4001_1008)),
            (Ok(0), Ok(0))
        );
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
