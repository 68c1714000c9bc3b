//! The last moves that the release ELF keeps in its memory, read as a debugger does: the same as the log's.
#![cfg(feature = "virtual-board")]

use arso_core::Mode;
use arso_tests::virtual_board::Rig;
use arso_tests::virtual_board::image::{Image, RAM, RAM_SIZE};
use host_sim::capture::{Capture, LastMoves, Origin, RecordedMove, read_defmt, read_memory};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::identify::{Columns, Log};
use host_sim::report::record::csv;
use host_sim::simulate::scenario::Scenario;

/// Of a move, 2 s but for what else half of the ring holds.
const LONGEST: usize = 2036;

fn recorded(rig: &Rig) -> LastMoves {
    let ram = rig.board.memory(RAM, RAM_SIZE as usize);
    read_memory(&ram, "ram").unwrap()
}

fn logged(rig: &Rig) -> Capture {
    let capture = read_defmt(&arso_tests::firmware(), "firmware", &rig.log[..], |_| ()).unwrap();
    assert_eq!((capture.lost, capture.malformed), (0, 0));
    capture
}

/// Row by row what the log has of these periods; where they begin in the log.
fn agrees(recorded: &RecordedMove, log: &Capture) -> usize {
    let first = log.records.iter().position(|r| r.period == recorded.period);
    let first = first.unwrap();
    let records = &log.records[first..];
    assert!(records.len() >= recorded.samples.len());
    for (sample, record) in recorded.samples.iter().zip(records) {
        assert_eq!(sample.count.0, record.count, "period {}", record.period);
        assert_eq!(
            sample.applied.0, record.applied_current,
            "period {}",
            record.period
        );
    }
    first
}

/// Counts between the lowest and the highest, of a counter of 16 bits.
fn span(counts: impl Iterator<Item = u32>) -> i32 {
    let mut counts = counts.peekable();
    let first = *counts.peek().unwrap();
    let off = counts.map(|count| i32::from(count.wrapping_sub(first) as u16 as i16));
    let (low, high) = off.fold((0, 0), |(low, high), off| (low.min(off), high.max(off)));
    high - low
}

#[test]
fn the_last_moves_are_those_of_the_log() {
    let drive = Drive::default_drive();
    let plant = PlantFile::from(&drive);
    let image = Image::parse(&arso_tests::firmware()).unwrap();
    let mut rig = Rig::start(&image, &drive, &plant, |_| {}).unwrap();
    // It is there from the start, and nothing in it.
    rig.periods(5).unwrap();
    let origin = Origin::of(&Design::new(&drive).unwrap()).unwrap();
    let empty = LastMoves {
        origin,
        moves: Vec::new(),
    };
    assert_eq!(recorded(&rig), empty);

    rig.commission().unwrap();
    let before = recorded(&rig).moves.len();
    for name in ["fig3", "move"] {
        rig.experiment(Scenario::named(name).unwrap(), &plant, 1200)
            .unwrap();
    }
    // Found by its name too, and by itself.
    let address = image.symbol_with("last_moves").unwrap();
    let alone = rig.board.memory(address, 16_384);
    let found = recorded(&rig);
    assert_eq!(read_memory(&alone, "alone").unwrap(), found);

    let log = logged(&rig);
    let numbers: Vec<u32> = found.moves.iter().map(|one| one.number).collect();
    assert_eq!(numbers, (1..=before as u32 + 2).collect::<Vec<_>>());
    for one in &found.moves {
        let first = agrees(one, &log);
        // From rest as the drive sees it, until it has stood for 250 ms.
        let rest = log.records[first - 50..=first].iter();
        assert!(span(rest.map(|record| record.count)) <= 50);
        assert!(one.ended && !one.cut && one.samples.len() > 250);
        let tail = one.samples[one.samples.len() - 250..].iter();
        assert!(span(tail.map(|sample| sample.count.0)) <= 100);
    }
    // In the very period in which the target is seen, held where it began.
    let step = agrees(&found.moves[before], &log);
    assert!(log.records[step].command.abs() > 0.5 && log.records[step - 1].command.abs() < 0.1);
    let planned = agrees(&found.moves[before + 1], &log);
    assert!(log.records[planned].command.abs() > 0.5);
    assert_eq!(
        log.records[planned].reference,
        log.records[planned - 1].reference
    );
    assert_ne!(
        log.records[planned + 1].reference,
        log.records[planned].reference
    );

    // What `identify` reads, and of which drive it is.
    let rows = csv(&found.moves[before + 1], &found.origin).unwrap();
    let read = Log::parse(&rows[..], "record.csv", &drive, &Columns::default()).unwrap();
    assert!(read.at_rest);
    assert_eq!(read.drive, Some(origin.mark()));

    // An excitation is longer than is kept: its beginning, and the move before it.
    rig.excite().unwrap();
    let found = recorded(&rig);
    let log = logged(&rig);
    let [.., planned, excited] = &found.moves[..] else {
        panic!("{} moves", found.moves.len());
    };
    assert_eq!(
        (planned.number, excited.number),
        (before as u32 + 2, before as u32 + 3)
    );
    agrees(planned, &log);
    let first = agrees(excited, &log);
    assert_eq!(log.records[first].mode, Mode::Exciting);
    assert_ne!(log.records[first].command, 0.0);
    assert_eq!(log.records[first - 1].command, 0.0);
    assert!(excited.ended && excited.cut && excited.samples.len() == LONGEST);
}
