//! DMA2 [10]: bytes between USART1 and memory, by stream 2 (receive, circular) and stream 7 (transmit,
//! once); no other stream, no FIFO, no interrupts.
//!
//! The model has registers only: it says which transfer is due, the bus moves the byte at the side of
//! the peripheral and the processor's loop the one in memory. A transfer takes no time and steals none
//! from the processor.
//!
//! There the controller also reads flash; here memory is SRAM.

use super::{Peripheral, Unknown};
use crate::virtual_board::image::{RAM, RAM_SIZE};

/// Stream that takes what USART1 has received.
pub const RECEIVE: usize = 2;
/// Stream that gives USART1 what it transmits.
pub const TRANSMIT: usize = 7;

/// Data register of USART1.
const DATA: u32 = 0x4001_1004;

/// Bits of CR.
const EN: u32 = 1;
const TO_PERIPHERAL: u32 = 0b01 << 6;
const CIRC: u32 = 1 << 8;
const MINC: u32 = 1 << 10;
const PRIORITY: u32 = 0b11 << 16;
const CHANNEL_4: u32 = 4 << 25;
/// Bits of CR that can be set and mean something.
const CR: u32 = 0x0FEF_FFFF;

/// Bits of FCR.
const DMDIS: u32 = 1 << 2;
const FEIE: u32 = 1 << 7;
/// Half full, and empty.
const FCR_RESET: u32 = 0x21;

/// Flags of a stream.
const TEIF: u32 = 1 << 3;
const HTIF: u32 = 1 << 4;
const TCIF: u32 = 1 << 5;
const FLAGS: u32 = 0b11_1101;

/// One stream.
#[derive(Clone, Copy, Debug)]
struct Stream {
    cr: u32,
    /// Bytes left.
    ndtr: u32,
    par: u32,
    m0ar: u32,
    m1ar: u32,
    fcr: u32,
    /// Bytes of a whole transfer.
    whole: u32,
}

impl Default for Stream {
    fn default() -> Self {
        Self {
            cr: 0,
            ndtr: 0,
            par: 0,
            m0ar: 0,
            m1ar: 0,
            fcr: FCR_RESET,
            whole: 0,
        }
    }
}

impl Stream {
    fn enabled(&self) -> bool {
        self.cr & EN != 0
    }

    /// Whether the model does what a control register asks of a stream.
    fn known(&self, stream: usize, cr: u32) -> bool {
        let direction = match stream {
            RECEIVE => CIRC,
            TRANSMIT => TO_PERIPHERAL,
            _ => return false,
        };
        cr & !PRIORITY == CHANNEL_4 | MINC | direction | EN
            && self.fcr & DMDIS == 0
            && self.par == DATA
    }

    /// Writes CR; whether that has ended a transfer.
    fn control(&mut self, stream: usize, value: u32) -> Result<bool, Unknown> {
        let was = self.enabled();
        let value = value & CR;
        if value & EN == 0 {
            self.cr = if was { self.cr & !EN } else { value };
            return Ok(was);
        }
        if !self.known(stream, value) {
            return Err(Unknown);
        }
        if !was {
            self.cr = value;
            // Nothing left: once more what was written last.
            if self.ndtr == 0 {
                self.ndtr = self.whole;
            }
            self.whole = self.ndtr;
        }
        Ok(false)
    }
}

/// The registers.
#[derive(Clone, Debug, Default)]
pub struct Dma {
    streams: [Stream; 8],
    flags: [u32; 8],
}

impl Dma {
    /// Whether a stream waits for its peripheral's request.
    #[must_use]
    pub fn waits(&self, stream: usize) -> bool {
        self.streams[stream].enabled() && self.streams[stream].ndtr > 0
    }

    /// Makes the next transfer of a stream that [`waits`](Self::waits): the address in memory; nothing
    /// where there is none that the controller can reach, which stops the stream.
    pub fn step(&mut self, number: usize) -> Option<u32> {
        let stream = &mut self.streams[number];
        let address = stream.m0ar.wrapping_add(stream.whole - stream.ndtr);
        if !(RAM..RAM + RAM_SIZE).contains(&address) {
            stream.cr &= !EN;
            self.flags[number] |= TEIF;
            return None;
        }
        stream.ndtr -= 1;
        if stream.ndtr == stream.whole / 2 {
            self.flags[number] |= HTIF;
        }
        if stream.ndtr == 0 {
            self.flags[number] |= TCIF;
            if stream.cr & CIRC == 0 {
                stream.cr &= !EN;
            } else {
                stream.ndtr = stream.whole;
            }
        }
        Some(address)
    }
}

/// Where the flags of a stream begin in its status register [10.5.1].
fn shift(stream: usize) -> u32 {
    [0, 6, 16, 22][stream % 4]
}

/// Stream and register behind an offset.
fn place(offset: u32) -> Result<(usize, u32), Unknown> {
    match offset {
        0x10..0xD0 => Ok(((offset - 0x10) as usize / 0x18, (offset - 0x10) % 0x18)),
        _ => Err(Unknown),
    }
}

impl Peripheral for Dma {
    fn read(&mut self, offset: u32, _: u64) -> Result<u32, Unknown> {
        if let 0x00 | 0x04 = offset {
            let first = offset as usize;
            let flags = (first..first + 4).map(|stream| self.flags[stream] << shift(stream));
            return Ok(flags.sum());
        }
        // The registers that clear flags read as nothing.
        if let 0x08 | 0x0C = offset {
            return Ok(0);
        }
        let (stream, register) = place(offset)?;
        let stream = &self.streams[stream];
        Ok(match register {
            0x00 => stream.cr,
            0x04 => stream.ndtr,
            0x08 => stream.par,
            0x0C => stream.m0ar,
            0x10 => stream.m1ar,
            _ => stream.fcr,
        })
    }

    fn write(&mut self, offset: u32, value: u32, _: u64) -> Result<(), Unknown> {
        match offset {
            // The status registers are read-only.
            0x00 | 0x04 => return Ok(()),
            0x08 | 0x0C => {
                let first = offset as usize - 0x08;
                for stream in first..first + 4 {
                    self.flags[stream] &= !(value >> shift(stream) & FLAGS);
                }
                return Ok(());
            }
            _ => {}
        }
        let (number, register) = place(offset)?;
        let stream = &mut self.streams[number];
        let enabled = stream.enabled();
        match register {
            0x00 => {
                // With a flag of its last transfer standing a stream does not start [10.3.17].
                let stands = !enabled && self.flags[number] != 0;
                let value = if stands { value & !EN } else { value };
                // A stream that is stopped says that it has.
                if stream.control(number, value)? {
                    self.flags[number] |= TCIF;
                }
            }
            0x14 if value & FEIE != 0 => return Err(Unknown),
            // While a stream is enabled its other registers are protected.
            _ if enabled => {}
            0x04 => {
                stream.ndtr = value & 0xFFFF;
                stream.whole = stream.ndtr;
            }
            0x08 => stream.par = value,
            0x0C => stream.m0ar = value,
            0x10 => stream.m1ar = value,
            _ => stream.fcr = FCR_RESET & !0b11 | value & 0b111,
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Offsets of a stream's registers.
    fn at(stream: u32, register: u32) -> u32 {
        0x10 + 0x18 * stream + register
    }

    const RECEIVES: u32 = CHANNEL_4 | MINC | CIRC | EN;
    const TRANSMITS: u32 = CHANNEL_4 | MINC | TO_PERIPHERAL | EN;

    fn started(stream: u32, memory: u32, bytes: u32, cr: u32) -> Dma {
        let mut dma = Dma::default();
        dma.write(at(stream, 0x08), DATA, 0).unwrap();
        dma.write(at(stream, 0x0C), memory, 0).unwrap();
        dma.write(at(stream, 0x04), bytes, 0).unwrap();
        dma.write(at(stream, 0x00), cr, 0).unwrap();
        dma
    }

    #[test]
    fn a_circular_stream_begins_again() {
        let mut dma = started(2, RAM + 8, 4, RECEIVES);
        let steps: Vec<_> = (0..5)
            .map(|_| {
                let address = dma.step(RECEIVE);
                (address, dma.read(at(2, 0x04), 0), dma.read(0x00, 0))
            })
            .collect();
        let (half, whole) = (HTIF << 16, (HTIF | TCIF) << 16);
        assert_eq!(
            steps,
            [
                (Some(RAM + 8), Ok(3), Ok(0)),
                (Some(RAM + 9), Ok(2), Ok(half)),
                (Some(RAM + 10), Ok(1), Ok(half)),
                (Some(RAM + 11), Ok(4), Ok(whole)),
                (Some(RAM + 8), Ok(3), Ok(whole)),
            ]
        );
        dma.write(0x08, TCIF << 16, 0).unwrap();
        assert_eq!(dma.read(0x00, 0), Ok(half));
        assert_eq!(dma.read(at(2, 0x00), 0), Ok(RECEIVES));
    }

    #[test]
    fn a_stream_that_is_not_circular_ends() {
        let mut dma = started(7, RAM, 2, TRANSMITS);
        // Protected while enabled.
        for register in [0x04, 0x08, 0x0C] {
            dma.write(at(7, register), 0x77, 0).unwrap();
        }
        assert!(dma.waits(TRANSMIT) && !dma.waits(RECEIVE));
        assert_eq!(
            (dma.step(TRANSMIT), dma.step(TRANSMIT)),
            (Some(RAM), Some(RAM + 1))
        );
        assert!(!dma.waits(TRANSMIT));
        assert_eq!(dma.read(at(7, 0x00), 0), Ok(TRANSMITS & !EN));
        assert_eq!(dma.read(at(7, 0x04), 0), Ok(0));
        assert_eq!(dma.read(0x04, 0), Ok((HTIF | TCIF) << 22));
        dma.write(0x0C, FLAGS << 22, 0).unwrap();
        assert_eq!(dma.read(0x04, 0), Ok(0));
        // Enabled again it makes the same transfer.
        dma.write(at(7, 0x00), TRANSMITS, 0).unwrap();
        assert_eq!(
            (dma.read(at(7, 0x04), 0), dma.step(TRANSMIT)),
            (Ok(2), Some(RAM))
        );
    }

    #[test]
    fn a_stopped_stream_says_so_and_keeps_what_is_left() {
        let mut dma = started(7, RAM, 5, TRANSMITS);
        dma.step(TRANSMIT);
        dma.write(at(7, 0x00), 0, 0).unwrap();
        assert!(!dma.waits(TRANSMIT));
        assert_eq!(
            (dma.read(at(7, 0x04), 0), dma.read(0x04, 0)),
            (Ok(4), Ok(TCIF << 22))
        );
    }

    #[test]
    fn memory_out_of_reach_stops_the_stream() {
        // Core-coupled memory, and the byte behind the end of SRAM.
        for (memory, steps) in [(0x1000_0000, 0), (RAM + RAM_SIZE - 1, 1)] {
            let mut dma = started(2, memory, 2, RECEIVES);
            for _ in 0..steps {
                assert!(dma.step(RECEIVE).is_some());
            }
            assert_eq!(dma.step(RECEIVE), None);
            assert!(!dma.waits(RECEIVE));
            assert_ne!(dma.read(0x00, 0).unwrap() & TEIF << 16, 0);
        }
    }

    #[test]
    fn what_is_not_modelled_cannot_be_enabled() {
        for (stream, cr) in [
            (0, RECEIVES),
            (5, RECEIVES),
            (2, TRANSMITS),
            (7, RECEIVES),
            (2, RECEIVES & !CIRC),
            (7, TRANSMITS | CIRC),
            (2, RECEIVES & !MINC),
            (2, RECEIVES | 1 << 4),
            (2, RECEIVES | 1 << 2),
            (7, TRANSMITS | 0b01 << 13),
            (7, TRANSMITS | 0b01 << 11),
            (7, TRANSMITS & !CHANNEL_4 | 5 << 25),
            (7, TRANSMITS | 1 << 18),
        ] {
            let mut dma = Dma::default();
            dma.write(at(stream, 0x08), DATA, 0).unwrap();
            dma.write(at(stream, 0x04), 1, 0).unwrap();
            // It may be written down.
            dma.write(at(stream, 0), cr & !EN, 0).unwrap();
            assert_eq!(dma.write(at(stream, 0), cr, 0), Err(Unknown), "{cr:#x}");
        }
        // FIFO, its interrupt, another peripheral; any priority will do.
        let mut dma = Dma::default();
        assert_eq!(dma.write(at(2, 0), RECEIVES, 0), Err(Unknown));
        dma.write(at(2, 0x08), DATA, 0).unwrap();
        assert_eq!(dma.write(at(2, 0x14), FEIE, 0), Err(Unknown));
        dma.write(at(2, 0x14), DMDIS, 0).unwrap();
        assert_eq!(dma.write(at(2, 0), RECEIVES, 0), Err(Unknown));
        dma.write(at(2, 0x14), FCR_RESET, 0).unwrap();
        dma.write(at(2, 0), RECEIVES | PRIORITY, 0).unwrap();
        for offset in [0xD0, 0x100] {
            assert_eq!(dma.read(offset, 0), Err(Unknown));
            assert_eq!(dma.write(offset, 0, 0), Err(Unknown));
        }
    }
}
