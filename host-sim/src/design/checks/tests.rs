//! What the checks say, held against what happens.

use super::*;
use crate::design::assessment::Assessment;
use crate::drive::{Drive, Observer};

fn design(change: impl FnOnce(&mut Drive)) -> Design {
    let mut drive = Drive::default_drive();
    change(&mut drive);
    Design::new(&drive).unwrap()
}

fn named(design: &Design, name: &str) -> Check {
    let judged = Assessment::new(design).unwrap();
    let mut checks = judged.checks.into_iter();
    checks.find(|check| check.name == name).unwrap()
}

/// `arso_core::theory`, Noise: 0.005, 0.026, 0.104 N at 1, 5, 20 um.
#[test]
fn force_noise_is_as_computed_elsewhere() {
    for (resolution, expected) in [(1e-6, 0.005), (5e-6, 0.026), (20e-6, 0.104)] {
        let noise = force_noise(&design(|drive| drive.encoder.resolution = resolution));
        assert!((noise - expected).abs() < 0.0006, "{noise} {expected}");
    }
}

#[test]
fn the_default_drive_passes_everything() {
    for check in Assessment::new(&design(|_| ())).unwrap().checks {
        assert_eq!(check.verdict, Verdict::Pass, "{check:?}");
    }
}

/// What the check foretells is what happens: the same plant is commissioned or not.
#[test]
fn the_brake_check_foretells_commissioning() {
    use crate::drive::PlantFile;
    use crate::simulate::commission;
    use crate::simulate::corridor::corridor;
    for (current_weight, brakes) in [(1.0, true), (0.003, true), (0.001, false), (0.0003, false)] {
        let design = design(|drive| drive.cost.current = current_weight);
        let check = named(&design, "commissioning_brake");
        assert_eq!(check.verdict < Verdict::Refuse, brakes, "{check:?}");
        let plant = PlantFile::from(&design.drive);
        let mut core = corridor(&design, None).unwrap();
        let commissioned = commission(core.as_mut(), &plant, 1e-3);
        assert_eq!(commissioned.is_ok(), brakes, "{current_weight}");
    }
}

/// Slow observers make a loop unstable though gain and observer are stable: what the check says is
/// what the core does on its own plant.
#[test]
fn the_loop_check_foretells_the_simulation() {
    use crate::drive::PlantFile;
    use crate::simulate::scenario::Scenario;
    use crate::simulate::{Law, simulate};
    for (cutoff, stable) in [(55.0, true), (48.0, false), (20.0, false)] {
        let design = design(|drive| {
            drive.control.disturbance_cutoff = cutoff;
            // Rounding and limit would bound what grows slowly.
            drive.encoder.resolution = 1e-9;
            drive.encoder.counter_bits = 32;
            drive.actuator.current_resolution = 0.0;
        });
        let check = named(&design, "closed_loop");
        assert_eq!(check.verdict == Verdict::Pass, stable, "{check:?}");
        let plant = PlantFile::from(&design.drive);
        let scenario = Scenario::named("fig4").unwrap();
        let run = simulate(&design, &plant, scenario, Law::Core, 20.0).unwrap();
        let swing = |from: usize| {
            let part = run.samples[from..from + 2000].iter();
            let part = part.map(|sample| sample.truth[4]);
            let (low, high) = part.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        assert_eq!(swing(18_000) < swing(4000), stable, "{cutoff}");
    }
}

#[test]
fn bad_drives_are_found() {
    let coarse = design(|drive| drive.encoder.resolution = 1e-3);
    assert_eq!(
        named(&coarse, "encoder_force_noise").verdict,
        Verdict::Refuse
    );
    let rough = design(|drive| drive.actuator.current_resolution = 0.05);
    assert_eq!(named(&rough, "current_step").verdict, Verdict::Warn);
    let slow = design(|drive| drive.control.sample_time = 4e-3);
    assert_eq!(
        named(&slow, "samples_per_fastest_mode").verdict,
        Verdict::Warn
    );
    let reaction = design(|drive| drive.control.observer = Observer::Reaction);
    assert_eq!(
        named(&reaction, "distinct_eigenvalues").verdict,
        Verdict::Warn
    );
    // A last load on a spring a million times softer hardly shows at the actuator.
    let hidden = design(|drive| {
        drive.loads[2].stiffness = 3e-4;
        drive.loads[2].damping = 1e-7;
    });
    let check = named(&hidden, "observability");
    assert_ne!(check.verdict, Verdict::Pass, "{check:?}");
    assert!(check.value < 0.1 * named(&design(|_| ()), "observability").value);
}
