//! defmt over RTT, without a critical section.
//!
//! The usual transport masks all interrupts while it writes a frame, which would delay the
//! control interrupt by as long. Here only thread mode logs (start-up and the idle loop), so no
//! lock is needed: a frame is put together in a buffer of its own and handed to the RTT channel
//! whole. A full channel drops whole frames, never parts; the log counts what is missing.

use core::cell::UnsafeCell;
use rtt_target::{ChannelMode, UpChannel, rtt_init};

/// Longest frame; a record of six loads needs half of it.
const FRAME: usize = 512;

/// Size of the RTT buffer: some 100 ms of records at 1 kHz.
const CHANNEL: usize = 8192;

struct Transport {
    channel: Option<UpChannel>,
    encoder: defmt::Encoder,
    frame: [u8; FRAME],
    length: usize,
}

struct Shared(UnsafeCell<Transport>);

// SAFETY: only thread mode gets at the transport, see `transport`.
unsafe impl Sync for Shared {}

static TRANSPORT: Shared = Shared(UnsafeCell::new(Transport {
    channel: None,
    encoder: defmt::Encoder::new(),
    frame: [0; FRAME],
    length: 0,
}));

/// The transport, or nothing in an interrupt.
fn transport() -> Option<&'static mut Transport> {
    let in_interrupt = cortex_m::peripheral::SCB::vect_active()
        != cortex_m::peripheral::scb::VectActive::ThreadMode;
    // SAFETY: there is one thread, and a reference lives only within one call of a function of
    // this file, none of which calls another while it holds one.
    (!in_interrupt).then(|| unsafe { &mut *TRANSPORT.0.get() })
}

/// Sets the channel up; before that, frames are dropped.
pub(super) fn start() {
    let channels = rtt_init! {
        up: {
            0: {
                size: CHANNEL,
                mode: ChannelMode::NoBlockSkip,
                name: "defmt"
            }
        }
    };
    if let Some(transport) = transport() {
        transport.channel = Some(channels.up.0);
    }
}

#[defmt::global_logger]
struct Logger;

impl Transport {
    fn push(frame: &mut [u8; FRAME], length: &mut usize, bytes: &[u8]) {
        if let Some(free) = frame.get_mut(*length..*length + bytes.len()) {
            free.copy_from_slice(bytes);
            *length += bytes.len();
        } else {
            // Too long: dropped as a whole in `release`.
            *length = FRAME + 1;
        }
    }
}

// SAFETY: `acquire` to `release` run in thread mode only, which nothing else of the kind can
// preempt, so frames are never mixed; in an interrupt every function does nothing.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        if let Some(Transport {
            encoder,
            frame,
            length,
            ..
        }) = transport()
        {
            *length = 0;
            encoder.start_frame(|bytes| Transport::push(frame, length, bytes));
        }
    }

    unsafe fn flush() {}

    unsafe fn release() {
        if let Some(Transport {
            channel,
            encoder,
            frame,
            length,
        }) = transport()
        {
            encoder.end_frame(|bytes| Transport::push(frame, length, bytes));
            if let (Some(channel), Some(frame)) = (channel, frame.get(..*length)) {
                // The host can ask for writes that wait for it; nothing here waits for a host.
                channel.set_mode(ChannelMode::NoBlockSkip);
                channel.write(frame);
            }
        }
    }

    unsafe fn write(bytes: &[u8]) {
        if let Some(Transport {
            encoder,
            frame,
            length,
            ..
        }) = transport()
        {
            encoder.write(bytes, |bytes| Transport::push(frame, length, bytes));
        }
    }
}
