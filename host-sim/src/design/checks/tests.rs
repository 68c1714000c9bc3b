//! What the checks say, held against what happens.

use super::encoder::force_noise;
use super::*;
use crate::design::assessment::Assessment;
use crate::design::loop_margins::LoopMargins;
use crate::design::player::player;
use crate::drive::{Drive, Observer, StatedProtection};
use crate::linear::margins::Margins;
use arso_core::{Place, Request};

fn design(change: impl FnOnce(&mut Drive)) -> Design {
    let mut drive = Drive::default_drive();
    change(&mut drive);
    Design::new(&drive).unwrap()
}

/// Limits so wide that the drive is not stopped, whatever it does.
fn unprotected(drive: &mut Drive) {
    let wide = Some(1e9);
    drive.protection = StatedProtection {
        encoder_step: wide,
        velocity: wide,
        following_error: wide,
        reaction_force: wide,
        disturbance: wide,
        innovation: wide,
        tracking_error: wide,
        deflection: wide,
        stiction: wide,
        saturation_time: Some(1e6),
        continuous_current: wide,
        thermal_time: Some(1e6),
        travel: None,
    };
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
            unprotected(drive);
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
    let shown = named(&design(|_| ()), "observability").value;
    assert!(check.value.unwrap() < 0.1 * shown.unwrap());
}

/// What the check says of friction is what start-up does on a plant that has it.
#[test]
fn the_friction_check_foretells_commissioning() {
    use crate::drive::PlantFile;
    use crate::simulate::commission;
    use crate::simulate::corridor::corridor_with;
    // Friction beyond the motor's force leaves none.
    let other = design(|_| ());
    let plans = other.plans().unwrap();
    for (share, moves) in [(0.3, true), (0.45, true), (0.51, false), (1.1, false)] {
        let design = design(|drive| drive.friction.coulomb = share * 6.43 * 2.0);
        let check = named(&design, "friction_share");
        assert_eq!(check.verdict < Verdict::Refuse, moves, "{check:?}");
        let plant = PlantFile::from(&design.drive);
        let mut core = corridor_with(&design, plans, &design.protection(), None).unwrap();
        let commissioned = commission(core.as_mut(), &plant, 1e-3);
        assert_eq!(commissioned.is_ok(), moves, "{share}: {commissioned:?}");
    }
}

/// What the check says of the counter is what the core does in the step.
#[test]
fn the_counter_check_foretells_the_jump() {
    use crate::drive::PlantFile;
    use crate::simulate::scenario::Scenario;
    use crate::simulate::{Law, simulate};
    let with = |resolution: f64| {
        design(|drive| {
            drive.encoder.resolution = resolution;
            // So slow that the step alone counts.
            drive.motion.velocity = Some(1e-3);
            unprotected(drive);
        })
    };
    // The resolution at which the step takes a quarter of the range, from a figure that does not matter.
    let value = named(&with(1e-6), "counts_per_period").value.unwrap();
    let brink = 1e-6 * value / quarter_of_range(16);
    // The drive with its observers is some per cent faster than the true state fed back.
    for (factor, counted) in [(1.5, true), (0.9, false)] {
        let design = with(brink * factor);
        let check = named(&design, "counts_per_period");
        assert_eq!(check.verdict < Verdict::Refuse, counted, "{check:?}");
        let plant = PlantFile::from(&design.drive);
        let scenario = Scenario::named("fig3").unwrap();
        let run = simulate(&design, &plant, scenario, Law::Core, 0.2).unwrap();
        assert_eq!(run.fault.is_none(), counted, "{factor}: {:?}", run.fault);
    }
}

/// A move gets no faster than the check expects, by a fifth, which the warning's margin covers; with a
/// velocity limit no faster at all.
#[test]
fn the_fastest_of_a_move_is_foreseen() {
    for velocity in [0.1, 1.0, 5.0] {
        let design = design(|drive| drive.motion.velocity = Some(velocity));
        let mut player = player(&design).unwrap();
        let counts = paper::STEP / design.drive.encoder.resolution;
        player.ask(Request::Move(Place(counts.round() as i64)));
        let speeds = (0..1000).map(|_| player.step().unwrap().velocity.0.abs());
        let fastest = f64::from(speeds.fold(0.0, f32::max));
        let expected = encoder::move_speed(&design);
        assert!(fastest < 1.2 * expected, "{fastest} {expected}");
        assert!(fastest <= velocity * (1.0 + 1e-3), "{fastest}");
    }
}

/// Little margin is a warning, none to speak of a refusal.
#[test]
fn poor_margins_are_refused() {
    use Verdict::{Pass, Refuse, Warn};
    let margins = |peak_sensitivity, phase_margin_deg| Margins {
        gain_margin_db: None,
        gain_reduction_db: None,
        phase_margin_deg,
        delay_margin: None,
        peak_sensitivity,
        peak_sensitivity_hz: 10.0,
    };
    let good = margins(1.2, None);
    let mut design = design(|_| ());
    let verdicts = |margins: &Margins| -> Vec<Verdict> {
        // Whichever of the two it is that has them.
        let [one, other] = [(margins, &good), (&good, margins)].map(|(following, held)| {
            let (following, held) = (following.clone(), held.clone());
            let checks = of_margins(&design, &LoopMargins { following, held });
            checks.map(|check| check.verdict).collect::<Vec<_>>()
        });
        assert_eq!(one, other);
        one
    };
    assert_eq!(verdicts(&margins(1.8, Some(42.0))), [Pass, Pass]);
    assert_eq!(verdicts(&margins(2.9, Some(20.4))), [Warn, Warn]);
    assert_eq!(verdicts(&margins(9.0, Some(14.0))), [Refuse, Refuse]);
    assert_eq!(verdicts(&margins(1.5, None)), [Pass]);
    // What is no number is refused, and in words.
    let (following, held) = (margins(f64::INFINITY, None), good.clone());
    let poor = LoopMargins { following, held };
    let check = of_margins(&design, &poor).next().unwrap();
    assert_eq!((check.verdict, check.value), (Refuse, None));
    assert!(
        check.advice.starts_with("cannot be computed") && check.advice.contains("cost.current"),
        "{}",
        check.advice
    );
    // Who states the gain has no weight to change.
    design.index = None;
    for check in of_margins(&design, &poor) {
        assert!(
            check.advice.contains("smaller gains in [gain]"),
            "{}",
            check.advice
        );
        assert!(!check.advice.contains("cost."), "{}", check.advice);
    }
}
