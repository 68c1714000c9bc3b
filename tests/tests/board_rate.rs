//! The release ELF at control periods shorter than a millisecond, on the virtual board: a planned move at 10 and at
//! 20 kHz, with the record of every period in the log.
#![cfg(feature = "virtual-board")]

use arso_core::Place;
use arso_core::request::Request;
use arso_tests::virtual_board::Rig;
use arso_tests::virtual_board::host::Host;
use arso_tests::virtual_board::image::Image;
use host_sim::capture::read_defmt;
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::simulate::corridor::settings_image;

/// How near to its target every mass comes, m.
const TOLERANCE: f64 = 20e-6;

#[test]
fn a_drive_runs_at_ten_and_twenty_kilohertz() {
    for (period, per_millisecond) in [(1e-4, 10), (5e-5, 20)] {
        let mut drive = Drive::default_drive();
        drive.control.sample_time = period;
        let design = Design::new(&drive).unwrap();
        let mut image = Image::parse(&arso_tests::firmware()).unwrap();
        image.keep_settings(&settings_image(&design).unwrap());
        let mut rig = Rig::start(&image, &drive, &PlantFile::from(&drive), |_| ()).unwrap();
        rig.periods(20 * per_millisecond).unwrap();
        let mut host = Host::of(rig);
        host.enable();
        // Places count from where the drive stood when it began.
        let start = host.status().position;
        let zero = host.truth()[0] - f64::from(start);
        let target = Place(30_000);
        assert_eq!(host.request(Request::Move(target)), Ok(()));
        host.until(400 * per_millisecond, |status| status.held == Some(target));
        host.periods(300 * per_millisecond as usize);
        let place = zero + 30_000.0 * drive.encoder.resolution;
        let truth = host.truth();
        assert!(
            truth.iter().all(|mass| (mass - place).abs() < TOLERANCE),
            "{truth:?} at {place}"
        );
        let log = host.rig.log.as_slice();
        let capture = read_defmt(&arso_tests::firmware(), "firmware", log, |_| ()).unwrap();
        assert_eq!((capture.lost, capture.malformed), (0, 0));
        let runs = host.rig.board.interrupt_cost().runs;
        assert_eq!(capture.records.len() as u64, runs);
        // What the core estimates in single precision, at rest.
        let last = capture.records.last().unwrap();
        let estimates = last.load_position.iter().map(|x| zero + f64::from(*x));
        for (estimate, truth) in estimates.zip(&truth[1..]) {
            assert!(
                (estimate - truth).abs() < TOLERANCE,
                "{estimate} of {truth}"
            );
        }
    }
}
