//! The debugger's side of RTT: takes what the firmware has logged out of its memory.
//!
//! Layout of the control block: 16 bytes of identification, numbers of up and down channels, then
//! for each channel name, buffer, size, write offset, read offset, flags (SEGGER's RTT protocol).

use super::cpu::Board;
use super::harm::LogHost;
use super::image::{Image, RAM_SIZE};

/// Reader of up channel 0.
#[derive(Clone, Debug)]
pub struct Rtt {
    control: u32,
    attached: bool,
    /// Bytes that a slow host may take already.
    allowance: f64,
}

/// What a control block begins with.
const IDENTIFICATION: [u8; 10] = *b"SEGGER RTT";
/// Flags of a channel: wait until there is room.
const BLOCK: u32 = 2;

impl Rtt {
    /// The control block of a firmware, if it has one.
    #[must_use]
    pub fn new(image: &Image) -> Option<Self> {
        let control = image.symbol("_SEGGER_RTT")?;
        Some(Self {
            control,
            attached: false,
            allowance: 0.0,
        })
    }

    /// What the host takes in one control period.
    pub fn period(&mut self, host: LogHost, board: &mut Board) -> Vec<u8> {
        match host {
            LogHost::Reads => self.take(board, usize::MAX),
            LogHost::Absent => Vec::new(),
            LogHost::Blocks(bytes) => {
                board.set_memory(self.control + 24 + 20, &BLOCK.to_le_bytes());
                self.allowance += bytes;
                let whole = self.allowance.floor();
                let taken = self.take(board, whole as usize);
                // What was not there to be taken is no credit.
                self.allowance -= whole;
                taken
            }
        }
    }

    /// The board starts again: the control block is taken away, so that the one that comes next is known as new.
    pub fn detach(&mut self, board: &mut Board) {
        board.set_memory(self.control, &[0; IDENTIFICATION.len()]);
        self.attached = false;
        self.allowance = 0.0;
    }

    /// What was logged since the last call, as far as it is taken.
    fn take(&mut self, board: &mut Board, most: usize) -> Vec<u8> {
        if !self.attached {
            // The identification is written last, when the block is ready.
            let identification = board.memory(self.control, IDENTIFICATION.len());
            self.attached = identification == IDENTIFICATION;
            if !self.attached {
                return Vec::new();
            }
        }
        let channel = self.control + 24;
        let bytes = board.memory(channel, 24);
        let word = |index: usize| {
            let bytes = &bytes[4 * index..4 * index + 4];
            u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
        };
        let (buffer, size, write, read) = (word(1), word(2), word(3), word(4));
        // A control block that makes no sense is left alone.
        if write >= size || read >= size || size > RAM_SIZE {
            return Vec::new();
        }
        let mut data = Vec::new();
        if write < read {
            data.extend(board.memory(buffer + read, (size - read) as usize));
            data.extend(board.memory(buffer, write as usize));
        } else {
            data.extend(board.memory(buffer + read, (write - read) as usize));
        }
        data.truncate(most);
        let read = (read + data.len() as u32) % size;
        board.set_memory(channel + 16, &read.to_le_bytes());
        data
    }
}
