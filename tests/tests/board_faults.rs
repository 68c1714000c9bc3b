//! The fault campaign, thinned, on the release ELF: no runaway, and the run switch always stops the drive.
#![cfg(feature = "virtual-board")]

use arso_tests::campaign::faults::FAULTS;
use arso_tests::campaign::flips::flips;
use arso_tests::campaign::outcome::Verdict;
use arso_tests::campaign::stage::Stage;
use arso_tests::campaign::summary::{Row, campaign};
use arso_tests::campaign::workers::processors;
use arso_tests::virtual_board::Rig;
use host_sim::drive::Drive;

fn stage(instants: u32) -> Stage {
    Stage::set(arso_tests::firmware(), Drive::default_drive(), instants).unwrap()
}

fn with(rows: &[Row], verdict: Verdict) -> Vec<&'static str> {
    let rows = rows.iter().filter(|row| row.verdict() == verdict);
    rows.map(|row| row.name).collect()
}

/// Every fault, once in motion and once at rest.
#[test]
fn no_fault_ends_in_a_runaway() {
    let rows = campaign(&stage(1), FAULTS, processors()).unwrap();
    for row in &rows {
        println!("{}: {} {:?}", row.name, row.verdict().name(), row.codes());
    }
    assert!(rows.len() >= 40);
    assert_eq!(with(&rows, Verdict::Runaway), [""; 0]);
    assert_eq!(with(&rows, Verdict::LeftEnergised), [""; 0]);
    assert_eq!(with(&rows, Verdict::Unstoppable), [""; 0]);
}

/// Fifty bits of memory, flipped one at a time: the run switch stops the drive.
#[test]
fn a_flipped_bit_leaves_the_drive_stoppable() {
    for flip in flips(&stage(2), 50, processors()).unwrap() {
        let verdict = flip.outcome.verdict;
        assert!(!verdict.is_danger(), "{:#x} bit {}", flip.address, flip.bit);
    }
}

/// Crystal and supply: the amplifier is off within the period, by the program itself and not by the watchdog,
/// with the converter at zero current.
#[test]
fn a_dying_clock_or_supply_switches_off() {
    let stage = stage(2);
    for name in ["crystal", "supply"] {
        for instant in 0..2 {
            let mut rig = stage.rig().unwrap();
            rig.restore(&stage.instants[instant].rig);
            rig.as_hardware = true;
            let before = rig.period().unwrap();
            assert!(before.enabled, "{name}");
            let bus = rig.board.bus_mut();
            if name == "crystal" {
                assert!(bus.fail_crystal());
            } else {
                bus.power.set_supply(2.6);
            }
            let after = rig.period().unwrap();
            assert_eq!((after.enabled, after.code), (false, Some(2048)), "{name}");
        }
    }
    // 3.3 V less ten per cent is no failure.
    let mut rig = stage.rig().unwrap();
    rig.restore(&stage.instants[0].rig);
    rig.board.bus_mut().power.set_supply(2.97);
    assert!(rig.periods(10).unwrap().iter().all(|period| period.enabled));
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
