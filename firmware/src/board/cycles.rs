//! The cycle counter of the processor (DWT), which times the control step.

use cortex_m::peripheral::{DCB, DWT};

/// The running counter; wraps every 25 s.
pub(crate) struct Cycles(());

impl Cycles {
    pub(super) fn new(mut dcb: DCB, mut dwt: DWT) -> Self {
        dcb.enable_trace();
        dwt.enable_cycle_counter();
        Self(())
    }

    /// Cycles now.
    #[expect(clippy::unused_self, reason = "shows that the counter runs")]
    pub(crate) fn now(&self) -> u32 {
        DWT::cycle_count()
    }

    /// Cycles since an earlier moment.
    pub(crate) fn since(&self, start: u32) -> u32 {
        self.now().wrapping_sub(start)
    }
}
