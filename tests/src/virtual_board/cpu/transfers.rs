//! Memory's side of the DMA controller: what its streams have due is done before code runs on.

use super::Board;
use crate::virtual_board::bus::Transfer;

impl Board {
    /// Does what is due now. It takes no time.
    pub(super) fn carry_out_transfers(&mut self) {
        while let Some(transfer) = self.bus_mut().transfer() {
            match transfer {
                Transfer::Store { address, byte } => self.set_memory(address, &[byte]),
                Transfer::Fetch { address } => {
                    let byte = self.memory(address, 1);
                    self.bus_mut().fetched(byte.first().copied().unwrap_or(0));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_board::image::Image;

    /// Writes a table into registers, waits for three bytes and sends them back, assembled by hand:
    ///
    /// ```text
    ///        ldr r0, =table
    /// next:  ldmia r0!, {r1, r2}
    ///        cbz r1, wait
    ///        str r2, [r1]
    ///        b next
    /// wait:  ldr r1, =S2NDTR
    /// again: ldr r2, [r1]
    ///        cmp r2, #5
    ///        bne again
    ///        ldr r1, =S7CR
    ///        ldr r2, =start
    ///        str r2, [r1]
    ///        b .
    /// ```
    fn echo(buffer: u32) -> Image {
        let mut words = vec![
            0x2000_2000,
            0x0800_0009,
            0xC806_4806,
            0x600A_B109,
            0x4905_E7FB,
            0x2A05_680A,
            0x4904_D1FC,
            0x600A_4A04,
            0xBF00_E7FE,
            0x0800_0034,
            0x4002_6444,
            0x4002_64B8,
            4 << 25 | 1 << 10 | 1 << 6 | 1,
        ];
        words.extend(
            [
                // The bus at half the processor's clock; clocks, pins, 1 Mbaud at 84 MHz.
                [0x4002_3808, 0b100 << 13],
                [0x4002_3830, 1 << 22 | 1],
                [0x4002_3844, 1 << 4],
                [0x4002_0024, 7 << 4 | 7 << 8],
                [0x4002_0000, 0xA800_0000 | 0b10 << 18 | 0b10 << 20],
                [0x4001_1008, 84],
                [0x4001_1014, 1 << 6 | 1 << 7],
                [0x4001_100C, 1 << 13 | 1 << 3 | 1 << 2],
                // Eight bytes round; three from there.
                [0x4002_64C0, 0x4001_1004],
                [0x4002_64C4, buffer],
                [0x4002_64BC, 3],
                [0x4002_6448, 0x4001_1004],
                [0x4002_644C, buffer],
                [0x4002_6444, 8],
                [0x4002_6440, 4 << 25 | 1 << 10 | 1 << 8 | 1],
                [0, 0],
            ]
            .as_flattened(),
        );
        Image::of_words(&words)
    }

    #[test]
    fn a_program_sends_back_what_it_receives() {
        let mut board = Board::new(&echo(0x2000_4000));
        board.run_for(2000).unwrap();
        let begin = board.bus().now;
        board.bus_mut().send(b"abc");
        board.run_for(2 * 1680).unwrap();
        assert_eq!(board.memory(0x2000_4000, 4), [b'a', b'b', 0, 0]);
        let midway = board.snapshot();
        let mut other = Board::new(&echo(0x2000_4000));
        other.restore(&midway);
        for mut board in [board, other] {
            // The last byte comes in, the program notices, and all go out again.
            let last = begin + 6 * 1680;
            board.run_for(last - board.bus().now).unwrap();
            assert_eq!(board.bus_mut().received(), b"ab");
            board.run_for(100).unwrap();
            assert_eq!(board.bus_mut().received(), b"c");
            assert_eq!(board.bus_mut().read(0x4002_6404), Ok(0b11 << 26));
            assert_eq!((board.dead(), board.bus().next_event()), (None, None));
        }
    }

    #[test]
    fn core_coupled_memory_gets_nothing() {
        let mut board = Board::new(&echo(0x1000_0000));
        board.run_for(2000).unwrap();
        board.bus_mut().send(b"abc");
        board.run_for(20_000).unwrap();
        assert_eq!(board.bus_mut().read(0x4002_6400), Ok(1 << 19));
        assert_eq!(board.memory(0x1000_0000, 3), [0; 3]);
    }
}
