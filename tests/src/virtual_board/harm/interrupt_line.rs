//! The line from the control timer to the interrupt controller.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// What becomes of the control interrupt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InterruptFault {
    /// It comes in time.
    #[default]
    None,
    /// Each of this many is lost.
    Lost {
        /// One of how many.
        one_of: u32,
    },
    /// Half of them, at random, come half a period late.
    Late,
}

/// What becomes of one interrupt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// In time.
    InTime,
    /// Never.
    Never,
    /// Half a period late.
    Late,
}

/// A line that may be broken.
#[derive(Clone, Debug)]
pub struct InterruptLine {
    fault: InterruptFault,
    random: ChaCha8Rng,
    periods: u32,
}

impl Default for InterruptLine {
    fn default() -> Self {
        Self {
            fault: InterruptFault::None,
            random: ChaCha8Rng::seed_from_u64(0),
            periods: 0,
        }
    }
}

impl InterruptLine {
    /// Breaks it.
    pub fn fail(&mut self, fault: InterruptFault, seed: u64) {
        self.fault = fault;
        self.random = ChaCha8Rng::seed_from_u64(seed);
        self.periods = 0;
    }

    /// What becomes of the interrupt of this period.
    pub fn step(&mut self) -> Arrival {
        self.periods += 1;
        match self.fault {
            InterruptFault::Lost { one_of } if self.periods.is_multiple_of(one_of) => {
                Arrival::Never
            }
            InterruptFault::Late if self.random.random_bool(0.5) => Arrival::Late,
            _ => Arrival::InTime,
        }
    }
}
