//! Cycles per instruction, estimated from the tables of the Cortex-M4 technical reference manual
//! (sections 3.3 and 7.2.3), without flash wait states (the accelerator of the STM32F4 hides most
//! of them).
//!
//! An estimate, not a measurement: data processing 1; single load 2, 1 right after another load or
//! store; store 1; LDM, STM, PUSH, POP, VLDM, VSTM 1 + N; multiply 1 or 2, divide 12 at most;
//! VADD, VSUB, VMUL 1, VMLA and VFMA 3, VDIV and VSQRT 14; taken branch 1 + 2 to refill; exception
//! entry and exit 12 each, and 17 more for the floating-point frame.

/// Refill of the pipeline after a taken branch.
pub const REFILL: u64 = 2;
/// Entry into an exception, with the floating-point frame.
pub const ENTRY: u64 = 12 + 17;
/// Return from an exception, with the floating-point frame.
pub const EXIT: u64 = 12 + 17;

/// What an instruction is, as far as time and interrupts are concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// Cycles, branches as if not taken.
    pub cycles: u8,
    /// Length in bytes.
    pub length: u8,
    /// Single load or store: one cycle less after another one.
    pub memory: bool,
    /// Number of instructions that follow in an IT block.
    pub it_block: u8,
    /// Waits for an interrupt.
    pub wfi: bool,
}

/// Decodes the Thumb instruction that starts with these halfwords.
#[must_use]
pub fn decode(first: u16, second: u16) -> Instruction {
    let wide = first >> 11 >= 0b11101;
    let (cycles, memory) = if wide {
        wide_cycles(first, second)
    } else {
        narrow_cycles(first)
    };
    let it = !wide && first >> 8 == 0xBF && first & 0xF != 0;
    Instruction {
        cycles,
        length: if wide { 4 } else { 2 },
        memory,
        // The lowest set bit of the mask ends the block.
        it_block: if it {
            4 - (first & 0xF).trailing_zeros() as u8
        } else {
            0
        },
        wfi: first == 0xBF30,
    }
}

fn narrow_cycles(code: u16) -> (u8, bool) {
    let registers = (code & 0xFF).count_ones() as u8;
    match code >> 11 {
        // Load literal, and loads of the register-offset and immediate forms.
        0b01001 | 0b01101 | 0b01111 | 0b10001 | 0b10011 => (2, true),
        // Stores of the same forms.
        0b01100 | 0b01110 | 0b10000 | 0b10010 => (1, true),
        0b01010 | 0b01011 => {
            // Register offset: 000 to 010 store, the others load.
            let store = (code >> 9) & 0b111 < 0b011;
            (if store { 1 } else { 2 }, true)
        }
        0b11000 | 0b11001 => (1 + registers, false),
        0b10110 | 0b10111 if matches!(code & 0xFE00, 0xB400 | 0xBC00) => {
            (1 + registers + u8::from(code & 0x100 != 0), false)
        }
        _ => (1, false),
    }
}

fn wide_cycles(first: u16, second: u16) -> (u8, bool) {
    let registers = second.count_ones() as u8;
    let load = first & 0x10 != 0;
    match first >> 9 & 0b111_1111 {
        // Load and store multiple; double, exclusive and table branch.
        0b111_0100 if first & 0x40 == 0 => (1 + registers, false),
        0b111_0100 => {
            let exclusive_or_table = first & 0x120 == 0;
            (if exclusive_or_table { 2 } else { 3 }, false)
        }
        // Single load and store.
        0b111_1100 => (if load { 2 } else { 1 }, true),
        // Multiply, multiply-accumulate, long multiply, divide.
        0b111_1101 => match first & 0xFFF0 {
            0xFB90 | 0xFBB0 => (12, false),
            0xFB00 if second >> 12 != 0xF => (2, false),
            _ => (1, false),
        },
        // Coprocessor: floating point.
        0b111_0110 => {
            let words = (second & 0xFF) as u8;
            let single = first & 0x0F20 == 0x0D00;
            if single {
                (2, true)
            } else if first & 0x0FE0 == 0x0C40 {
                // Two core registers.
                (2, false)
            } else {
                (1u8.saturating_add(words), false)
            }
        }
        0b111_0111 if second & 0x10 == 0 => (floating_point(first, second), false),
        0b111_1000..=0b111_1011 if second & 0x8000 != 0 && first & 0xFFE0 == 0xF3E0 => (2, false),
        _ => (1, false),
    }
}

fn floating_point(first: u16, second: u16) -> u8 {
    // Opcode bits 23, 21, 20; bit 22 belongs to the register.
    match (first >> 4 & 0b1000) | (first >> 4 & 0b11) {
        0b0000 | 0b0001 | 0b1001 | 0b1010 => 3,
        0b1000 => 14,
        0b1011 if first & 0xF == 1 && second & 0xC0 == 0xC0 => 14,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodings from the architecture manual, assembled by hand.
    #[test]
    fn cycles_of_known_encodings() {
        for (code, cycles, memory) in [
            (0x0000_4408_u32, 1, false), // add r0, r1
            (0x0000_6808, 2, true),      // ldr r0, [r1]
            (0x0000_6008, 1, true),      // str r0, [r1]
            (0x0000_4801, 2, true),      // ldr r0, [pc, #4]
            (0x0000_B5F0, 6, false),     // push {r4-r7, lr}
            (0x0000_BDF0, 6, false),     // pop {r4-r7, pc}
            (0x0000_CA03, 3, false),     // ldm r2!, {r0, r1}
            (0xE92D_4FF0, 10, false),    // push.w {r4-r11, lr}
            (0xE9D1_0100, 3, false),     // ldrd r0, r1, [r1]
            (0xF8D1_0080, 2, true),      // ldr.w r0, [r1, #128]
            (0xF8C1_0080, 1, true),      // str.w r0, [r1, #128]
            (0xFB00_F001, 1, false),     // mul r0, r0, r1
            (0xFB00_1002, 2, false),     // mla r0, r0, r2, r1
            (0xFB90_F0F1, 12, false),    // sdiv r0, r0, r1
            (0xED90_0A00, 2, true),      // vldr s0, [r0]
            (0xEC90_0A04, 5, false),     // vldm r0, {s0-s3}
            (0xEE30_0A20, 1, false),     // vadd.f32 s0, s0, s1
            (0xEE20_0A20, 1, false),     // vmul.f32 s0, s0, s1
            (0xEE00_0A20, 3, false),     // vmla.f32 s0, s0, s1
            (0xEEA0_0A20, 3, false),     // vfma.f32 s0, s0, s1
            (0xEE80_0A20, 14, false),    // vdiv.f32 s0, s0, s1
            (0xEEB1_0AC0, 14, false),    // vsqrt.f32 s0, s0
            (0xEEB0_0A60, 1, false),     // vmov.f32 s0, s1
            (0xEE00_0A10, 1, false),     // vmov s0, r0
        ] {
            let wide = code > 0xFFFF;
            let (first, second) = if wide {
                ((code >> 16) as u16, code as u16)
            } else {
                (code as u16, 0)
            };
            let found = decode(first, second);
            assert_eq!((found.cycles, found.memory), (cycles, memory), "{code:#x}");
            assert_eq!(found.length, if wide { 4 } else { 2 });
        }
        assert_eq!(decode(0xBF08, 0).it_block, 1); // it eq
        assert_eq!(decode(0xBF04, 0).it_block, 2); // itt eq
        assert_eq!(decode(0xBF01, 0).it_block, 4); // itttt eq
        assert_eq!(decode(0xBF00, 0).it_block, 0); // nop
        assert!(decode(0xBF30, 0).wfi);
    }
}
