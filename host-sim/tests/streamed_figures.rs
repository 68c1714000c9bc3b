//! Figures that are taken while a run passes are those of the run: each formed here once more, from the samples
//! that were kept, by what its description says.

use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::machine::ExternalForce;
use host_sim::simulate::ending::Motion;
use host_sim::simulate::metrics::Metrics;
use host_sim::simulate::scenario::{SCENARIOS, Scenario};
use host_sim::simulate::sequence::MoveSequence;
use host_sim::simulate::watch::{measure_moves, measure_watched, watched, watched_moves};
use host_sim::simulate::{Law, Run, measure, simulate};

/// Plants on which runs settle, ring, hunt, stop themselves and do not settle at all.
fn plants(drive: &Drive) -> Vec<(&'static str, PlantFile)> {
    let plant = |name, change: &dyn Fn(&mut PlantFile)| {
        let mut plant = PlantFile::from(drive);
        change(&mut plant);
        (name, plant)
    };
    let pushed = |newton, duration| {
        move |plant: &mut PlantFile| {
            plant.forces.push(ExternalForce {
                mass: 1,
                start: 0.1,
                duration,
                newton,
            });
        }
    };
    vec![
        plant("nominal", &|_| {}),
        plant("friction", &|plant| {
            plant.friction.coulomb = 0.3;
            plant.friction.breakaway = 0.2;
            plant.friction.stribeck_velocity = 0.01;
        }),
        plant("soft", &|plant| {
            plant
                .loads
                .iter_mut()
                .for_each(|load| load.stiffness *= 0.3);
        }),
        plant("late, with a gap", &|plant| {
            plant.actuator.delay = 0.7e-3;
            plant.imperfections.backlash = vec![0.0, 0.3e-3];
            plant.imperfections.noise = 5e-6;
        }),
        plant("pushed", &pushed(1.0, 10.0)),
        plant("thrown", &pushed(60.0, 0.2)),
    ]
}

/// The figures as their descriptions have them.
fn by_definition(run: &Run) -> Metrics {
    let samples = &run.samples;
    let (n, target) = (samples.len(), run.scenario.target);
    let controlled = 2 * (samples[0].truth.len() / 2 - 1).min(2);
    let masses = samples[0].truth.len() / 2;
    let span = target - samples[0].truth[controlled];
    let off = |k: usize, element: usize| samples[k].truth[element] - target;
    // First sample from which on all are inside, unless it is in the last tenth.
    let held = |inside: &dyn Fn(usize) -> bool| {
        let from = (0..=n).find(|from| (*from..n).all(inside)).unwrap();
        let enough = from < n && (n - from) as f64 >= 0.1 * n as f64;
        enough.then_some(from)
    };
    let in_band = held(&|k| off(k, controlled).abs() <= 0.02 * span.abs());
    let tolerance = run.settling_tolerance;
    let there = held(&|k| {
        [0, controlled]
            .iter()
            .all(|e| off(k, *e).abs() <= tolerance)
    });
    let window = in_band.map(|from| from.max((5.0 * n as f64 / 12.0).round() as usize)..n);
    let swing = |range: std::ops::Range<usize>, element: usize| {
        let each = || range.clone().map(|k| samples[k].truth[element]);
        each().fold(f64::MIN, f64::max) - each().fold(f64::MAX, f64::min)
    };
    let mean = |range: std::ops::Range<usize>, element: usize| {
        let count = range.len() as f64;
        range.map(|k| samples[k].truth[element]).sum::<f64>() / count
    };
    let last = samples[n - 1].time;
    let begin = (0..n)
        .find(|k| samples[*k].time >= last - 0.2 * last)
        .unwrap();
    let rest = 50e-6_f64.max(2.0 * run.resolution);
    let motion = [0, controlled].map(|element| swing(begin..n, element));
    let half = begin + (n - begin) / 2;
    let goes_on = swing(half..n, 0) >= 0.7 * swing(begin..half, 0)
        && (mean(half..n, 0) - mean(begin..half, 0)).abs() <= 0.4 * motion[0];
    let state = if motion[0] > rest && goes_on {
        Motion::Hunting
    } else if motion[0] > rest || motion[1] > rest {
        Motion::Moving
    } else {
        Motion::Rest
    };
    let mut metrics = Metrics::new(run);
    let end = &mut metrics.end;
    end.from = samples[begin].time;
    end.offset = [0, controlled].map(|element| mean(begin..n, element) - target);
    (end.motion, end.tolerance, end.state) = (motion, rest, state);
    metrics.within_band_from = in_band.map(|k| samples[k].time);
    metrics.settling_time = metrics.within_band_from.filter(|_| state == Motion::Rest);
    metrics.within_tolerance_from = there.map(|k| samples[k].time);
    metrics.settling_tolerance = tolerance;
    metrics.overshoot = (0..n)
        .map(|k| 100.0 * (off(k, controlled) / span))
        .fold(0.0, f64::max);
    metrics.residual_vibration = window.clone().map(|window| {
        (0..masses)
            .map(|mass| swing(window.clone(), 2 * mass))
            .collect()
    });
    metrics.offset = window.map(|window| {
        let count = window.len() as f64;
        window.map(|k| off(k, controlled)).sum::<f64>() / count
    });
    metrics.peak_current = samples.iter().map(|s| s.command.abs()).fold(0.0, f64::max);
    metrics.estimation_error = samples[0].record.as_ref().map(|_| {
        let of = |mass: usize| {
            let squares = samples.iter().map(|sample| {
                let record = sample.record.as_ref().unwrap();
                let estimate = match mass {
                    0 => record.position,
                    load => record.load_position[load - 1],
                };
                (f64::from(estimate) - sample.truth[2 * mass]).powi(2)
            });
            (squares.sum::<f64>() / n as f64).sqrt()
        };
        (0..masses).map(of).collect()
    });
    metrics.fault = run.fault.map(|(_, fault)| fault.number());
    metrics.fault_time = run.fault.map(|(time, _)| time);
    metrics
}

fn said(metrics: &Metrics) -> String {
    format!("{metrics:?}")
}

#[test]
fn figures_of_a_run_that_passes_are_those_of_one_that_is_kept() {
    let design = Design::new(&Drive::default_drive()).unwrap();
    let (mut settled, mut lost, mut faults, mut restless) = (0, 0, 0, 0);
    for (name, plant) in plants(&design.drive) {
        for scenario in &SCENARIOS {
            for law in [Law::Core, Law::FullState] {
                // Long enough, and not.
                for duration in [1.2, 0.23] {
                    let case = format!("{name}, {}, {law:?}, {duration} s", scenario.name);
                    let run = simulate(&design, &plant, scenario, law, duration).unwrap();
                    let metrics = measure(&design, &plant, scenario, law, duration).unwrap();
                    assert_eq!(said(&metrics), said(&by_definition(&run)), "{case}");
                    settled += i32::from(metrics.settling_time.is_some());
                    lost += i32::from(metrics.within_band_from.is_none());
                    faults += i32::from(metrics.fault.is_some());
                    restless += i32::from(metrics.end.state == Motion::Hunting);
                }
            }
        }
    }
    // The cases are of every kind.
    for kind in [settled, lost, faults, restless] {
        assert!(kind > 3, "{settled} {lost} {faults} {restless}");
    }
}

#[test]
fn watched_figures_are_those_of_the_runs_that_are_kept() {
    let design = Design::new(&Drive::default_drive()).unwrap();
    let scenario = &Scenario::PLANNED;
    let moves = [
        MoveSequence::new(&design, &[0.03], &[]).unwrap(),
        // The second one put on top of the first, the third after rest.
        MoveSequence::new(&design, &[0.03, -0.01, 0.004], &[0.05, 0.1, 0.9]).unwrap(),
    ];
    for (name, plant) in plants(&design.drive) {
        for law in [Law::Core, Law::FullState] {
            let case = format!("{name}, {law:?}");
            let kept = watched(&design, &plant, scenario, law, 0.7).unwrap().1;
            let passed = measure_watched(&design, &plant, scenario, law, 0.7).unwrap();
            assert_eq!(said(&kept), said(&passed), "{case}");
            // The last one also where the run ends before the third begins.
            for (sequence, duration) in [(&moves[0], 0.6), (&moves[1], 1.4), (&moves[1], 0.6)] {
                let kept = watched_moves(&design, &plant, sequence, law, duration);
                let passed = measure_moves(&design, &plant, sequence, law, duration);
                let (Ok(kept), Ok(passed)) = (&kept, &passed) else {
                    let (kept, passed) = (kept.map(|_| ()), passed.map(|_| ()));
                    assert_eq!(format!("{kept:?}"), format!("{passed:?}"), "{case}");
                    continue;
                };
                let kept: Vec<String> = kept.1.iter().map(|part| said(&part.1)).collect();
                let passed: Vec<String> = passed.iter().map(said).collect();
                assert_eq!(kept, passed, "{case}, {duration} s");
            }
        }
    }
}
