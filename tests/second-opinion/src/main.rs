//! A second opinion on the numerics: the control core with the firmware's gains, built for a
//! Cortex-M4F, under QEMU, over a recording.
//!
//! Reads `recording.bin` from the current directory of the emulator, eight bytes per control step:
//! request (u16: 0 none, 1 commission, 2 start, 3 step to 30 mm), encoder count (u16), applied
//! current (f32). Writes `commands.bin`, the bits of command, reaction force and the position and
//! velocity of every load (f32 each). All little-endian.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
compile_error!("this is built for the emulator: tests/build-firmware second-opinion");

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[allow(dead_code, reason = "it has no log that would name the kind of drive")]
#[path = "../../../firmware/src/gains.rs"]
mod gains;

#[cfg(target_os = "none")]
mod replay {
    use crate::gains::{GAINS, LOADS, PLANS};
    use arso_core::{Controller, Counts, Current, Measurement, Place, Request};
    use cortex_m_rt::entry;
    use cortex_m_semihosting::{debug, nr, syscall};

    /// Bytes of one step of the recording, and of one step of the answer.
    const STEP: usize = 8;
    const ANSWER: usize = 4 * (2 + 2 * LOADS);

    #[entry]
    fn main() -> ! {
        debug::exit(if replay().is_some() {
            debug::EXIT_SUCCESS
        } else {
            debug::EXIT_FAILURE
        });
        loop {
            cortex_m::asm::nop();
        }
    }

    /// Opens a file by its zero-terminated name.
    fn open(name: &[u8], mode: usize) -> Option<usize> {
        // SAFETY: a semihosting call with a pointer to a string that ends where its length says.
        let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, name.len() - 1) };
        (handle != usize::MAX).then_some(handle)
    }

    fn replay() -> Option<()> {
        let input = open(b"recording.bin\0", nr::open::R_BINARY)?;
        let output = open(b"commands.bin\0", nr::open::RW_TRUNC_BINARY)?;
        let mut controller = Controller::new(&GAINS, PLANS).ok()?;
        loop {
            let mut step = [0_u8; STEP];
            // SAFETY: the buffer is as long as said; returns the bytes that are left to read.
            let left = unsafe { syscall!(READ, input, step.as_mut_ptr(), STEP) };
            if left != 0 {
                return (left == STEP).then_some(());
            }
            let [r0, r1, c0, c1, i0, i1, i2, i3] = step;
            match u16::from_le_bytes([r0, r1]) {
                1 => controller.request(Request::Commission).ok()?,
                2 => controller.request(Request::Start).ok()?,
                3 => controller.request(Request::Step(Place(30_000))).ok()?,
                _ => {}
            }
            let command = controller.step(Measurement {
                count: Counts(u16::from_le_bytes([c0, c1]).into()),
                current: Current(f32::from_le_bytes([i0, i1, i2, i3])),
                home: false,
            });
            let record = controller.telemetry();
            let values = [command.current.0, record.reaction_force];
            let values = values
                .iter()
                .chain(&record.load_position)
                .chain(&record.load_velocity);
            let mut answer = [0_u8; ANSWER];
            for (bytes, value) in answer.chunks_exact_mut(4).zip(values) {
                bytes.copy_from_slice(&value.to_le_bytes());
            }
            // SAFETY: the buffer is as long as said.
            if unsafe { syscall!(WRITE, output, answer.as_ptr(), ANSWER) } != 0 {
                return None;
            }
        }
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
        debug::exit(debug::EXIT_FAILURE);
        loop {
            cortex_m::asm::nop();
        }
    }
}
