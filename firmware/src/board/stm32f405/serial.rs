//! USART1 on PA9 and PA10, 1 Mbaud, 8N1, by DMA2 in both directions: no byte interrupts the processor.
//!
//! ```text
//! PA10 -> USART1 -> stream 2, round and round -> ring -> read
//! send -> buffer -> stream 7, once -> USART1 -> PA9
//! ```
//!
//! Who reads too late finds the ring overwritten, and the frames in it damaged.

use super::safe_stop;
use arso_core::link::server::WAITING;
use arso_firmware::board;
use core::sync::atomic::{AtomicU8, Ordering, compiler_fence};
use embedded_dma::{ReadBuffer, WriteBuffer};
use stm32f4xx_hal::ClearFlags;
use stm32f4xx_hal::dma::config::DmaConfig;
use stm32f4xx_hal::dma::traits::Stream;
use stm32f4xx_hal::dma::{
    MemoryToPeripheral, PeripheralToMemory, Stream2, Stream7, StreamsTuple, Transfer,
};
use stm32f4xx_hal::gpio::{Pull, gpioa};
use stm32f4xx_hal::pac::{DMA2, USART1};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::{Config, Rx, Serial, Tx, config};

const BAUD: u32 = 1_000_000;
/// Bytes between two readings, at most: 5 ms of them.
const RING: usize = 512;

/// Channel of both streams that is USART1's (reference manual RM0090, table 43).
const CHANNEL: u8 = 4;

/// Memory that the DMA controller shares with the program.
type Bytes<const N: usize> = [AtomicU8; N];

static RECEIVED: Bytes<RING> = [const { AtomicU8::new(0) }; RING];
static SENT: Bytes<WAITING> = [const { AtomicU8::new(0) }; WAITING];

/// What is written by the DMA controller.
struct Ring(&'static Bytes<RING>);

// SAFETY: memory of that length that is there for ever, every byte of which may change at any time.
unsafe impl WriteBuffer for Ring {
    type Word = u8;

    unsafe fn write_buffer(&mut self) -> (*mut u8, usize) {
        (self.0.as_ptr().cast_mut().cast(), RING)
    }
}

/// What is read by the DMA controller: so many bytes.
struct Outgoing(&'static Bytes<WAITING>, usize);

// SAFETY: memory of that length that is there for ever.
unsafe impl ReadBuffer for Outgoing {
    type Word = u8;

    unsafe fn read_buffer(&self) -> (*const u8, usize) {
        (self.0.as_ptr().cast(), self.1)
    }
}

/// The line.
pub(crate) struct SerialLine {
    receive: Transfer<Stream2<DMA2>, CHANNEL, Rx<USART1>, PeripheralToMemory, Ring>,
    transmit: Transfer<Stream7<DMA2>, CHANNEL, Tx<USART1>, MemoryToPeripheral, Outgoing>,
    /// Next byte of the ring.
    next: usize,
}

impl SerialLine {
    pub(super) fn new(
        usart: USART1,
        dma: DMA2,
        tx: gpioa::PA9,
        rx: gpioa::PA10,
        rcc: &mut Rcc,
    ) -> Self {
        // An unplugged line is idle, not noise.
        let rx = rx.into_alternate::<7>().internal_resistor(Pull::Up);
        let config = Config::default()
            .baudrate(BAUD.bps())
            .dma(config::DmaConfig::TxRx);
        // That rate divides the clock: it cannot fail.
        let Ok(serial) = Serial::<_, u8>::new(usart, (tx, rx), config, rcc) else {
            safe_stop::stop();
        };
        let (tx, rx) = serial.split();
        let streams = StreamsTuple::new(dma, rcc);
        let config = DmaConfig::default().memory_increment(true);
        let ring = Ring(&RECEIVED);
        let mut receive = Transfer::init_peripheral_to_memory(streams.2, rx, ring, None, config);
        // SAFETY: the stream has not been started; round and round in the memory that it has anyway.
        unsafe { receive.stream() }.set_circular_mode(true);
        receive.start(|_| ());
        let nothing = Outgoing(&SENT, 0);
        let transmit = Transfer::init_memory_to_peripheral(streams.7, tx, nothing, None, config);
        Self {
            receive,
            transmit,
            next: 0,
        }
    }
}

impl board::Serial for SerialLine {
    fn read(&mut self) -> Option<u8> {
        // The stream counts down what is left until it begins again.
        let left = usize::from(self.receive.number_of_transfers());
        let written = RING.saturating_sub(left) % RING;
        // What is read below was written before.
        compiler_fence(Ordering::Acquire);
        if self.next == written {
            return None;
        }
        let byte = RECEIVED.get(self.next)?.load(Ordering::Relaxed);
        self.next = (self.next + 1) % RING;
        Some(byte)
    }

    fn send(&mut self, bytes: &[u8]) -> bool {
        // SAFETY: only looked at. The controller ends the stream after its last byte, and after an error.
        let leaving = unsafe { self.transmit.stream() }.is_enabled();
        if bytes.is_empty() || leaving {
            return false;
        }
        for (place, byte) in SENT.iter().zip(bytes) {
            place.store(*byte, Ordering::Relaxed);
        }
        let length = bytes.len().min(WAITING);
        // With a flag of the last transfer standing the stream does not start (RM0090, 10.3.17).
        self.transmit.clear_all_flags();
        self.transmit.next_transfer(Outgoing(&SENT, length)).is_ok()
    }
}
