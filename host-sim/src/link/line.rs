//! Frames on a port.

use super::port::Port;
use crate::error::Result;
use arso_core::link::frame::{Frame, LONGEST, Receiver, frame};
use arso_core::link::message::{Answered, HELLO, Introduction, TAG};
use serde::Serialize;
use std::time::Instant;

/// What the drive says.
#[derive(Debug)]
pub(super) enum Heard {
    /// Which drive it is.
    Introduction(Introduction),
    /// An answer, or telemetry.
    Answered(Answered<Vec<f32>>),
}

/// A port on which frames are sent and heard.
#[derive(Debug)]
pub(super) struct Line {
    pub(super) port: Port,
    receiver: Receiver,
    /// Bytes that have come, and how many of them have been looked at.
    bytes: Vec<u8>,
    at: usize,
    /// Bytes that have come so far.
    pub(super) received: u64,
}

impl Line {
    pub(super) fn new(port: Port) -> Self {
        Self {
            port,
            receiver: Receiver::default(),
            bytes: Vec::new(),
            at: 0,
            received: 0,
        }
    }

    /// Sends a message.
    pub(super) fn send<T: Serialize>(&mut self, tag: u16, message: &T) -> Result<()> {
        let mut buffer = [0; LONGEST];
        // Everything that is asked is short.
        let bytes = frame(tag, message, &mut buffer).unwrap_or_default();
        self.port.write(bytes)
    }

    /// The next thing that the drive says, if it says one until then. What is damaged, or of another version, is
    /// nothing.
    pub(super) fn hear(&mut self, until: Instant) -> Result<Option<Heard>> {
        loop {
            while let Some(byte) = self.bytes.get(self.at) {
                self.at += 1;
                let ended = self.receiver.take(*byte);
                if let Some(heard) = ended.and_then(|frame| understood(&frame.ok()?)) {
                    return Ok(Some(heard));
                }
            }
            if Instant::now() > until {
                return Ok(None);
            }
            let mut buffer = [0; 4096];
            let length = self.port.read(&mut buffer)?;
            self.bytes.clear();
            self.bytes.extend(buffer.iter().take(length));
            self.at = 0;
            self.received += length as u64;
        }
    }
}

fn understood(frame: &Frame<'_>) -> Option<Heard> {
    match frame.tag {
        HELLO => frame.message().ok().map(Heard::Introduction),
        TAG => frame.message().ok().map(Heard::Answered),
        _ => None,
    }
}
