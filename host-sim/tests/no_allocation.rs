//! The closed loop allocates nothing: a run of 800 periods more allocates no more often, but for lists of figures that
//! the shorter one may not have.

use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::simulate::scenario::Scenario;
use host_sim::simulate::sequence::MoveSequence;
use host_sim::simulate::watch::measure_moves;
use host_sim::simulate::{Law, measure, simulate};

/// Lists of figures of a run, or of two moves.
const FIGURES: u64 = 4;

/// Allocations of what is done for some time, s.
fn allocations(run: impl Fn(f64), duration: f64) -> u64 {
    allocation_counter::measure(|| run(duration)).count_total
}

fn assert_few_more(run: impl Fn(f64), case: &str) {
    let (short, long) = (allocations(&run, 0.8), allocations(&run, 1.6));
    assert!(long <= short + FIGURES, "{case}: {short}, then {long}");
}

#[test]
fn a_longer_run_allocates_no_more() {
    let design = Design::new(&Drive::default_drive()).unwrap();
    // Found once, when they are first asked for.
    design.plans().unwrap();
    let _ = design.protection();
    let nominal = PlantFile::from(&design.drive);
    let mut rough = nominal.clone();
    rough.friction.coulomb = 0.2;
    rough.actuator.delay = 0.4e-3;
    rough.actuator.lag = 0.2e-3;
    rough.imperfections.noise = 1e-6;
    rough.imperfections.backlash = vec![20e-6];
    let step = Scenario::named("fig3").unwrap();
    for plant in [&nominal, &rough] {
        for law in [Law::Core, Law::FullState] {
            for scenario in [step, &Scenario::PLANNED] {
                let run = |duration| {
                    measure(&design, plant, scenario, law, duration).unwrap();
                };
                assert_few_more(run, &format!("{law:?}, {}", scenario.name));
            }
            let moves = MoveSequence::new(&design, &[0.03, -0.02], &[0.0, 0.35]).unwrap();
            let run = |duration| {
                measure_moves(&design, plant, &moves, law, duration).unwrap();
            };
            assert_few_more(run, &format!("{law:?}, two moves"));
        }
    }
    // Where samples are kept, the counter sees them.
    let kept = |duration| {
        simulate(&design, &nominal, step, Law::Core, duration).unwrap();
    };
    assert!(allocations(kept, 1.6) > allocations(kept, 0.8) + 1000);
}
