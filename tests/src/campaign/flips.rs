//! Single bits of memory flipped in a running drive; then the run switch is opened.
//!
//! Any bit of the static data and of as much stack as was ever used, at any instant of the campaign. What the
//! drive makes of it is its own affair, as long as it does not run away and can be stopped.

use super::outcome::{Outcome, Verdict};
use super::run::{Watch, open_run_switch};
use super::stage::Stage;
use super::workers::share;
use crate::virtual_board::image::RAM;
use crate::virtual_board::{Rig, Stop};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Control periods from the flip until the run switch is opened.
const UNTIL_OPENED: u32 = 50;

/// A flipped bit and what came of it.
pub struct Flip {
    /// Address of the byte.
    pub address: u32,
    /// Which bit.
    pub bit: u32,
    /// Control period of the motion.
    pub period: u32,
    /// What came of it.
    pub outcome: Outcome,
}

/// Flips as many bits, one in each run; the same on any number of threads.
///
/// # Errors
/// Whatever stops the firmware before anything is broken.
pub fn flips(stage: &Stage, count: u32, threads: usize) -> Result<Vec<Flip>, Stop> {
    share(
        count as usize,
        threads,
        || stage.rig(),
        |number, rig| flip(number as u64, stage, rig),
    )
}

fn flip(seed: u64, stage: &Stage, rig: &mut Rig) -> Flip {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let instant = &stage.instants[random.random_range(0..stage.instants.len())];
    rig.restore(&instant.rig);
    rig.as_hardware = true;
    let (end, top) = rig.board.stack_range();
    let (used, _) = rig.board.stack_use();
    let data = end - RAM;
    let place = random.random_range(0..data + used);
    let address = if place < data {
        RAM + place
    } else {
        top - (place - data) - 1
    };
    let bit = random.random_range(0..8);
    let byte = rig.board.memory(address, 1)[0];
    rig.board.set_memory(address, &[byte ^ 1 << bit]);

    let mut watch = Watch::new(rig, stage);
    while watch.now < UNTIL_OPENED && !watch.ran_away {
        watch.period(rig, stage);
    }
    let mut outcome = watch.outcome(rig, stage);
    if outcome.verdict == Verdict::Astray {
        // Too early to say.
        outcome.verdict = Verdict::Tolerated;
    }
    if !watch.ran_away {
        open_run_switch(&mut watch, &mut outcome, rig, stage);
    }
    if watch.ran_away {
        outcome = watch.outcome(rig, stage);
    }
    Flip {
        address,
        bit,
        period: instant.period,
        outcome,
    }
}
