//! The ring against lists that keep everything.

extern crate std;

use super::*;
use proptest::prelude::*;
use std::string::ToString;
use std::vec::Vec;

const PERIOD: f32 = 0.01;
/// Periods of 10 ms, as the rules say.
const PERIODS_RESTED: usize = 5;
const PERIODS_STOOD: usize = 25;

fn drive() -> Identity<'static> {
    Identity {
        kind: "linear",
        loads: 3,
        sample_time: PERIOD,
        fingerprint: 0x1234_5678,
    }
}

fn scale(counter_bits: u32) -> Scale {
    Scale {
        counter_bits,
        step: Current(1e-3),
        tolerance: 10,
    }
}

/// What is given to the recorder in a period.
#[derive(Clone, Copy, Debug)]
struct Given {
    place: i64,
    steps: i16,
    course: Course,
}

/// A move as a list.
#[derive(Clone, Debug, Default, PartialEq)]
struct Move {
    period: u32,
    samples: Vec<(u32, f32)>,
    ended: bool,
    cut: bool,
}

/// Every move there was, by the rules as they are told, whole history at hand.
fn moves(given: &[Given], bits: u32, longest: usize) -> Vec<Move> {
    let mask = u64::MAX >> (64 - bits);
    let mut moves: Vec<Move> = Vec::new();
    // Since when the actuator has stood, and where; whether a move is followed, and kept.
    let (mut since, mut anchor) = (0, 0_i64);
    let (mut followed, mut kept) = (false, false);
    for (k, now) in given.iter().enumerate() {
        let before = k.checked_sub(1).map_or(Course::Free, |k| given[k].course);
        let begins = match (before, now.course) {
            (Course::Held(a), Course::Held(b)) => a != b,
            (before, course) => course == Course::Moved && before != Course::Moved,
        };
        let rested = k - since >= PERIODS_RESTED;
        let away = (now.place - anchor).unsigned_abs() > 10;
        if begins || away || now.course == Course::Moved {
            (since, anchor) = (k + 1, now.place);
        }
        let end = |moves: &mut Vec<Move>| {
            if let Some(last) = moves.last_mut() {
                last.ended = true;
            }
        };
        if begins && (!followed || rested) {
            end(&mut moves);
            moves.push(Move {
                period: k as u32 + 7,
                ..Move::default()
            });
            (followed, kept) = (true, true);
        }
        if kept && let Some(last) = moves.last_mut() {
            let step = k.checked_sub(1).map_or(0, |k| now.place - given[k].place);
            // Half of a counter of 16 bits is all of it.
            let runs_away = bits > 16 && !last.samples.is_empty() && i16::try_from(step).is_err();
            if last.samples.len() == longest || runs_away {
                (last.cut, last.ended, kept) = (true, true, false);
            } else {
                let count = (now.place as u64 & mask) as u32;
                last.samples.push((count, f32::from(now.steps) * 1e-3));
            }
        }
        let stood = k + 1 - since >= PERIODS_STOOD;
        if stood || followed && !kept && now.course == Course::Free {
            end(&mut moves);
            (followed, kept) = (false, false);
        }
    }
    moves
}

/// What a record holds, as lists.
fn held(record: Record<'_>) -> Vec<Move> {
    let stretches = record.stretches().map(|stretch| Move {
        period: stretch.period,
        samples: stretch
            .samples()
            .map(|sample| (sample.count.0, sample.applied.0))
            .collect(),
        ended: stretch.ended,
        cut: stretch.cut,
    });
    stretches.collect()
}

/// The words of the memory after all that.
fn record<const RING: usize>(given: &[Given], bits: u32) -> Vec<u32> {
    let memory = LastMoves::<RING>::new();
    let mut recorder = Recorder::new(&memory, &drive(), scale(bits));
    for (now, period) in given.iter().zip(7..) {
        let count = Counts((now.place as u64 & (u64::MAX >> (64 - bits))) as u32);
        let applied = Current(f32::from(now.steps) * 1e-3);
        recorder.step(period, count, applied, now.course);
    }
    memory.words().collect()
}

/// Periods in which the same is done with the machine, and it moves at one velocity.
fn stretches_of_time() -> impl Strategy<Value = Vec<Given>> {
    let course = prop_oneof![
        3 => Just(Course::Moved),
        3 => (0_i64..3).prop_map(|place| Course::Held(Place(place))),
        1 => Just(Course::Free),
    ];
    let velocity = prop_oneof![4 => Just(0_i64), 4 => -40_i64..40, 1 => -40_000_i64..40_000];
    let part = (course, velocity, 1_usize..40, any::<i16>());
    (any::<u32>(), prop::collection::vec(part, 0..40)).prop_map(|(start, parts)| {
        let mut place = i64::from(start);
        let mut given = Vec::new();
        for (course, velocity, periods, steps) in parts {
            for k in 0..periods {
                place += velocity;
                given.push(Given {
                    place,
                    steps: steps.wrapping_add(k as i16),
                    course,
                });
            }
        }
        given
    })
}

/// The newest of all moves that fit into the ring, each whole but for what is beyond half of the ring, and at the
/// least the last two.
fn agrees<const RING: usize>(given: &[Given], bits: u32) -> Result<(), TestCaseError> {
    let all = moves(given, bits, RING / 2 - BEFORE);
    let mut words = record::<RING>(given, bits);
    let found = held(Record::parse(&words).unwrap());
    let mut room = RING;
    let fits = all.iter().rev().take_while(|one| {
        let words = BEFORE + one.samples.len();
        let fits = words <= room;
        room = room.saturating_sub(words);
        fits
    });
    let fits = fits.count();
    prop_assert!(fits >= all.len().min(2));
    prop_assert_eq!(&found[..], &all[all.len() - fits..]);
    // The same in a copy, whatever follows.
    words.extend([1, 2, 3]);
    let copy = Record::parse(&words).unwrap();
    prop_assert_eq!(held(copy), found);
    prop_assert_eq!(copy.drive(), drive());
    let numbers: Vec<u32> = copy.stretches().map(|stretch| stretch.number).collect();
    let expected: Vec<u32> = (1..=all.len() as u32).skip(all.len() - fits).collect();
    prop_assert_eq!(numbers, expected);
    Ok(())
}

proptest! {
    #[test]
    fn the_newest_moves_are_kept_whole(given in stretches_of_time()) {
        agrees::<64>(&given, 16)?;
        agrees::<101>(&given, 24)?;
        agrees::<400>(&given, 32)?;
        agrees::<4096>(&given, 31)?;
    }

    /// Whatever is done to a ring of whatever size, and whatever a copy of it says.
    #[test]
    fn nothing_panics(
        given in stretches_of_time(),
        bits in 1_u32..=32,
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u32>()), 0..4),
        cut in 0_usize..120,
    ) {
        held(Record::parse(&record::<0>(&given, bits)).unwrap());
        held(Record::parse(&record::<7>(&given, bits)).unwrap());
        held(Record::parse(&record::<13>(&given, bits)).unwrap());
        let mut words = record::<64>(&given, bits);
        for (at, value) in hits {
            let at = at.index(words.len());
            words[at] = value;
        }
        words.truncate(cut);
        if let Ok(record) = Record::parse(&words) {
            held(record);
            prop_assert!(record.drive().kind.len() <= 8);
        }
    }
}

fn given(place: i64, course: Course, periods: usize) -> Vec<Given> {
    std::vec![Given { place, steps: 0, course }; periods]
}

/// A drive that works without a rest for longer than the ring has room keeps the beginning, and the move before.
#[test]
fn a_long_move_keeps_its_beginning_and_the_move_before() {
    let home = Course::Held(Place(0));
    let mut all = given(0, home, 30);
    all.extend(given(5, Course::Moved, 10));
    all.extend(given(5, home, 30));
    all.extend((0..1000).map(|k| Given {
        place: 5 + 3 * k,
        steps: k as i16,
        course: Course::Moved,
    }));
    let words = record::<128>(&all, 16);
    let moves = held(Record::parse(&words).unwrap());
    let extent = moves
        .iter()
        .map(|one| (one.period, one.samples.len(), one.cut));
    assert_eq!(
        extent.collect::<Vec<_>>(),
        [(37, 35, false), (77, 60, true)]
    );
    assert_eq!(moves[1].samples[59], (5 + 3 * 59, 59.0 * 1e-3));
}

/// Neither standing nor being pushed about nor a start is a move.
#[test]
fn nothing_is_recorded_without_a_command() {
    let mut all = given(0, Course::Free, 100);
    all.extend((0..100).map(|k| Given {
        place: 50 * k,
        steps: 3,
        course: Course::Free,
    }));
    all.extend(given(77, Course::Held(Place(77)), 100));
    all.extend((0..100).map(|k| Given {
        place: 77 - 50 * k,
        steps: 3,
        course: Course::Held(Place(77)),
    }));
    assert_eq!(held(Record::parse(&record::<128>(&all, 16)).unwrap()), []);
}

#[test]
fn currents_are_the_steps_they_were() {
    let memory = LastMoves::<64>::new();
    let mut recorder = Recorder::new(&memory, &drive(), scale(16));
    let currents = [2.047_f32, -2.048, 0.0004, -0.0006, f32::NAN, 1e9, -1e9];
    for (current, period) in currents.iter().zip(1..) {
        recorder.step(period, Counts(0), Current(*current), Course::Moved);
    }
    let steps = [2047, -2048, 0, -1, 0, 32_767, -32_768].map(|steps: i16| f32::from(steps) * 1e-3);
    let words: Vec<u32> = memory.words().collect();
    let record = Record::parse(&words).unwrap();
    let stretch = record.stretches().next().unwrap();
    let found: Vec<f32> = stretch.samples().map(|sample| sample.applied.0).collect();
    assert_eq!(found, steps);
    assert_eq!((stretch.len(), stretch.ended), (7, false));
}

#[test]
fn what_is_no_record_is_told_apart() {
    let nothing: Vec<u32> = LastMoves::<64>::new().words().collect();
    assert_eq!(Record::parse(&nothing).err(), Some(Unreadable::Magic));
    let good = record::<64>(&given(0, Course::Moved, 3), 16);
    let with = |place: usize, word: u32| {
        let mut words = good.clone();
        words[place] = word;
        Record::parse(&words).err()
    };
    assert_eq!(with(0, 0), Some(Unreadable::Magic));
    assert_eq!(with(4, 2), Some(Unreadable::Version(2)));
    assert_eq!(with(5, 65), Some(Unreadable::Short(80)));
    assert_eq!(Record::parse(&good[..9]).err(), Some(Unreadable::Short(15)));
    for (place, word) in [
        (6, f32::NAN.to_bits()),
        (7, 0),
        (8, 33),
        (9, 256),
        (13, 64),
        (14, 99),
    ] {
        assert_eq!(with(place, word), Some(Unreadable::Inconsistent), "{place}");
    }
    let sentence = Unreadable::Short(80).to_string();
    assert_eq!(
        sentence,
        "a record of moves that is cut off: it has 320 bytes"
    );
}
