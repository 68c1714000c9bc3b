//! The debugger's side of RTT: takes what the firmware has logged out of its memory.
//!
//! Layout of the control block: 16 bytes of identification, numbers of up and down channels, then
//! for each channel name, buffer, size, write offset, read offset, flags (SEGGER's RTT protocol).

use super::cpu::Board;
use super::image::Image;

/// Reader of up channel 0.
#[derive(Clone, Debug)]
pub struct Rtt {
    control: u32,
    attached: bool,
}

impl Rtt {
    /// The control block of a firmware, if it has one.
    #[must_use]
    pub fn new(image: &Image) -> Option<Self> {
        let control = image.symbol("_SEGGER_RTT")?;
        Some(Self {
            control,
            attached: false,
        })
    }

    /// Everything that was logged since the last call.
    pub fn take(&mut self, board: &mut Board) -> Vec<u8> {
        if !self.attached {
            // The identification is written last, when the block is ready.
            self.attached = board.memory(self.control, 10) == *b"SEGGER RTT";
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
        if write >= size || read >= size {
            return Vec::new();
        }
        let mut data = Vec::new();
        if write < read {
            data.extend(board.memory(buffer + read, (size - read) as usize));
            data.extend(board.memory(buffer, write as usize));
        } else {
            data.extend(board.memory(buffer + read, (write - read) as usize));
        }
        board.set_memory(channel + 16, &write.to_le_bytes());
        data
    }
}
