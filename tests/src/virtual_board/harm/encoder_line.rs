//! The encoder and its cable: from where the actuator is to the levels of two phases.

use crate::virtual_board::peripheral::encoder_timer::Phases;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// What the encoder, or its cable, makes of the motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EncoderFault {
    /// What it should.
    #[default]
    None,
    /// Neither phase changes any more.
    Stuck,
    /// Phase A does not change.
    PhaseA(bool),
    /// Phase B does not change.
    PhaseB(bool),
    /// Both phases are pulled up.
    Unplugged,
    /// A is B and B is A.
    Swapped,
    /// Each count is lost with this probability.
    Lost(f64),
    /// Each count is counted twice.
    Doubled,
    /// Each period as many counts off, at most.
    Noise(i64),
}

/// An encoder that may be broken.
#[derive(Clone, Debug)]
pub struct EncoderLine {
    fault: EncoderFault,
    random: ChaCha8Rng,
    /// Where the actuator was, and what the encoder made of it, counts.
    actual: i64,
    shown: i64,
}

impl Default for EncoderLine {
    fn default() -> Self {
        Self {
            fault: EncoderFault::None,
            random: ChaCha8Rng::seed_from_u64(0),
            actual: 0,
            shown: 0,
        }
    }
}

impl EncoderLine {
    /// Breaks it.
    pub fn fail(&mut self, fault: EncoderFault, seed: u64) {
        self.fault = fault;
        self.random = ChaCha8Rng::seed_from_u64(seed);
    }

    /// Where the encoder says it is when the actuator is somewhere, counts.
    pub fn step(&mut self, actual: i64) -> i64 {
        let moved = actual - std::mem::replace(&mut self.actual, actual);
        self.shown += match self.fault {
            EncoderFault::Lost(probability) => {
                let random = &mut self.random;
                let kept = (0..moved.abs()).filter(|_| !random.random_bool(probability));
                kept.count() as i64 * moved.signum()
            }
            EncoderFault::Doubled => 2 * moved,
            _ => moved,
        };
        match self.fault {
            EncoderFault::Noise(counts) => self.shown + self.random.random_range(-counts..=counts),
            _ => self.shown,
        }
    }

    /// The levels that reach the decoder when the encoder says it is somewhere; none while nothing
    /// changes.
    #[must_use]
    pub fn phases(&self, shown: i64) -> Option<Phases> {
        let Phases { a, b } = Phases::at(shown);
        match self.fault {
            EncoderFault::Stuck => None,
            EncoderFault::PhaseA(a) => Some(Phases { a, b }),
            EncoderFault::PhaseB(b) => Some(Phases { a, b }),
            EncoderFault::Unplugged => Some(Phases { a: true, b: true }),
            EncoderFault::Swapped => Some(Phases { a: b, b: a }),
            _ => Some(Phases { a, b }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown_after(fault: EncoderFault, actual: i64) -> i64 {
        let mut line = EncoderLine::default();
        line.fail(fault, 1);
        line.step(actual)
    }

    #[test]
    fn counts_are_lost_doubled_and_disturbed() {
        assert_eq!(shown_after(EncoderFault::None, -10_000), -10_000);
        assert_eq!(shown_after(EncoderFault::Doubled, -10_000), -20_000);
        let lost = shown_after(EncoderFault::Lost(0.1), -10_000);
        assert!((lost + 9_000).abs() < 100, "{lost}");
        let noisy = shown_after(EncoderFault::Noise(20), 10_000);
        assert!((noisy - 10_000).abs() <= 20, "{noisy}");
    }
}
