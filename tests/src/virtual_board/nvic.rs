//! Nested vectored interrupt controller (Armv7-M ARM, B1.5 and B3.4): which exception is to be
//! taken next.
//!
//! Interrupt lines are levels: a line that is still high when its handler has returned makes the
//! interrupt pending again. Four priority bits, as on the STM32F4; no sub-priorities, which the
//! firmware does not use.

use super::peripheral::Unknown;

/// Exception number of a fault of the processor; its priority is fixed above all others but one.
pub const HARD_FAULT: u32 = 3;
/// Exception number of the interrupt that nothing masks.
pub const NON_MASKABLE: u32 = 2;
/// Exception number of interrupt 0.
pub const FIRST_INTERRUPT: u32 = 16;
/// Exception number of the system timer.
pub const SYSTICK: u32 = 15;

const INTERRUPTS: usize = 96;
const IMPLEMENTED_PRIORITY: u8 = 0xF0;

/// The controller.
#[derive(Clone, Debug)]
pub struct Nvic {
    enabled: [bool; INTERRUPTS],
    latched: [bool; INTERRUPTS],
    line: [bool; INTERRUPTS],
    priority: [u8; INTERRUPTS],
    /// Pending system timer, and the priorities of the system exceptions 4 to 15.
    systick_pending: bool,
    non_maskable_pending: bool,
    system_priority: [u8; 12],
    /// Active exceptions, innermost last.
    active: Vec<u32>,
}

impl Default for Nvic {
    fn default() -> Self {
        Self {
            enabled: [false; INTERRUPTS],
            latched: [false; INTERRUPTS],
            line: [false; INTERRUPTS],
            priority: [0; INTERRUPTS],
            systick_pending: false,
            non_maskable_pending: false,
            system_priority: [0; 12],
            active: Vec::new(),
        }
    }
}

impl Nvic {
    /// Level of an interrupt line.
    pub fn set_line(&mut self, interrupt: usize, high: bool) {
        self.line[interrupt] = high;
    }

    /// The system timer has reached zero.
    pub fn pend_systick(&mut self) {
        self.systick_pending = true;
    }

    /// The non-maskable interrupt is asked for.
    pub fn pend_non_maskable(&mut self) {
        self.non_maskable_pending = true;
    }

    /// The exception that runs, 0 in thread mode.
    #[must_use]
    pub fn active(&self) -> u32 {
        self.active.last().copied().unwrap_or(0)
    }

    fn priority_of(&self, exception: u32) -> i32 {
        if exception == NON_MASKABLE {
            -2
        } else if exception == HARD_FAULT {
            -1
        } else if exception >= FIRST_INTERRUPT {
            self.priority[(exception - FIRST_INTERRUPT) as usize].into()
        } else {
            self.system_priority[exception as usize - 4].into()
        }
    }

    fn is_pending(&self, interrupt: usize) -> bool {
        let exception = FIRST_INTERRUPT + interrupt as u32;
        self.enabled[interrupt]
            && (self.latched[interrupt] || self.line[interrupt])
            && !self.active.contains(&exception)
    }

    /// Whether anything is pending, masked or not; wakes a sleeping processor.
    #[must_use]
    pub fn any_pending(&self) -> bool {
        self.non_maskable_pending
            || self.systick_pending
            || (0..INTERRUPTS).any(|interrupt| self.is_pending(interrupt))
    }

    /// The exception to be taken now: the most urgent pending one, if it preempts what runs and
    /// neither mask holds it back.
    #[must_use]
    pub fn next(&self, primask: bool, basepri: u8) -> Option<u32> {
        if self.non_maskable_pending && !self.active.contains(&NON_MASKABLE) {
            return Some(NON_MASKABLE);
        }
        if primask {
            return None;
        }
        let interrupts = (0..INTERRUPTS)
            .filter(|interrupt| self.is_pending(*interrupt))
            .map(|interrupt| FIRST_INTERRUPT + interrupt as u32);
        let systick = self.systick_pending.then_some(SYSTICK);
        // The lower number wins among equals, and min_by_key keeps the first.
        let next = systick
            .into_iter()
            .chain(interrupts)
            .min_by_key(|e| self.priority_of(*e))?;
        let mut running = self
            .active
            .iter()
            .map(|e| self.priority_of(*e))
            .min()
            .unwrap_or(256);
        if basepri & IMPLEMENTED_PRIORITY != 0 {
            running = running.min((basepri & IMPLEMENTED_PRIORITY).into());
        }
        (self.priority_of(next) < running).then_some(next)
    }

    /// Takes an exception.
    pub fn enter(&mut self, exception: u32) {
        if exception == NON_MASKABLE {
            self.non_maskable_pending = false;
        } else if exception == SYSTICK {
            self.systick_pending = false;
        } else if exception >= FIRST_INTERRUPT {
            self.latched[(exception - FIRST_INTERRUPT) as usize] = false;
        }
        self.active.push(exception);
    }

    /// Returns from the innermost exception.
    pub fn leave(&mut self) {
        self.active.pop();
    }

    fn bits(flags: &[bool], word: usize) -> u32 {
        let flags = flags.iter().skip(32 * word).take(32).enumerate();
        flags.map(|(bit, set)| u32::from(*set) << bit).sum()
    }

    /// Reads a register; `offset` from 0xE000E100.
    ///
    /// # Errors
    /// No such register.
    pub fn read(&self, offset: u32) -> Result<u32, Unknown> {
        let word = (offset & 0x7F) as usize / 4;
        match offset {
            0x000..0x00C | 0x080..0x08C => Ok(Self::bits(&self.enabled, word)),
            0x100..0x10C | 0x180..0x18C => Ok(Self::bits(&self.latched, word)),
            0x300..0x360 => {
                let first = (offset - 0x300) as usize & !3;
                let bytes = [0, 1, 2, 3].map(|byte| self.priority[first + byte]);
                Ok(u32::from_le_bytes(bytes))
            }
            _ => Err(Unknown),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// No such register.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), Unknown> {
        let first = 32 * ((offset & 0x7F) as usize / 4);
        let (flags, set) = match offset {
            0x000..0x00C => (&mut self.enabled, true),
            0x080..0x08C => (&mut self.enabled, false),
            0x100..0x10C => (&mut self.latched, true),
            0x180..0x18C => (&mut self.latched, false),
            0x300..0x360 => {
                let first = (offset - 0x300) as usize & !3;
                for (byte, priority) in value.to_le_bytes().into_iter().enumerate() {
                    self.priority[first + byte] = priority & IMPLEMENTED_PRIORITY;
                }
                return Ok(());
            }
            _ => return Err(Unknown),
        };
        for bit in 0..32 {
            if value >> bit & 1 == 1 {
                flags[first + bit] = set;
            }
        }
        Ok(())
    }

    /// Priority registers of the system exceptions, SHPR1 to SHPR3, as word 0 to 2.
    #[must_use]
    pub fn system_priority(&self, word: usize) -> u32 {
        u32::from_le_bytes([0, 1, 2, 3].map(|byte| self.system_priority[4 * word + byte]))
    }

    /// See [`Nvic::system_priority`].
    pub fn set_system_priority(&mut self, word: usize, value: u32) {
        for (byte, priority) in value.to_le_bytes().into_iter().enumerate() {
            self.system_priority[4 * word + byte] = priority & IMPLEMENTED_PRIORITY;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urgency_masks_and_preemption() {
        let mut nvic = Nvic::default();
        nvic.write(0x000, 1 << 28 | 1 << 5).unwrap();
        // Priority of 28: 0x10, of 5: 0x80; the four low bits do not exist.
        nvic.write(0x300 + 28, 0x1F).unwrap();
        nvic.write(0x304, 0x8000).unwrap();
        assert_eq!(nvic.read(0x300 + 28), Ok(0x10));
        nvic.set_line(5, true);
        assert_eq!(nvic.next(false, 0), Some(21));
        nvic.enter(21);
        assert_eq!(nvic.next(false, 0), None);
        nvic.set_line(28, true);
        assert_eq!(nvic.next(true, 0), None);
        assert_eq!(nvic.next(false, 0x10), None);
        assert_eq!(nvic.next(false, 0x20), Some(44));
        nvic.enter(44);
        assert_eq!(nvic.active(), 44);
        nvic.set_line(28, false);
        nvic.leave();
        assert_eq!(nvic.active(), 21);
        nvic.leave();
        // The line is still high: again.
        assert_eq!(nvic.next(false, 0), Some(21));
        // Disabled: held back.
        nvic.write(0x080, 1 << 5).unwrap();
        assert_eq!(nvic.next(false, 0), None);
        // Set pending by software.
        nvic.write(0x000, 1 << 7).unwrap();
        nvic.write(0x100, 1 << 7).unwrap();
        assert_eq!(nvic.next(false, 0), Some(23));
        nvic.write(0x180, 1 << 7).unwrap();
        assert!(!nvic.any_pending());
        assert_eq!(nvic.read(0x400), Err(Unknown));
    }

    #[test]
    fn the_lower_number_wins_among_equals() {
        let mut nvic = Nvic::default();
        nvic.pend_systick();
        nvic.write(0x000, 1).unwrap();
        nvic.set_line(0, true);
        assert_eq!(nvic.next(false, 0), Some(SYSTICK));
        nvic.set_system_priority(2, 0x4000_0000);
        assert_eq!(nvic.next(false, 0), Some(FIRST_INTERRUPT));
    }
}
