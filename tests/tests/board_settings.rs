//! Settings over the link: kept in the flash of the release ELF on the virtual board, through resets and power cuts at
//! any of its operations, and taken by a drive that runs.
#![cfg(feature = "virtual-board")]

use arso_core::link::image::{HEADER, Header};
use arso_core::link::message::{Answer, Ask, Asked, BYTES, Piece, Source, TAG};
use arso_core::request::{Reason, Request};
use arso_core::{Mode, Place};
use arso_tests::drives::{belt, drive_with_loads};
use arso_tests::virtual_board::host::{Host, framed};
use arso_tests::virtual_board::image::Image;
use arso_tests::virtual_board::rig::Switches;
use arso_tests::virtual_board::{Rig, Stop};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile, Weights};
use host_sim::simulate::corridor::settings_image;

/// Control periods after which a drive that has been told all has begun anew.
const PARTED: usize = 750;

/// In which a drive that is enabled has settled.
const SETTLED: usize = 600;

/// A set for a drive.
fn set(drive: &Drive) -> Vec<u8> {
    settings_image(&Design::new(drive).unwrap()).unwrap()
}

/// The firmware of the default drive on the machine of another one.
fn on(drive: &Drive) -> Host {
    let image = Image::parse(&arso_tests::firmware()).unwrap();
    let mut rig = Rig::start(&image, drive, &PlantFile::from(drive), |_| ()).unwrap();
    rig.periods(20).unwrap();
    Host::of(rig)
}

/// The default drive with few planned moves, which are soon sent.
fn brief() -> Drive {
    let mut drive = Drive::default_drive();
    drive.motion.table = Some(8000);
    drive
}

/// With other weights, and so with another gain and the same planned moves.
fn stiffer(mut drive: Drive) -> Drive {
    drive.cost.weights = Weights::Given {
        position: vec![400.0; 4],
        velocity: vec![0.3; 4],
    };
    drive
}

/// A set without the rows of its plans.
fn without_rows(set: &[u8]) -> &[u8] {
    &set[..Header::of(set).unwrap().first_row()]
}

fn fingerprint(set: &[u8]) -> u32 {
    Header::of(set).unwrap().fingerprint
}

fn words(answer: Option<Answer<Vec<f32>>>) -> String {
    match answer {
        Some(Answer::Objection(words)) => words.to_string(),
        other => panic!("{other:?}"),
    }
}

/// Sends a set to a drive whose amplifier is off, up to where it has to be taken.
fn store(host: &mut Host, set: &[u8]) {
    assert_eq!(host.request(Request::Store), Ok(()));
    assert_eq!(host.status().mode, Mode::Storing);
    assert_eq!(host.put(set), None);
}

/// The same, and it begins anew with them.
fn keep(host: &mut Host, set: &[u8]) {
    let resets = host.rig.resets;
    store(host, set);
    assert_eq!(host.ask(Ask::Take), Answer::Taken);
    // Its answer was lost, and it is asked once more.
    assert_eq!(host.ask(Ask::Take), Answer::Taken);
    host.periods(PARTED);
    assert_eq!(host.rig.resets, resets + 1);
}

/// A drive of 5 A, with another encoder, amplifier and machine: the firmware of the default drive is told, and is that
/// drive from then on, after its reset and without power.
#[test]
fn another_drive_is_pushed_and_kept() {
    let drive = belt();
    let set = set(&drive);
    let mut host = on(&drive);
    assert_eq!(host.status().source, Source::CompiledIn);
    keep(&mut host, &set);
    let status = host.status();
    assert_eq!(status.source, Source::Kept(1));
    assert_eq!(status.fingerprint, fingerprint(&set));
    assert_eq!(status.current_limit, 5.0);
    host.enable();
    let zero = host.truth()[0];
    for target in [20_000, -5_000, 60_000] {
        assert_eq!(host.request(Request::Move(Place(target))), Ok(()));
        host.until(2000, |status| status.held == Some(Place(target)));
        host.periods(1000);
        let length = zero + target as f64 * drive.encoder.resolution;
        let truth = host.truth();
        assert!(
            truth.iter().all(|mass| (mass - length).abs() < 20e-6),
            "{truth:?} at {length}"
        );
    }
    // What it says of itself is what was sent, but for the number.
    let mut said = Vec::new();
    while let Answer::Settings(bytes) = host.ask(Ask::Settings(said.len() as u16)) {
        said.extend_from_slice(&bytes);
        if bytes.len() < BYTES {
            break;
        }
    }
    assert_eq!(Header::of(&said).unwrap().serial, 1);
    let end = HEADER + Header::of(&set).unwrap().settings as usize;
    assert_eq!(said[HEADER..], set[HEADER..end]);

    host.rig.power_cycle();
    host.periods(30);
    let status = host.status();
    assert_eq!((status.mode, status.source), (Mode::Idle, Source::Kept(1)));
    // The next set goes into the other slot, and is the newer one.
    let other = self::set(&brief());
    keep(&mut host, &other);
    let status = host.status();
    assert_eq!(status.source, Source::Kept(2));
    assert_eq!(status.fingerprint, fingerprint(&other));
    keep(&mut host, &other);
    assert_eq!(host.status().source, Source::Kept(3));
    // Put away, it has what its firmware has, and what comes then is the newest.
    keep(&mut host, &Header::of_nothing().bytes());
    let status = host.status();
    assert_eq!(status.source, Source::CompiledIn);
    assert_ne!(status.fingerprint, fingerprint(&other));
    keep(&mut host, &other);
    assert_eq!(host.status().source, Source::Kept(5));
}

/// What cannot be run is not kept, and the drive says why, in words; it begins anew as it was.
#[test]
fn what_cannot_be_run_is_refused_in_words() {
    let good = set(&brief());
    let wide = {
        let mut drive = brief();
        drive.encoder.counter_bits = 32;
        set(&drive)
    };
    let mut damaged = good.clone();
    *damaged.last_mut().unwrap() ^= 1;
    let two = set(&drive_with_loads(2));
    let mut host = Host::new();
    // Neither idle nor before the amplifier is off.
    assert!(words(host.put(&good)).contains("settings are taken after"));
    assert!(words(Some(host.ask(Ask::Take))).contains("settings are taken after"));
    for (set, expected) in [
        (
            without_rows(&wide),
            "counter_bits must be the width of the board's counter",
        ),
        (&damaged[..], "damaged"),
        (without_rows(&good), "damaged"),
        (without_rows(&two), "2 loads"),
    ] {
        store(&mut host, set);
        let said = words(Some(host.ask(Ask::Take)));
        assert!(said.contains(expected), "{said}");
        // Nothing but the reset ends it.
        for request in [Request::Stop, Request::Commission, Request::Start] {
            assert!(host.request(request).is_err());
        }
        host.periods(PARTED);
        let status = host.status();
        assert_eq!(
            (status.mode, status.source),
            (Mode::Idle, Source::CompiledIn)
        );
    }
    assert_eq!(host.request(Request::Store), Ok(()));
    assert_eq!(host.put(&good[..HEADER]), None);
    let piece = |at: u32| {
        let bytes = good[32..64].iter().copied().collect();
        Ask::Put(Piece { at, bytes })
    };
    assert!(words(Some(host.ask(piece(128 * 1024 - 31)))).contains("longer"));
    assert!(words(Some(host.ask(piece(u32::MAX)))).contains("longer"));
    // A piece before the header, and a host that falls silent.
    let resets = host.rig.resets;
    host.periods(5100);
    assert_eq!(host.rig.resets, resets + 1);
    assert_eq!(host.status().mode, Mode::Idle);
    assert_eq!(host.request(Request::Store), Ok(()));
    assert!(words(Some(host.ask(piece(32)))).contains("missing"));
}

/// A drive that runs takes other gains between two periods; what it begins with it takes with the amplifier off alone.
#[test]
fn a_running_drive_takes_other_gains() {
    let mut host = Host::running();
    assert_eq!(host.request(Request::Store), Err(Reason::Mode));
    let whole = set(&stiffer(Drive::default_drive()));
    let staged = without_rows(&whole);
    assert_eq!(host.put(staged), None);
    host.periods(SETTLED);
    let before = host.period().0.code;
    assert_eq!(host.ask(Ask::Take), Answer::Taken);
    assert_eq!(host.period().0.code, before);
    let status = host.status();
    assert_eq!(status.source, Source::Changed);
    assert_eq!(status.fingerprint, fingerprint(&whole));
    assert_eq!(host.request(Request::Move(Place(30_000))), Ok(()));
    host.until(2000, |status| status.held == Some(Place(30_000)));
    host.periods(300);
    assert!(host.truth().iter().all(|mass| (mass - 0.03).abs() < 50e-6));
    // Questions that take long, as many as fit on the line, cost it nothing but time.
    let questions: Vec<u8> = (0..40)
        .flat_map(|number| {
            let ask = Ask::Settings(0);
            framed(TAG, &Asked { number, ask })
        })
        .collect();
    host.send(&questions);
    host.periods(200);
    assert_eq!((host.rig.resets, host.status().mode), (0, Mode::Running));
    // Under way, and another drive.
    assert_eq!(host.put(staged), None);
    assert_eq!(host.request(Request::Move(Place(0))), Ok(()));
    let Answer::Refused(refusal) = host.ask(Ask::Take) else {
        panic!("it moves");
    };
    assert_eq!(refusal.reason, Reason::Moving);
    host.until(2000, |status| status.held == Some(Place(0)));
    let other = set(&belt());
    assert_eq!(host.put(without_rows(&other)), None);
    assert!(words(Some(host.ask(Ask::Take))).contains("need the amplifier off"));
    // It is kept nowhere.
    host.rig.power_cycle();
    host.periods(30);
    assert_eq!(host.status().source, Source::CompiledIn);
    assert_eq!(host.rig.board.bus().flash.operations(), 0);
}

/// The settings that a running drive had taken are not kept; those that are pushed next are the newest all the same. A
/// travel that was stated meanwhile is kept at once.
#[test]
fn what_is_kept_after_a_change_is_the_newest() {
    let mut host = Host::new();
    keep(&mut host, &set(&brief()));
    keep(&mut host, &set(&brief()));
    host.enable();
    let narrow = {
        let mut drive = stiffer(brief());
        drive.protection.travel = Some([-10.0, 0.02]);
        set(&drive)
    };
    host.periods(SETTLED);
    assert_eq!(host.put(without_rows(&narrow)), None);
    assert_eq!(host.ask(Ask::Take), Answer::Taken);
    assert_eq!(host.status().source, Source::Changed);
    assert_eq!(
        host.request(Request::Move(Place(30_000))),
        Err(Reason::Travel)
    );
    assert_eq!(host.request(Request::Move(Place(15_000))), Ok(()));
    host.until(2000, |status| status.held == Some(Place(15_000)));
    assert_eq!(host.request(Request::Stop), Ok(()));
    keep(&mut host, &narrow);
    let status = host.status();
    assert_eq!(
        (status.source, status.fingerprint),
        (Source::Kept(3), fingerprint(&narrow))
    );
}

/// A drive that has one set is sent another one, and the power is cut at flash operations all the way: it comes up with
/// the one or the other, whole, and takes the next.
///
/// * `every`: so manieth operation of the set and of its header, beside the first and the last of each
fn power_cuts(every: (u64, u64)) {
    let (old, new) = (set(&brief()), set(&stiffer(brief())));
    let mut host = Host::new();
    keep(&mut host, &old);
    let cut = |host: &mut Host, operation: u64, seed: u64| {
        host.rig.board.bus_mut().flash.cut_at(Some(operation), seed);
    };
    let comes_up = |host: &mut Host, at: u64| {
        host.rig.power_cycle();
        host.periods(30);
        let status = host.status();
        let (serial, expected) = match status.source {
            Source::Kept(1) => (1, &old),
            Source::Kept(2) => (2, &new),
            other => panic!("{other:?} after a cut at operation {at}"),
        };
        assert_eq!(status.fingerprint, fingerprint(expected));
        serial
    };
    let fresh = host.rig.snapshot();

    // The erasure.
    for seed in 0..3 {
        host.rig.restore(&fresh);
        cut(&mut host, 0, seed);
        let stopped = host.try_ask(Ask::Request(Request::Store), 5000);
        assert_eq!(stopped.unwrap_err(), Stop::PowerCut);
        assert_eq!(comes_up(&mut host, seed), 1);
    }
    // The set.
    host.rig.restore(&fresh);
    assert_eq!(host.request(Request::Store), Ok(()));
    let mut operations = 0;
    for piece in Piece::of(&new) {
        let before = host.rig.snapshot();
        let last = piece.at as usize + piece.bytes.len() == new.len();
        // The header waits in memory.
        let writes = if piece.at == 0 {
            0
        } else {
            piece.bytes.len() as u64
        };
        let chosen = (0..writes).filter(|write| {
            let operation = operations + write;
            operation.is_multiple_of(every.0) || (last && write + 1 == writes)
        });
        for write in chosen {
            host.rig.restore(&before);
            cut(&mut host, write, operations + write);
            let stopped = host.try_ask(Ask::Put(piece.clone()), 50);
            assert_eq!(stopped.unwrap_err(), Stop::PowerCut);
            assert_eq!(comes_up(&mut host, operations + write), 1);
        }
        operations += writes;
        host.rig.restore(&before);
        assert_eq!(host.ask(Ask::Put(piece)), Answer::Taken);
    }
    // The header, whose last byte makes it whole.
    let before = host.rig.snapshot();
    for write in (0..HEADER as u64).filter(|write| write.is_multiple_of(every.1) || *write == 31) {
        host.rig.restore(&before);
        cut(&mut host, write, write);
        let stopped = host.try_ask(Ask::Take, 50);
        assert_eq!(stopped.unwrap_err(), Stop::PowerCut);
        let serial = comes_up(&mut host, write);
        assert!(
            serial == 1 || write == 31,
            "operation {write} of the header"
        );
    }
    host.rig.restore(&before);
    assert_eq!(host.ask(Ask::Take), Answer::Taken);
    host.periods(PARTED);
    assert_eq!(comes_up(&mut host, 0), 2);
}

#[test]
fn a_power_cut_leaves_the_old_set_or_the_new() {
    power_cuts((3000, 8));
}

/// At every one: `cargo test -p arso-tests --features virtual-board --test all board_settings -- --ignored`.
#[test]
#[ignore = "takes minutes: the same as above at every operation"]
fn a_power_cut_at_any_operation_leaves_the_old_set_or_the_new() {
    power_cuts((1, 1));
}

/// The switches command a drive with settings of its own as they do any other.
#[test]
fn the_switches_know_its_encoder() {
    let drive = belt();
    let mut host = on(&drive);
    keep(&mut host, &set(&drive));
    let mut rig = host.rig;
    rig.commission().unwrap();
    rig.switches(Switches::run(1));
    rig.periods(2000).unwrap();
    let state = rig.plant().state();
    assert!((state[0] - 0.03).abs() < 100e-6, "{state}");
}
