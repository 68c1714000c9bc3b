//! The drive beside its rivals, on the same plants in the same run.
//!
//! A step under: the drive itself, its gain on the true state (the bound of that gain), on a Kalman
//! filter of the encoder alone, and collocated PD on a step and on references shaped by ZV, ZVD and
//! EI. The plants: as designed for, stiffness ±30 %, last load ±50 %, force constant ±10 %, the current
//! one sample late, Coulomb friction. The rivals are tuned here, on the worst of the plants whose
//! parameters differ (the encoder's filter on friction as well, which PD cannot remove); the drive is
//! taken as designed.

mod bounds;
mod encoder_observer;
mod pd;
mod shaper;
mod tune;

pub use bounds::bounds;
pub use encoder_observer::Settings as EncoderSettings;
pub use pd::Settings as PdSettings;
pub use shaper::Shaper;

use crate::design::Design;
use crate::drive::PlantFile;
use crate::error::{Error, Result};
use crate::output::Progress;
use crate::simulate::metrics::Metrics;
use crate::simulate::scenario::{SCENARIOS, Scenario};
use crate::simulate::watch::{after, judged};
use crate::simulate::{Control, Core, FullState, Law, Run, close_loop};
use encoder_observer::EncoderObserver;
use pd::Pd;
use serde::Serialize;

/// One plant of the comparison.
#[derive(Clone, Debug)]
pub struct Case {
    /// What differs from the drive file.
    pub name: String,
    /// The plant.
    pub plant: PlantFile,
    /// By how many control periods the current comes late.
    pub late: usize,
    /// Whether the rivals are tuned on it.
    tuned: bool,
}

/// A law's figures on one plant.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Which plant.
    pub case: String,
    /// The figures; none when the run could not be made.
    pub metrics: Option<Metrics>,
    /// Why it could not.
    pub failure: Option<String>,
}

/// A law on all plants.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Which law.
    pub law: &'static str,
    /// What it was tuned to.
    pub tuning: Tuning,
    /// One for each case.
    pub outcomes: Vec<Outcome>,
}

/// What a law was tuned to.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Tuning {
    /// As designed.
    Design,
    /// A PD law.
    Pd(PdSettings),
    /// The filter on the encoder.
    Encoder(EncoderSettings),
}

/// Friction of the friction case where the drive has none, as a share of the motor's force.
const FRICTION: f64 = 0.0155;

/// Length of the runs, in periods of the slowest mode, and at least, s.
const PERIODS: f64 = 15.0;
const SHORTEST: f64 = 1.2;
/// Longest runs, in control periods: thousands of runs are made.
const LONGEST: f64 = 50_000.0;

/// How many laws there are.
const LAWS: usize = 7;

/// The step that is compared: the paper's first.
fn scenario() -> &'static Scenario {
    &SCENARIOS[0]
}

/// The plants.
#[must_use]
pub fn cases(design: &Design) -> Vec<Case> {
    let mut nominal = PlantFile::from(&design.drive);
    nominal.friction.coulomb = 0.0;
    let mut cases = Vec::new();
    let mut case = |name: &str, late, tuned, change: &dyn Fn(&mut PlantFile)| {
        let mut plant = nominal.clone();
        change(&mut plant);
        cases.push(Case {
            name: name.into(),
            plant,
            late,
            tuned,
        });
    };
    let stiffness = |factor: f64| {
        move |plant: &mut PlantFile| {
            for load in &mut plant.loads {
                load.stiffness *= factor;
            }
        }
    };
    let last_load = |factor: f64| {
        move |plant: &mut PlantFile| {
            if let Some(load) = plant.loads.last_mut() {
                load.mass *= factor;
            }
        }
    };
    let force = |factor: f64| move |plant: &mut PlantFile| plant.actuator.force_constant *= factor;
    let actuator = &design.drive.actuator;
    let own = design.drive.friction.coulomb;
    let coulomb = if own > 0.0 {
        own
    } else {
        FRICTION * actuator.largest_force()
    };
    let unit = design.drive.kind.units().force;
    case("nominal", 0, true, &|_| ());
    case("k +30 %", 0, true, &stiffness(1.3));
    case("k -30 %", 0, true, &stiffness(0.7));
    case("load +50 %", 0, true, &last_load(1.5));
    case("load -50 %", 0, true, &last_load(0.5));
    case("k_f +10 %", 0, true, &force(1.1));
    case("k_f -10 %", 0, true, &force(0.9));
    case("1 sample late", 1, false, &|_| ());
    case(
        &format!("friction {coulomb:.3} {unit}"),
        0,
        false,
        &|plant| {
            plant.friction.coulomb = coulomb;
        },
    );
    cases
}

/// Whether the runs are short enough to make thousands of them.
///
/// # Errors
/// [`Error::Comparison`] when they are not.
pub fn require_comparable(design: &Design) -> Result<()> {
    let (duration, period) = (duration(design), design.drive.control.sample_time);
    if duration > LONGEST * period {
        return Err(Error::Comparison(format!(
            "{PERIODS} periods of the slowest mode are {duration:.1} s, {:.0} control periods: at most \
             {LONGEST} can be compared",
            duration / period
        )));
    }
    Ok(())
}

/// All laws on all plants.
///
/// * `progress`: told of each law as its turn comes
///
/// # Errors
/// [`Error::Design`] or [`Error::Comparison`] when a rival cannot be formed, or the runs are too long.
pub fn compare(design: &Design, progress: &Progress<'_>) -> Result<Vec<Row>> {
    require_comparable(design)?;
    let cases = cases(design);
    let duration = duration(design);
    let target = scenario().target;
    let period = design.drive.control.sample_time;
    let run = |case: &Case, law, control: &mut dyn Control, duration: f64| {
        let plant = (&case.plant, case.late);
        close_loop(law, control, plant, scenario(), (period, duration))
    };
    let periods = (duration / period).round() as usize;
    let row = |law: &'static str, tuning, make: &dyn Fn(&Case) -> Result<Box<dyn Control>>| {
        let outcomes = cases.iter().map(|case| {
            let result = make(case).and_then(|mut control| {
                let law = Law::Rival(law);
                let run = run(case, law, control.as_mut(), duration + after(period))?;
                Ok(judged(run, periods).1)
            });
            Outcome {
                case: case.name.clone(),
                failure: result.as_ref().err().map(ToString::to_string),
                metrics: result.ok(),
            }
        });
        Row {
            law,
            tuning,
            outcomes: outcomes.collect(),
        }
    };
    // The longest over the plants that are tuned on; a law that cannot be formed is worst.
    let worst = |with_friction: bool, make: &dyn Fn() -> Result<Box<dyn Control>>| {
        let tuned = cases
            .iter()
            .filter(|case| case.tuned || (with_friction && case.plant.friction.coulomb > 0.0));
        tuned
            .map(|case| {
                let result = make()
                    .and_then(|mut control| run(case, Law::Rival(""), control.as_mut(), duration));
                result.map_or(f64::INFINITY, |run: Run| tune::criterion(&run, duration))
            })
            .fold(0.0, f64::max)
    };

    progress(0, LAWS, "drive");
    let mut rows = vec![
        row("full state", Tuning::Design, &|_| {
            Ok(Box::new(FullState::new(design, scenario())))
        }),
        row("drive", Tuning::Design, &|case| {
            Ok(Box::new(Core::new(design, &case.plant, scenario())?))
        }),
    ];

    progress(rows.len(), LAWS, "encoder filter");
    let actuator = &design.drive.actuator;
    let force = actuator.largest_force();
    let settings = |point: &[f64]| EncoderSettings {
        load_force: force * point[0].exp(),
        disturbance: force * point[1].exp(),
    };
    let grid = [logarithms(1e-5, 1e-1, 5), logarithms(0.03, 30.0, 5)];
    let best = tune::search(&grid, |point| {
        worst(true, &|| {
            let control = EncoderObserver::new(design, settings(point), target)?;
            Ok(Box::new(control))
        })
    })?;
    let best = settings(&best);
    rows.push(row("encoder filter", Tuning::Encoder(best), &|_| {
        Ok(Box::new(EncoderObserver::new(design, best, target)?))
    }));

    for (name, shaper) in [
        ("PD", Shaper::None),
        ("PD + ZV", Shaper::Zv),
        ("PD + ZVD", Shaper::Zvd),
        ("PD + EI", Shaper::Ei),
    ] {
        progress(rows.len(), LAWS, name);
        let best = tuned_pd(design, shaper, |settings| {
            worst(false, &|| {
                Ok(Box::new(Pd::new(design, settings, shaper, target)))
            })
        })?;
        rows.push(row(name, Tuning::Pd(best), &|_| {
            Ok(Box::new(Pd::new(design, best, shaper, target)))
        }));
    }
    Ok(rows)
}

/// Length of the runs, s.
#[must_use]
pub fn duration(design: &Design) -> f64 {
    let slowest = design.modes().first().map_or(1.0, |mode| mode.frequency_hz);
    (PERIODS / slowest).max(SHORTEST)
}

/// The best PD law: bandwidth and damping of a rigid drive and, with a shaper, duration of the ramps
/// and the shaper's frequency.
fn tuned_pd(
    design: &Design,
    shaper: Shaper,
    cost: impl Fn(PdSettings) -> f64,
) -> Result<PdSettings> {
    let slowest = design.modes().first().map_or(1.0, |mode| mode.frequency_hz);
    let omega = std::f64::consts::TAU * slowest;
    let period = design.drive.control.sample_time;
    let settings = |point: &[f64]| {
        let rigid = (omega * point[0].exp(), point[1].exp());
        let ramp = point.get(2).map_or(period, |ramp| ramp.exp() / slowest);
        let tuning = point.get(3).map_or(1.0, |tuning| tuning.exp());
        PdSettings::new(design, rigid, ramp, tuning)
    };
    let grid = match shaper {
        Shaper::None => vec![logarithms(0.2, 10.0, 12), logarithms(0.1, 3.0, 10)],
        _ => vec![
            logarithms(0.3, 8.0, 7),
            logarithms(0.2, 2.0, 5),
            logarithms(0.02, 1.5, 4),
            vec![0.0],
        ],
    };
    let best = tune::search(&grid, |point| settings(point).map_or(f64::INFINITY, &cost))?;
    settings(&best)
}

/// Logarithms of `count` values from `first` to `last` in equal ratios.
fn logarithms(first: f64, last: f64, count: u32) -> Vec<f64> {
    let step = (last / first).ln() / f64::from(count - 1);
    (0..count)
        .map(|i| first.ln() + step * f64::from(i))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;

    /// Another program computed full-state feedback and a PD law tuned for its worst settling time: the same figures for the first, and as good a worst case for the second.
    #[test]
    fn figures_are_those_computed_elsewhere() {
        let design = Design::new(&Drive::default_drive()).unwrap();
        let rows = compare(&design, &crate::output::unwatched).unwrap();
        let row = |name: &str| rows.iter().find(|row| row.law == name).unwrap();
        let settled = |row: &Row, case: &str| {
            let outcomes = &row.outcomes;
            let outcome = outcomes.iter().find(|outcome| outcome.case == case);
            let metrics = outcome.unwrap().metrics.clone().unwrap();
            (metrics.settling_time.map(|t| 1e3 * t), metrics.overshoot)
        };
        for (case, time, overshoot) in [
            ("nominal", 139.0, 0.6),
            ("k +30 %", 130.0, 0.3),
            ("k -30 %", 94.0, 1.5),
            ("load +50 %", 103.0, 1.0),
            ("k_f -10 %", 136.0, 1.6),
        ] {
            let (settled, beyond) = settled(row("full state"), case);
            assert!(
                (settled.unwrap() - time).abs() <= 1.0,
                "{case}: {settled:?}"
            );
            assert!((beyond - overshoot).abs() < 0.1, "{case}: {beyond}");
        }
        let pd = ["nominal", "k +30 %", "k -30 %", "load +50 %", "k_f -10 %"]
            .map(|case| settled(row("PD"), case).0.unwrap());
        let worst = pd.into_iter().fold(0.0, f64::max);
        assert!(worst <= 212.0, "{worst}");
        // Friction stops a PD law short of its target; the drive removes it.
        let friction = &rows[0].outcomes.last().unwrap().case;
        assert_eq!(settled(row("PD"), friction).0, None);
        assert!(settled(row("drive"), friction).0.unwrap() < 200.0);
    }
}
