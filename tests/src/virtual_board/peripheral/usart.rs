//! USART1 [30]: asynchronous, eight data bits, one stop bit, no parity, no interrupts.
//!
//! ```text
//! world --send--> line --byte time--> shift register --> DR (RXNE; ORE when it is full still)
//! DR (TXE) --> shift register --byte time (TC)--> line --received--> world
//! ```
//!
//! The world sends and listens at whatever rate the drive has set. Left out: the idle frame that the
//! real part sends first when its transmitter is enabled, errors of noise and framing.

use super::{Peripheral, Unknown};
use std::collections::VecDeque;

/// Bits of SR.
pub const ORE: u32 = 1 << 3;
/// See `ORE`.
pub const IDLE: u32 = 1 << 4;
/// See `ORE`.
pub const RXNE: u32 = 1 << 5;
/// See `ORE`.
pub const TC: u32 = 1 << 6;
/// See `ORE`.
pub const TXE: u32 = 1 << 7;

/// Bits of CR1.
const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
const UE: u32 = 1 << 13;
const OVER8: u32 = 1 << 15;
/// Bits of CR3.
const DMAR: u32 = 1 << 6;
const DMAT: u32 = 1 << 7;

/// Start bit, eight of data, stop bit.
const FRAME_BITS: u64 = 10;

/// Bytes kept for a world that does not take them; the oldest go first.
const MOST_KEPT: usize = 1 << 20;

/// Which of its pins are set up for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pins {
    /// RX.
    pub receives: bool,
    /// TX.
    pub transmits: bool,
}

/// The registers, and both lines.
#[derive(Clone, Debug)]
pub struct Usart {
    /// Without TXE, which follows from the transmit register.
    sr: u32,
    /// What of SR was read: access to DR clears that much.
    seen: u32,
    receive_register: u8,
    /// What waits for the shift register; TXE while nothing does.
    transmit_register: Option<u8>,
    brr: u32,
    cr1: u32,
    cr3: u32,
    gtpr: u32,
    /// Processor cycles per cycle of its bus.
    ratio: u64,
    /// What the world has sent and has not arrived, and when its first byte has arrived.
    incoming: VecDeque<u8>,
    arrives: Option<u64>,
    /// When the line will have been idle for a frame.
    idle: Option<u64>,
    /// The byte in the transmit shift register, and when it has left.
    leaving: Option<(u8, u64)>,
    sent: VecDeque<u8>,
}

impl Default for Usart {
    fn default() -> Self {
        Self {
            sr: TC,
            seen: 0,
            receive_register: 0,
            transmit_register: None,
            brr: 0,
            cr1: 0,
            cr3: 0,
            gtpr: 0,
            ratio: 1,
            incoming: VecDeque::new(),
            arrives: None,
            idle: None,
            leaving: None,
            sent: VecDeque::new(),
        }
    }
}

impl Usart {
    /// The bus tells the clock ratio when it gives access.
    pub fn set_ratio(&mut self, ratio: u64) {
        self.ratio = ratio;
    }

    /// Registers as after reset; what has left already has left.
    pub fn reset(&mut self) {
        *self = Self {
            ratio: self.ratio,
            sent: std::mem::take(&mut self.sent),
            ..Self::default()
        };
    }

    /// Processor cycles of a byte on the line; none while the rate is not set [30.3.4].
    fn frame(&self) -> u64 {
        let bit = if self.cr1 & OVER8 == 0 {
            self.brr
        } else {
            // Three bits of fraction, the fourth is kept clear.
            (self.brr >> 4) * 8 + (self.brr & 7)
        };
        FRAME_BITS * u64::from(bit) * self.ratio
    }

    /// Whether receiver or transmitter works.
    fn works(&self, direction: u32) -> bool {
        self.cr1 & UE != 0 && self.cr1 & direction != 0 && self.frame() != 0
    }

    /// The world sends bytes; they begin to pass now, or behind those that pass already. Where nobody
    /// receives they are lost, as on a line.
    pub fn send(&mut self, bytes: &[u8], now: u64, pins: Pins) {
        if bytes.is_empty() || !(pins.receives && self.works(RE)) {
            return;
        }
        self.incoming.extend(bytes);
        if self.arrives.is_none() {
            self.notice_idle(now);
            self.idle = None;
            self.arrives = Some(now + self.frame());
        }
    }

    /// Bytes of the world that have not arrived.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.incoming.len()
    }

    /// The world takes what was transmitted since it last did.
    pub fn received(&mut self) -> Vec<u8> {
        self.sent.drain(..).collect()
    }

    /// When the next byte has arrived or left.
    #[must_use]
    pub fn next_event(&self) -> Option<u64> {
        let leaves = self.leaving.map(|(_, at)| at);
        [self.arrives, leaves].into_iter().flatten().min()
    }

    /// Advances to a time.
    pub fn advance(&mut self, now: u64, pins: Pins) {
        while let Some(at) = self.arrives.filter(|at| *at <= now) {
            let byte = self.incoming.pop_front();
            if let Some(byte) = byte.filter(|_| pins.receives && self.works(RE)) {
                self.arrive(byte);
            }
            let next = at + self.frame();
            self.arrives = (!self.incoming.is_empty()).then_some(next);
            self.idle = Some(next);
        }
        while let Some((byte, at)) = self.leaving.filter(|(_, at)| *at <= now) {
            if pins.transmits {
                self.sent.push_back(byte);
                if self.sent.len() > MOST_KEPT {
                    self.sent.pop_front();
                }
            }
            self.leaving = None;
            self.load(at);
            if self.leaving.is_none() {
                self.sr |= TC;
            }
        }
    }

    /// A byte is complete in the shift register.
    fn arrive(&mut self, byte: u8) {
        if self.sr & RXNE == 0 {
            self.receive_register = byte;
            self.sr |= RXNE;
        } else {
            self.sr |= ORE;
        }
    }

    /// What waits goes into the shift register if that is free.
    fn load(&mut self, now: u64) {
        if self.leaving.is_none() && self.works(TE) {
            let frame = self.frame();
            self.leaving = self
                .transmit_register
                .take()
                .map(|byte| (byte, now + frame));
        }
    }

    /// Nothing waits for the idle flag, so it is set when somebody looks.
    fn notice_idle(&mut self, now: u64) {
        if self.arrives.is_none() && self.idle.is_some_and(|at| at <= now) {
            self.idle = None;
            if self.works(RE) {
                self.sr |= IDLE;
            }
        }
    }

    fn status(&self) -> u32 {
        self.sr
            | if self.transmit_register.is_none() {
                TXE
            } else {
                0
            }
    }

    /// Whether the receiver asks the DMA controller to take its byte.
    #[must_use]
    pub fn asks_to_be_read(&self) -> bool {
        self.cr3 & DMAR != 0 && self.sr & RXNE != 0
    }

    /// Whether the transmitter asks the DMA controller for a byte.
    #[must_use]
    pub fn asks_for_a_byte(&self) -> bool {
        self.cr3 & DMAT != 0 && self.transmit_register.is_none() && self.works(TE)
    }

    /// A read of DR.
    pub fn take(&mut self) -> u8 {
        self.sr &= !(RXNE | self.seen & (ORE | IDLE));
        self.seen &= TC;
        self.receive_register
    }

    /// A write of DR.
    pub fn put(&mut self, byte: u8, now: u64) {
        self.sr &= !(self.seen & TC);
        self.seen &= !TC;
        self.transmit_register = Some(byte);
        self.load(now);
    }
}

impl Peripheral for Usart {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, Unknown> {
        Ok(match offset {
            0x00 => {
                self.notice_idle(now);
                self.seen = self.status();
                self.seen
            }
            0x04 => self.take().into(),
            0x08 => self.brr,
            0x0C => self.cr1,
            // One stop bit, no clock on a pin, no LIN.
            0x10 => 0,
            0x14 => self.cr3,
            0x18 => self.gtpr,
            _ => return Err(Unknown),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), Unknown> {
        match offset {
            // These two are cleared by writing zero, the others stay.
            0x00 => self.sr &= value | !(RXNE | TC),
            0x04 => self.put(value as u8, now),
            0x08 => {
                self.brr = value & 0xFFFF;
                self.load(now);
            }
            // Interrupts, nine bits, parity, wake-up and break are not modelled.
            0x0C if value & !(UE | TE | RE | OVER8) == 0 => {
                self.cr1 = value;
                self.load(now);
            }
            0x10 if value == 0 => {}
            // Neither are handshake, half duplex, smartcard and infrared.
            0x14 if value & !(DMAR | DMAT) == 0 => self.cr3 = value,
            // Only smartcard and infrared use it.
            0x18 => self.gtpr = value & 0xFFFF,
            _ => return Err(Unknown),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PINS: Pins = Pins {
        receives: true,
        transmits: true,
    };
    /// Of 1 Mbaud at 84 MHz, in processor cycles at 168 MHz.
    const FRAME: u64 = 1680;

    fn started() -> Usart {
        let mut usart = Usart::default();
        usart.set_ratio(2);
        usart.write(0x08, 84, 0).unwrap();
        usart.write(0x0C, UE | TE | RE, 0).unwrap();
        usart
    }

    #[test]
    fn reset_values_and_what_is_not_modelled() {
        let mut usart = Usart::default();
        assert_eq!(usart.read(0x00, 0), Ok(TXE | TC));
        for offset in [0x04, 0x08, 0x0C, 0x10, 0x14, 0x18] {
            assert_eq!(usart.read(offset, 0), Ok(0));
        }
        assert_eq!(usart.read(0x1C, 0), Err(Unknown));
        // IDLEIE to PEIE, parity, nine bits, break; stop bits; EIE.
        for bit in [4, 5, 6, 7, 8, 10, 12, 0] {
            assert_eq!(usart.write(0x0C, UE | 1 << bit, 0), Err(Unknown), "{bit}");
        }
        assert_eq!(usart.write(0x10, 0b10 << 12, 0), Err(Unknown));
        assert_eq!(usart.write(0x14, 1, 0), Err(Unknown));
        assert_eq!(usart.read(0x0C, 0), Ok(0));
    }

    #[test]
    fn a_byte_takes_ten_bits_to_leave() {
        let mut usart = started();
        usart.write(0x00, !TC, 90).unwrap();
        usart.write(0x04, 0x55, 100).unwrap();
        // The shift register was free.
        assert_eq!(usart.read(0x00, 100), Ok(TXE));
        usart.write(0x04, 0xAA, 110).unwrap();
        assert_eq!(usart.read(0x00, 110), Ok(0));
        assert_eq!(usart.next_event(), Some(100 + FRAME));
        usart.advance(100 + FRAME - 1, PINS);
        assert!(usart.received().is_empty());
        usart.advance(100 + FRAME, PINS);
        assert_eq!(
            (usart.received(), usart.read(0x00, 0)),
            (vec![0x55], Ok(TXE))
        );
        assert_eq!(usart.next_event(), Some(100 + 2 * FRAME));
        usart.advance(100 + 2 * FRAME, PINS);
        assert_eq!(usart.received(), [0xAA]);
        assert_eq!(
            (usart.read(0x00, 0), usart.next_event()),
            (Ok(TXE | TC), None)
        );
        // SR was read with TC: writing DR clears it.
        usart.write(0x04, 1, 5000).unwrap();
        assert_eq!(usart.read(0x00, 0), Ok(TXE));
        // A pin that is not the transmitter's carries nothing.
        usart.advance(10_000, Pins::default());
        assert_eq!(
            (usart.received(), usart.read(0x00, 0)),
            (vec![], Ok(TXE | TC))
        );
    }

    #[test]
    fn rates() {
        let mut usart = started();
        assert_eq!(usart.frame(), FRAME);
        usart.write(0x0C, OVER8, 0).unwrap();
        // 10 and 4 eighths of 8 bus cycles each.
        usart.write(0x08, 10 << 4 | 4, 0).unwrap();
        assert_eq!(usart.frame(), FRAME);
        // Without a rate nothing leaves.
        let mut usart = started();
        usart.write(0x08, 0, 0).unwrap();
        usart.write(0x04, 1, 0).unwrap();
        assert_eq!((usart.next_event(), usart.read(0x00, 0)), (None, Ok(TC)));
        usart.write(0x08, 84, 7).unwrap();
        assert_eq!(usart.next_event(), Some(7 + FRAME));
    }

    #[test]
    fn bytes_arrive_one_a_frame_and_the_unread_overrun() {
        let mut usart = started();
        usart.send(&[1, 2, 3], 1000, PINS);
        usart.advance(1000 + FRAME - 1, PINS);
        assert_eq!(usart.read(0x00, 0).unwrap() & RXNE, 0);
        usart.advance(1000 + FRAME, PINS);
        assert_eq!(usart.read(0x00, 0).unwrap() & (RXNE | ORE), RXNE);
        // The second is lost, the first is still there.
        usart.advance(1000 + 2 * FRAME, PINS);
        assert_eq!(usart.read(0x00, 0).unwrap() & (RXNE | ORE), RXNE | ORE);
        assert_eq!(usart.read(0x04, 0), Ok(1));
        assert_eq!(usart.read(0x00, 0).unwrap() & (RXNE | ORE), 0);
        assert_eq!(usart.waiting(), 1);
        usart.advance(1000 + 3 * FRAME, PINS);
        assert_eq!((usart.read(0x04, 0), usart.next_event()), (Ok(3), None));
    }

    #[test]
    fn an_overrun_that_nobody_saw_stays() {
        let mut usart = started();
        usart.send(&[1, 2], 0, PINS);
        usart.advance(2 * FRAME, PINS);
        assert_eq!(usart.read(0x04, 0), Ok(1));
        assert_ne!(usart.read(0x00, 0).unwrap() & ORE, 0);
        usart.read(0x04, 0).unwrap();
        assert_eq!(usart.read(0x00, 0).unwrap() & ORE, 0);
    }

    #[test]
    fn the_line_is_idle_a_frame_after_its_last_byte_once() {
        let mut usart = started();
        usart.send(&[1], 0, PINS);
        usart.advance(FRAME, PINS);
        assert_eq!(usart.read(0x00, 2 * FRAME - 1).unwrap() & IDLE, 0);
        assert_ne!(usart.read(0x00, 2 * FRAME).unwrap() & IDLE, 0);
        usart.read(0x04, 0).unwrap();
        assert_eq!(usart.read(0x00, 9 * FRAME).unwrap() & IDLE, 0);
        // A byte that begins before keeps the line busy.
        usart.send(&[2], 10 * FRAME, PINS);
        usart.advance(11 * FRAME, PINS);
        usart.send(&[3], 11 * FRAME + 5, PINS);
        assert_eq!(usart.read(0x00, 12 * FRAME).unwrap() & IDLE, 0);
    }

    #[test]
    fn what_nobody_receives_is_lost() {
        let mut usart = started();
        usart.send(&[1], 0, Pins::default());
        assert_eq!(usart.next_event(), None);
        usart.write(0x0C, UE | TE, 0).unwrap();
        usart.send(&[1], 0, PINS);
        assert_eq!(usart.next_event(), None);
        // Switched off while bytes pass.
        let mut usart = started();
        usart.send(&[1, 2], 0, PINS);
        usart.write(0x0C, 0, 10).unwrap();
        usart.advance(10 * FRAME, PINS);
        assert_eq!((usart.read(0x00, 0), usart.waiting()), (Ok(TXE | TC), 0));
    }

    #[test]
    fn requests() {
        let mut usart = started();
        assert!(!usart.asks_for_a_byte());
        usart.write(0x14, DMAR | DMAT, 0).unwrap();
        assert!(usart.asks_for_a_byte() && !usart.asks_to_be_read());
        usart.put(1, 0);
        assert!(usart.asks_for_a_byte());
        usart.put(2, 0);
        assert!(!usart.asks_for_a_byte());
        usart.send(&[7], 0, PINS);
        usart.advance(FRAME, PINS);
        assert!(usart.asks_to_be_read());
        assert_eq!(usart.take(), 7);
        assert!(!usart.asks_to_be_read());
    }
}
