//! The processor's side of flash: what it writes there goes to the flash interface, and what the interface makes
//! of the memory is shown at both its addresses.

use super::{Board, Machine, Stop};
use crate::virtual_board::image::{FLASH, FLASH_SIZE};
use crate::virtual_board::peripheral::flash::array::Array;
use std::ops::Range;
use unicorn_engine::{HookType, Unicorn, uc_error};

/// Where it is seen: at its own address, and where the processor boots from.
pub(super) const MAPPED: [u32; 2] = [FLASH, 0];

/// Sends what is written to flash, which is mapped as read-only, to the interface. The processor stalls before the
/// next instruction, or behind the IT block. At the address of booting a write is a fault, though the part takes it:
/// it comes of a null pointer.
pub(super) fn hook_writes(uc: &mut Unicorn<'static, Machine>) -> Result<(), uc_error> {
    let (begin, end) = (FLASH.into(), u64::from(FLASH + FLASH_SIZE - 1));
    uc.add_mem_hook(
        HookType::MEM_WRITE_PROT,
        begin,
        end,
        move |uc, _, address, size, value| {
            let machine = uc.get_data_mut();
            let now = machine.bus.now;
            let offset = (address - begin) as usize;
            machine.bus.flash.program(offset, value as u32, size, now);
            machine.reschedule();
            // The emulator goes on, and writes nothing itself.
            true
        },
    )?;
    Ok(())
}

impl Board {
    /// What is in flash.
    #[must_use]
    pub fn flash(&self) -> Vec<u8> {
        self.bus().flash.array().content()
    }

    /// Puts something into flash, as a debugger would; not where the program is.
    ///
    /// * `offset`: from its beginning
    pub fn set_flash(&mut self, offset: usize, bytes: &[u8]) {
        let shown = self.bus().flash.array().clone();
        self.bus_mut().flash.store(offset, bytes);
        self.show_flash(&shown);
    }

    /// Ends the operation whose time is over.
    pub(super) fn end_flash_operation(&mut self) -> Result<(), Stop> {
        let bus = self.bus_mut();
        let now = bus.now;
        if let Some(place) = bus.flash.end(now) {
            self.show(place);
        }
        if self.bus().flash.dark() {
            return Err(Stop::PowerCut);
        }
        Ok(())
    }

    /// Shows the sectors that have changed.
    ///
    /// * `shown`: what was there to be seen
    pub(super) fn show_flash(&mut self, shown: &Array) {
        for place in self.bus().flash.array().differences(shown) {
            self.show(place);
        }
    }

    fn show(&mut self, place: Range<usize>) {
        let begin = place.start as u32;
        let bytes = self.bus().flash.array().bytes(place).to_vec();
        for base in MAPPED {
            self.set_memory(base + begin, &bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_board::image::Image;

    const INTERFACE: u32 = 0x4002_3C00;
    const UNLOCK: [[u32; 2]; 2] = [[INTERFACE + 4, 0x4567_0123], [INTERFACE + 4, 0xCDEF_89AB]];
    /// Words at once.
    const PROGRAM: [u32; 2] = [INTERFACE + 0x10, 0b10 << 8 | 1];
    /// The last sector, bytes at once.
    const ERASE: [u32; 2] = [INTERFACE + 0x10, 1 << 16 | 11 << 3 | 1 << 1];
    const LAST: u32 = FLASH + 0xE_0000;
    /// Written when all is done.
    const DONE: u32 = 0x2000_4000;
    const WATCHDOG: u32 = 0x4000_3000;
    /// It barks after 512 ms unless its prescaler is changed.
    const WATCHED: [[u32; 2]; 2] = [[WATCHDOG, 0xCCCC], [WATCHDOG, 0x5555]];

    fn board(parts: &[&[[u32; 2]]]) -> Board {
        Board::new(&Image::of_writes(
            &[parts.concat(), vec![[DONE, 1]]].concat(),
        ))
    }

    /// The processor runs at 16 MHz here.
    fn run(board: &mut Board, ms: u64) -> Result<(), Stop> {
        let end = board.bus().now + ms * 16_000;
        while board.bus().now < end {
            board.run_for(end - board.bus().now)?;
        }
        Ok(())
    }

    fn word(board: &Board, address: u32) -> u32 {
        u32::from_le_bytes(board.memory(address, 4).try_into().unwrap())
    }

    #[test]
    fn programming_clears_bits_only() {
        let words = [PROGRAM, [LAST, 0xFFFF_0FF0], [LAST, 0x1234_FFFF]];
        let mut board = board(&[&UNLOCK, &words]);
        // Twice 16 µs, in which nothing else is done.
        board.run_for(2 * 256).unwrap();
        assert_eq!((word(&board, LAST), word(&board, DONE)), (0xFFFF_0FF0, 0));
        board.run_for(200).unwrap();
        assert_eq!((word(&board, LAST), word(&board, DONE)), (0x1234_0FF0, 1));
        assert_eq!(word(&board, LAST - FLASH), 0x1234_0FF0);
        assert_eq!(board.flash()[0xE_0000..0xE_0004], [0xF0, 0x0F, 0x34, 0x12]);
        assert_eq!(board.bus().flash.operations(), 2);
        assert_eq!(board.memory(0x1FFF_7A22, 2), 1024_u16.to_le_bytes());
        assert_eq!(board.dead(), None);
    }

    /// `ldr r0, [pc, #8]; movs r1, #0x5A; strb r1, [r0, #1]; strb r1, [r0, #2]; strh r1, [r0, #4]; b .`
    #[test]
    fn bytes_are_programmed_one_by_one() {
        let code = [0x215A_4802, 0x7081_7041, 0xE7FE_8081, LAST];
        let words = [&[0x2000_2000, 0x0800_0009], &code[..]].concat();
        let mut board = Board::new(&Image::of_words(&words));
        for [address, value] in UNLOCK {
            board.bus_mut().write(address, value).unwrap();
        }
        board.bus_mut().write(INTERFACE + 0x10, 1).unwrap();
        run(&mut board, 1).unwrap();
        assert_eq!(word(&board, LAST), 0xFF5A_5AFF);
        // A halfword is refused.
        assert_eq!(word(&board, LAST + 4), u32::MAX);
        assert_eq!(board.bus_mut().read(INTERFACE + 0x0C), Ok(1 << 6));
        assert_eq!(board.bus().flash.operations(), 2);
    }

    #[test]
    fn locked_flash_stays_as_it_is() {
        let mut board = board(&[&[PROGRAM, [LAST, 0], ERASE]]);
        board.set_flash(0xE_0004, &[1]);
        run(&mut board, 1).unwrap();
        assert_eq!((word(&board, LAST), word(&board, DONE)), (u32::MAX, 1));
        assert_eq!(word(&board, LAST + 4), 0xFFFF_FF01);
        assert_eq!(board.bus_mut().read(INTERFACE + 0x0C), Ok(1 << 7));
    }

    /// The control timer's interrupt waits until the processor runs on.
    #[test]
    fn an_erase_takes_its_time_and_everything_else_goes_on() {
        let timer = [
            [0x4002_3840, 1],
            [0x4000_002C, 15_999],
            [0x4000_000C, 1],
            [0x4000_0000, 1],
            [0xE000_E100, 1 << 28],
            [DONE + 4, 1],
        ];
        let mut board = board(&[&UNLOCK, &timer, &[ERASE]]);
        board.set_flash(0xE_0000, &[0; 100]);
        run(&mut board, 1999).unwrap();
        let other = board.snapshot();
        for restored in [false, true] {
            if restored {
                board.restore(&other);
            }
            assert_eq!((word(&board, LAST), board.bus().nvic.active()), (0, 0));
            assert_eq!((word(&board, DONE + 4), board.bus().ticks), (1, 1998));
            run(&mut board, 2).unwrap();
            assert_eq!(
                (word(&board, LAST), board.bus().nvic.active()),
                (u32::MAX, 44)
            );
            assert_eq!(word(&board, LAST - FLASH), u32::MAX);
            assert_eq!(board.dead(), None);
        }
        // An operation longer than that does not look like a control that has died.
        let mut board = Board::new(&Image::of_writes(&[&UNLOCK[..], &[ERASE], &timer].concat()));
        board.run_to_tick().unwrap();
        assert!(board.bus().now > 2000 * 16_000);
    }

    #[test]
    fn the_watchdog_bites_in_an_erase_unless_it_is_lengthened() {
        let mut short = board(&[&WATCHED, &UNLOCK, &[ERASE]]);
        short.set_flash(0xE_0000, &vec![0; 0x2_0000]);
        assert_eq!(run(&mut short, 3000), Err(Stop::WatchdogReset));
        assert_eq!(short.bus().now / 16_000, 512);
        short.bus_mut().flash.cut_at(None, 5);
        short.reset();
        let left = short.flash();
        let old = |byte: &u8| *byte == 0;
        assert!(left[0xE_0000..].iter().any(old) && !left[0xE_0000..].iter().all(old));
        assert_eq!(short.memory(LAST, 0x2_0000), left[0xE_0000..]);
        assert!(!short.bus().watchdog.started());

        let mut long = board(&[
            &WATCHED,
            &[[WATCHDOG + 4, 6], [WATCHDOG, 0xAAAA]],
            &UNLOCK,
            &[ERASE],
        ]);
        run(&mut long, 3000).unwrap();
        assert_eq!(word(&long, DONE), 1);
    }

    #[test]
    fn the_next_start_sees_what_a_cut_has_left() {
        let operations = [ERASE, PROGRAM, [LAST, 0], [LAST + 4, 0], [LAST + 8, 0]];
        let mut board = board(&[&UNLOCK, &operations]);
        board.bus_mut().flash.cut_at(Some(2), 1);
        assert_eq!(run(&mut board, 3000), Err(Stop::PowerCut));
        // It stays off.
        assert_eq!(run(&mut board, 1), Err(Stop::PowerCut));
        let left = word(&board, LAST + 4);
        assert_eq!((word(&board, LAST), word(&board, LAST + 8)), (0, u32::MAX));
        assert!(left != 0 && left != u32::MAX, "{left:#x}");
        board.power_cycle();
        assert_eq!(word(&board, LAST + 4), left);
        // A part of the sector's erasure, on a board that has this in its flash.
        let mut image = Image::of_writes(&[&UNLOCK[..], &[ERASE]].concat());
        image.flash[0xE_0000..].copy_from_slice(&board.flash()[0xE_0000..]);
        let mut next = Board::new(&image);
        assert_eq!(word(&next, LAST + 4), left);
        next.bus_mut().flash.cut_at(Some(0), 1);
        assert_eq!(run(&mut next, 3000), Err(Stop::PowerCut));
        assert_eq!(next.bus().now / 16_000, 1000);
        let erased = |board: &Board| board.flash()[0xE_0000..].iter().all(|byte| *byte == 0xFF);
        assert!(!erased(&next));
        next.power_cycle();
        run(&mut next, 3000).unwrap();
        assert!(erased(&next));
    }
}
