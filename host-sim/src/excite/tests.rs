//! Excitations of many drives, held against what is known of them by other means.

use super::*;
use crate::drive::PlantFile;
use crate::machine::{Friction, chain_of};
use crate::simulate::plant::Plant;
use std::f64::consts::TAU;

fn plan(request: ExcitationRequest) -> ExcitationPlan {
    ExcitationPlan::new(&Drive::default_drive(), &request).unwrap()
}

/// Amplitude of a multiple of 1 / period, steps: the discrete Fourier transform by its
/// definition.
fn amplitude(table: &[i16], line: usize) -> f64 {
    let samples = table.len();
    let (mut re, mut im) = (0.0, 0.0);
    for (k, step) in table.iter().enumerate() {
        let angle = TAU * ((k * line) % samples) as f64 / samples as f64;
        re += f64::from(*step) * angle.cos();
        im -= f64::from(*step) * angle.sin();
    }
    2.0 * re.hypot(im) / samples as f64
}

/// Equal current in every odd line of the band and none beside it, but for rounding: that of the
/// beginning shows at the lowest lines, and is less than a step.
#[test]
fn the_spectrum_of_the_multisine_is_the_band() {
    let plan = plan(ExcitationRequest::default());
    assert_eq!(
        (plan.table.len(), plan.lines.clone()),
        (2048, (5..=111).step_by(2).collect())
    );
    let expected = plan.rms() / plan.unit * (2.0 / 54.0_f64).sqrt();
    assert!(expected > 40.0);
    for line in 0..1024 {
        let found = amplitude(&plan.table, line);
        if plan.lines.contains(&line) {
            assert!((found - expected).abs() < 0.5, "{line}: {found} {expected}");
        } else if line % 2 == 0 {
            assert!(found < 1e-9, "{line}: {found}");
        } else if line < 5 {
            assert!(found < 1.0, "{line}: {found}");
        } else {
            assert!(found < 0.15, "{line}: {found}");
        }
    }
}

#[test]
fn the_chirp_s_current_is_in_the_band() {
    let plan = plan(ExcitationRequest {
        signal: Signal::Chirp,
        ..ExcitationRequest::default()
    });
    let lines = plan.lines.iter();
    let power: f64 = lines
        .map(|line| 0.5 * amplitude(&plan.table, *line).powi(2))
        .sum();
    let all = (plan.rms() / plan.unit).powi(2);
    assert!(power > 0.95 * all, "{power} {all}");
    assert!((plan.rms() / plan.peak() - 0.5_f64.sqrt()).abs() < 0.01);
}

#[test]
fn the_defaults_are_those_of_the_drive() {
    let drive = Drive::default_drive();
    let plan = plan(ExcitationRequest::default());
    let modes = chain_of(&drive.actuator, &drive.loads, 0.0).modes();
    let [from, to] = plan.band();
    let line = 2.0 / 2.048;
    assert!((0.0..line).contains(&(from - 0.2 * modes[0].frequency_hz)));
    assert!((0.0..line).contains(&(1.5 * modes[2].frequency_hz - to)));
    assert!((plan.peak() - 0.5).abs() < 1e-12);
    assert_eq!((plan.unit, plan.repetitions), (1e-3, 4));
    assert!((plan.duration() - 8.192).abs() < 1e-12);
    assert_eq!(plan.travel, 4.0 * plan.prediction.travel);
    assert_eq!(plan.currents().count(), 4 * 2048);
    assert_eq!(
        plan.table.iter().map(|step| i32::from(*step)).sum::<i32>(),
        0
    );
}

/// Drives of all speeds and outputs: the table fits, its currents are steps of the output.
#[test]
fn every_drive_has_an_excitation() {
    for (sample_time, limit, resolution) in [
        (1e-3, 2.0, 1e-3),
        (1e-4, 2.0, 0.0),
        (5e-5, 300.0, 1e-3),
        (2.5e-3, 0.02, 1e-3),
        (1e-3, 1e9, 1e-9),
    ] {
        let mut drive = Drive::default_drive();
        drive.control.sample_time = sample_time;
        drive.actuator.current_limit = limit;
        drive.actuator.current_resolution = resolution;
        // One that can follow what so much current does.
        drive.encoder.resolution *= f64::max(1.0, limit / 2.0);
        for signal in [Signal::Multisine, Signal::Chirp] {
            let request = ExcitationRequest {
                signal,
                repetitions: 1,
                ..ExcitationRequest::default()
            };
            let plan = ExcitationPlan::new(&drive, &request).unwrap();
            assert!(plan.table.len() <= LONGEST_TABLE && plan.lines[0] >= 4);
            let wanted = (0.25 * limit).max(10.0 * resolution);
            assert!(plan.peak() <= wanted * (1.0 + 1e-9) && plan.peak() > 0.9 * wanted);
            if resolution > 0.0 {
                let steps = plan.unit / resolution;
                assert!((steps - steps.round()).abs() < 1e-6, "{steps}");
            }
            let lines = plan.band().map(|end| end * sample_time);
            assert!(lines[0] > 0.0 && lines[1] <= 0.4);
        }
    }
}

/// A nearly rigid chain: the travel is the current integrated twice, and the springs carry the
/// loads' inertia at the largest current, that at the actuator most.
#[test]
fn the_prediction_of_a_rigid_chain_is_newton_s() {
    let mut drive = Drive::default_drive();
    for load in &mut drive.loads {
        (load.stiffness, load.damping) = (1e6, 300.0);
    }
    let request = ExcitationRequest {
        from: Some(2.0),
        to: Some(20.0),
        ..ExcitationRequest::default()
    };
    let plan = ExcitationPlan::new(&drive, &request).unwrap();
    let per_step = 6.43 / 0.116 * plan.unit;
    let (mut position, mut velocity, mut farthest) = (0.0, 0.0, 0.0_f64);
    for step in &plan.table {
        let acceleration = f64::from(*step) * per_step;
        position += 1e-3 * velocity + 0.5e-6 * acceleration;
        velocity += 1e-3 * acceleration;
        farthest = farthest.max(position.abs());
    }
    let found = plan.prediction;
    assert!(
        (found.travel / farthest - 1.0).abs() < 1e-3,
        "{found:?} {farthest}"
    );
    let stretch = 0.057 * plan.peak() * 6.43 / 0.116 / 1e6;
    assert_eq!(found.spring, 1);
    assert!(
        (found.stretch / stretch - 1.0).abs() < 0.02,
        "{found:?} {stretch}"
    );
}

/// A hundred plays on the flexible chain: the centre of mass always comes back, and the actuator
/// gets no farther than was predicted for a few.
#[test]
fn the_machine_does_not_drift_away() {
    let drive = Drive::default_drive();
    let plan = plan(ExcitationRequest::default());
    let mut plant = Plant::new(&PlantFile::from(&drive), plan.sample_time);
    let mut farthest = 0.0_f64;
    for _ in 0..100 {
        for step in &plan.table {
            plant.advance(f64::from(*step) * plan.unit).unwrap();
            farthest = farthest.max(plant.state()[0].abs());
        }
        let mass = plant.chain().mass.iter().enumerate();
        let moment: f64 = mass.map(|(i, m)| m * plant.state()[2 * i]).sum();
        assert!((moment / 0.116).abs() < 1e-9, "{moment}");
    }
    let predicted = plan.prediction.travel;
    assert!(
        (farthest / predicted - 1.0).abs() < 1e-3,
        "{farthest} {predicted}"
    );
}

/// Friction that is the same in both directions does not make the machine creep, once it has
/// settled. With every multiple of 1 / period in the signal the default drive creeps by 0.1 m in each
/// repetition, at 0.05 N already.
#[test]
fn friction_does_not_make_it_creep() {
    for signal in [Signal::Multisine, Signal::Chirp] {
        for (coulomb, viscous) in [(0.05, 0.0), (0.1, 0.2), (1.0, 0.0)] {
            let mut drive = Drive::default_drive();
            drive.friction = Friction {
                coulomb,
                viscous,
                ..Friction::default()
            };
            let travel = |repetitions| {
                let request = ExcitationRequest {
                    signal,
                    repetitions,
                    ..ExcitationRequest::default()
                };
                ExcitationPlan::new(&drive, &request)
                    .unwrap()
                    .prediction
                    .travel
            };
            let creep = (travel(30) - travel(10)) / 20.0;
            assert!(creep < 2e-3, "{signal:?} {coulomb} {viscous}: {creep}");
        }
    }
}

/// Half of the travel that is given is enough for what is predicted; the rest is the request's.
#[test]
fn the_current_is_reduced_to_fit_the_travel() {
    let whole = plan(ExcitationRequest::default());
    let reduced = plan(ExcitationRequest {
        travel: Some(0.5 * whole.prediction.travel),
        ..ExcitationRequest::default()
    });
    assert_eq!(reduced.reduced_from, Some(0.5));
    assert_eq!(reduced.travel, 0.5 * whole.prediction.travel);
    assert!(
        (reduced.peak() - 0.125).abs() < 0.0025,
        "{}",
        reduced.peak()
    );
    assert!(reduced.prediction.travel <= 0.5 * reduced.travel);
    let wide = plan(ExcitationRequest {
        travel: Some(2.0 * whole.prediction.travel),
        ..ExcitationRequest::default()
    });
    assert_eq!((wide.reduced_from, wide.table), (None, whole.table));
}

/// Friction beyond the current holds the actuator: said before anything is played.
#[test]
fn a_current_that_moves_nothing_is_refused() {
    let mut drive = Drive::default_drive();
    drive.friction.coulomb = 4.0;
    let error = ExcitationPlan::new(&drive, &ExcitationRequest::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("a current of 0.500 A moves the actuator by 0 counts"),
        "{error}"
    );
    let current = Some(1.5);
    let request = ExcitationRequest {
        current,
        ..ExcitationRequest::default()
    };
    assert!(ExcitationPlan::new(&drive, &request).is_ok());
}

/// The source is what the firmware compiles (a test of the firmware's file has the rest).
#[test]
fn the_source_holds_every_entry() {
    let drive = Drive::default_drive();
    let plan = plan(ExcitationRequest::default());
    let text = excitation_file(&plan, &drive, "test.toml");
    let (_, profile) = text.split_once("profile: &[").unwrap();
    let (profile, _) = profile.split_once(']').unwrap();
    let entries = profile.split(',').map(str::trim).filter(|e| !e.is_empty());
    let entries: Vec<i16> = entries.map(|entry| entry.parse().unwrap()).collect();
    assert_eq!(entries, plan.table);
    assert!(text.lines().all(|line| line.len() <= 120));
}
