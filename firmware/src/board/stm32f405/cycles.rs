//! The cycle counter of the processor (DWT), which times the control step.

use arso_firmware::board::CycleCounter;
use cortex_m::peripheral::{DCB, DWT};

/// The running counter; wraps every 25 s.
pub(crate) struct Cycles(());

impl Cycles {
    pub(super) fn new(mut dcb: DCB, mut dwt: DWT) -> Self {
        dcb.enable_trace();
        dwt.enable_cycle_counter();
        Self(())
    }
}

impl CycleCounter for Cycles {
    const HZ: u32 = super::CLOCK_HZ;

    fn now(&self) -> u32 {
        DWT::cycle_count()
    }
}
