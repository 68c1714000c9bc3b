//! The log of the release ELF: complete, decodable, and harmless when damaged.
#![cfg(feature = "virtual-board")]

use arso_core::Mode;
use arso_tests::virtual_board::Rig;
use arso_tests::virtual_board::image::Image;
use arso_tests::virtual_board::rig::Period;
use host_sim::capture::{Capture, Origin, read_defmt};
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::error::Result;
use host_sim::report::log;
use host_sim::simulate::scenario::Scenario;
use host_sim::simulate::{Law, simulate};

/// A whole experiment: log, and what the board did in each of its periods.
fn experiment() -> (Vec<u8>, Vec<Period>, u64) {
    let drive = Drive::default_drive();
    let plant = PlantFile::from(&drive);
    let image = Image::parse(&arso_tests::firmware()).unwrap();
    let mut rig = Rig::start(&image, &drive, &plant, |_| {}).unwrap();
    rig.commission().unwrap();
    let periods = rig
        .experiment(Scenario::named("fig3").unwrap(), &plant, 1200)
        .unwrap();
    let runs = rig.board.interrupt_cost().runs;
    (rig.log, periods, runs)
}

fn decode(log: &[u8]) -> Result<Capture> {
    read_defmt(&arso_tests::firmware(), "firmware", log, |_| ())
}

#[test]
fn every_control_step_is_in_the_log() {
    let (log, periods, runs) = experiment();
    let capture = decode(&log).unwrap();
    assert_eq!((capture.lost, capture.malformed), (0, 0));
    assert_eq!(capture.records.len() as u64, runs);
    // The drive says which it is, and its fingerprint is that of the design.
    let design = Design::new(&Drive::default_drive()).unwrap();
    assert_eq!(capture.origins, [Origin::of(&design).unwrap()]);
    assert!(
        capture
            .messages
            .iter()
            .any(|message| message == "INFO commissioning")
    );
    assert!(
        capture
            .messages
            .iter()
            .any(|message| message.starts_with("INFO drive ready: linear, 3 loads"))
    );

    // The experiment's first period is the one after the last start.
    let last = capture
        .records
        .iter()
        .rposition(|record| record.mode == Mode::Ready);
    let end = capture.records[..last.unwrap()]
        .iter()
        .rposition(|r| r.mode == Mode::Running)
        .unwrap();
    let begin = capture.records[..end]
        .iter()
        .rposition(|r| r.mode == Mode::Ready)
        .unwrap()
        + 2;
    // Zero is known from the zero switch on, not before.
    assert!(!capture.records[0].position_set && capture.records[begin].position_set);
    for (record, period) in capture.records[begin..].iter().zip(&periods) {
        assert_eq!(record.count, period.count);
        let code = 2048.0 + (f64::from(record.command) / 1e-3).round();
        assert_eq!(period.code, Some(code as u16));
        // Cycles as the drive itself measures them, without entry and exit of the interrupt.
        assert!((500..4000).contains(&record.cycles), "{}", record.cycles);
    }

    // Every estimate, to the last bit, is that of the core on this machine.
    let drive = Drive::default_drive();
    let design = Design::new(&drive).unwrap();
    let scenario = Scenario::named("fig3").unwrap();
    let host = simulate(&design, &PlantFile::from(&drive), scenario, Law::Core, 1.2).unwrap();
    for (record, sample) in capture.records[begin..].iter().zip(&host.samples) {
        let expected = sample.record.as_ref().unwrap();
        let drive = record.columns().filter(|column| column.name != "cycles");
        let host = expected.columns().filter(|column| column.name != "cycles");
        assert!(
            drive.eq(host),
            "at {}: {record:?}, {expected:?}",
            sample.time
        );
    }

    let csv = String::from_utf8(log::csv(&capture, 1e-3, drive.kind).unwrap()).unwrap();
    assert!(csv.starts_with("time[s],period[1],mode[name],"));
    assert!(csv.lines().next().unwrap().contains("load3_velocity[m/s]"));
    assert_eq!(csv.lines().count(), capture.records.len() + 1);
    assert!(
        log::plot(&capture, 1e-3, drive.kind)
            .unwrap()
            .ends_with("</svg>\n")
    );
}

#[test]
fn a_truncated_log_is_read_as_far_as_it_goes() {
    let (log, _, _) = experiment();
    let whole = decode(&log).unwrap();
    for cut in [1, 100, 1000, 65_537, log.len() - 1] {
        // Cut at the end, and begun in the middle as when a probe attaches late.
        let capture = decode(&log[..cut]);
        if let Ok(capture) = capture {
            assert!(capture.malformed <= 1);
            assert_eq!(capture.records, whole.records[..capture.records.len()]);
        }
        let Ok(late) = decode(&log[cut..]) else {
            continue;
        };
        assert!(late.malformed <= 1, "{}", late.malformed);
        let records = whole.records.len() - late.records.len();
        assert_eq!(late.records, whole.records[records..]);
    }
}

/// Bytes changed at random places: the damaged frames are counted, all others are read.
#[test]
fn a_corrupted_log_is_resynchronised() {
    let (log, _, _) = experiment();
    let whole = decode(&log).unwrap();
    let mut seed = 12_345_u64;
    let mut random = || {
        // Knuth's linear congruential generator, upper half.
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize
    };
    for hits in [1, 10, 100, 1000] {
        let mut damaged = log.clone();
        for _ in 0..hits {
            let at = random() % damaged.len();
            damaged[at] ^= 1 << (random() % 8);
        }
        let capture = decode(&damaged).unwrap();
        let kept = capture.records.len();
        println!(
            "{hits} bytes damaged: {kept} of {} records, {} frames skipped",
            whole.records.len(),
            capture.malformed
        );
        // One byte can spoil two frames where it was or becomes their separator.
        assert!(kept + 2 * hits >= whole.records.len());
        for record in &capture.records {
            assert!(whole.records.contains(record), "{record:?}");
        }
        assert!(capture.lost <= 2 * hits as u64, "{} lost", capture.lost);
        assert!(capture.restarts.is_empty());
        assert_eq!(capture.origins, whole.origins);
    }
}

#[test]
fn a_foreign_stream_is_refused() {
    let mut noise = vec![0_u8; 100_000];
    let mut seed = 1_u64;
    for byte in &mut noise {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        *byte = (seed >> 56) as u8;
    }
    // Noise may hold a frame by chance, but no control step.
    if let Ok(capture) = decode(&noise) {
        assert!(capture.records.is_empty() && capture.malformed > 100);
    }
    for foreign in [
        &b"INFO text that is no defmt stream, without any end"[..],
        &[0xFF; 10_000],
    ] {
        let error = decode(foreign).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("fits this ELF"), "{error}");
    }
    let own = std::fs::read(std::env::current_exe().unwrap()).unwrap();
    let error = read_defmt(&own, "test", &b"abc\0"[..], |_| ()).unwrap_err();
    assert_eq!(error.exit_code(), 2);
}
