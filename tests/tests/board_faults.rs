//! The fault campaign, thinned, on the release ELF: what holds today, and what does not yet.
#![cfg(feature = "virtual-board")]

use arso_tests::campaign::faults::FAULTS;
use arso_tests::campaign::flips::flips;
use arso_tests::campaign::outcome::Verdict;
use arso_tests::campaign::stage::Stage;
use arso_tests::campaign::summary::{Row, campaign};
use arso_tests::campaign::workers::processors;
use arso_tests::virtual_board::Rig;
use host_sim::drive::Drive;

/// Faults with which the drive runs away at the instants tried here. None of them may: this list is to
/// become empty, and a fault that no longer runs away must leave it.
const RUN_AWAY: &[&str] = &[
    "encoder stuck",
    "encoder phase A stuck high",
    "encoder phase A stuck low",
    "encoder phase B stuck high",
    "encoder phase B stuck low",
    "encoder unplugged",
    "encoder phases swapped",
    "amplifier's sign flipped",
    "amplifier dead",
    "amplifier stuck at its last current",
    "amplifier stuck at full current",
    "amplifier stuck at full negative current",
    "amplifier's current 1 A too high",
    "amplifier 20 ms late",
    "converter's register stuck",
    "converter's register bit 11 stuck low",
    "converter's output bit 11 stuck high",
    "converter's output bit 11 stuck low",
    "motor's leads reversed",
    "actuator pushed, half the motor's force, 50 ms",
    "actuator pushed, half the motor's force, for ever",
    "actuator pushed, 1.5 times the motor's force, 50 ms",
    "actuator pushed, 1.5 times the motor's force, for ever",
    "last load pushed, half the motor's force, 50 ms",
    "last load pushed, half the motor's force, for ever",
    "last load pushed, 1.5 times the motor's force, 50 ms",
    "last load pushed, 1.5 times the motor's force, for ever",
];

/// Faults with which the run switch does not stop the drive in time. To become empty as well.
const UNSTOPPABLE: &[&str] = &[
    "log host blocks, reads 2 bytes/ms",
    "log host blocks, reads 0.7 bytes/ms",
];

fn stage(instants: u32) -> Stage {
    Stage::set(arso_tests::firmware(), Drive::default_drive(), instants).unwrap()
}

fn with(rows: &[Row], verdict: Verdict) -> Vec<&'static str> {
    let rows = rows.iter().filter(|row| row.verdict() == verdict);
    rows.map(|row| row.name).collect()
}

/// Every fault, once in motion and once at rest.
#[test]
fn every_fault_ends_as_it_is_known_to_end() {
    let rows = campaign(&stage(1), FAULTS, processors()).unwrap();
    for row in &rows {
        println!("{}: {} {:?}", row.name, row.verdict().name(), row.codes());
    }
    assert!(rows.len() >= 40);
    assert_eq!(with(&rows, Verdict::Runaway), RUN_AWAY);
    assert_eq!(with(&rows, Verdict::LeftEnergised), [""; 0]);
    assert_eq!(with(&rows, Verdict::Unstoppable), UNSTOPPABLE);
}

/// Fifty bits of memory, flipped one at a time: the run switch stops the drive. (Two thousand of them find
/// some with which it does not, in gains and in the queue of requests.)
#[test]
fn a_flipped_bit_leaves_the_drive_stoppable() {
    for flip in flips(&stage(2), 50, processors()).unwrap() {
        let verdict = flip.outcome.verdict;
        assert!(!verdict.is_danger(), "{:#x} bit {}", flip.address, flip.bit);
    }
}

/// A rig that was put back into a state it had been in goes on as it went on then, and so does another one.
#[test]
fn a_restored_rig_goes_on_as_the_first_one() {
    let stage = stage(2);
    let mut first = stage.rig().unwrap();
    let mut other = stage.rig().unwrap();
    let goes_on = |rig: &mut Rig, instant: usize| {
        rig.restore(&stage.instants[instant].rig);
        let periods = rig.periods(100).unwrap();
        (periods, rig.log.clone(), rig.plant().state().clone())
    };
    for instant in 0..2 {
        let once = goes_on(&mut first, instant);
        assert_eq!(goes_on(&mut first, instant), once);
        assert_eq!(goes_on(&mut other, instant), once);
    }
    // The first instant goes on to the second.
    let (from, to) = (&stage.instants[0], &stage.instants[1]);
    first.restore(&from.rig);
    first.periods(to.period - from.period).unwrap();
    let there = first.periods(100).unwrap();
    first.restore(&to.rig);
    assert_eq!(first.periods(100).unwrap(), there);
}
