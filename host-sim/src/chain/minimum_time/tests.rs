//! Against times computed elsewhere, in closed form, by simulating what the programme found, and by scaling.

use super::*;
use crate::linear::zoh::zero_order_hold;
use proptest::prelude::*;

const BAND: f64 = 0.02;

fn task<'a>(chain: &'a Chain, start: &'a DVector<f64>, target: f64) -> Task<'a> {
    Task {
        chain,
        start,
        target,
        current_limit: 2.0,
        period: 1e-3,
        controlled: 2.min(chain.loads()),
        band: BAND,
    }
}

/// Both times in control periods, from rest.
fn periods(chain: &Chain, target: f64, current_limit: f64, period: f64) -> [f64; 2] {
    let start = DVector::zeros(chain.states());
    let found = minimum_time(&Task {
        current_limit,
        period,
        ..task(chain, &start, target)
    });
    let found = found.unwrap();
    [found.settled / period, found.rest / period].map(f64::round)
}

/// Another program computed these: 30 mm, 2 A, with the plant as it is or with other springs, last mass and force
/// constant.
#[test]
fn times_are_those_computed_elsewhere() {
    for (stiffness, mass, force, expected) in [
        (1.0, 1.0, 1.0, [57.0, 78.0]),
        (1.3, 1.0, 1.0, [51.0, 70.0]),
        (0.7, 1.0, 1.0, [66.0, 89.0]),
        (1.0, 1.5, 1.0, [61.0, 82.0]),
        (1.0, 1.0, 0.9, [57.0, 79.0]),
    ] {
        let mut chain = Chain::of_table_1(300.0 * stiffness, 0.1);
        chain.mass[3] *= mass;
        chain.force_constant *= force;
        let found = periods(&chain, 0.03, 2.0, 1e-3);
        let near = found
            .iter()
            .zip(expected)
            .all(|(t, e)| (t - e).abs() <= 1.0);
        assert!(near, "{stiffness} {mass} {force}: {found:?}");
    }
}

/// Distances in mm that were found to take so many periods from rest to rest, from 50 to 100.
#[test]
fn distances_of_whole_periods_are_those_computed_elsewhere() {
    let chain = Chain::of_table_1(300.0, 0.1);
    for (distance, expected) in [
        (0.6, 50.0),
        (3.1, 60.0),
        (12.5, 70.0),
        (23.0, 75.0),
        (32.0, 78.0),
        (40.0, 80.0),
        (95.0, 90.0),
        (170.0, 100.0),
    ] {
        let [settled, rest] = periods(&chain, 1e-3 * distance, 2.0, 1e-3);
        assert!((rest - expected).abs() <= 1.0, "{distance} mm: {rest}");
        assert!(settled < rest);
    }
}

/// A chain so stiff that it moves as one: `2 sqrt(D M / (k_f I))`, and at most two holds of the current for every
/// mode that is to be at rest as well, or a period of the slowest.
#[test]
fn a_stiff_chain_is_a_double_integrator() {
    for (period, distance) in [(1e-3, 0.05), (1e-4, 0.05), (1e-3, 5.0), (5e-5, 0.01)] {
        let chain = Chain::of_table_1(1e6, 100.0);
        let total: f64 = chain.mass.iter().sum();
        let start = DVector::zeros(8);
        let found = minimum_time(&Task {
            period,
            ..task(&chain, &start, distance)
        });
        let found = found.unwrap();
        let unit = (distance * total / (chain.force_constant * 2.0)).sqrt();
        // To rest; and to the near end of the band so fast that it can just be braked before the far end.
        let rest = found.rest - 2.0 * unit;
        let settled = found.settled - (2.0 * (1.0 + BAND).sqrt() - (4.0 * BAND).sqrt()) * unit;
        let slowest = 1.0 / chain.modes()[0].frequency_hz;
        let late = 0.0..(8.0 * found.hold as f64 * period).max(slowest);
        assert!(
            late.contains(&rest),
            "{period} {distance}: {found:?} {rest}"
        );
        assert!(
            late.contains(&settled),
            "{period} {distance}: {found:?} {settled}"
        );
    }
}

/// What the programme found, simulated in the coordinates of the masses: the controlled mass is in its band from
/// then on, all masses are at rest in the end, and no current is above the limit.
#[test]
fn what_was_found_can_be_done() {
    let chain = Chain::of_table_1(300.0, 0.1);
    let mut pulled = DVector::zeros(8);
    for load in 1..=3 {
        pulled[2 * load] = 0.002 * load as f64;
    }
    for (start, target, period) in [
        (DVector::zeros(8), 0.03, 1e-3),
        (DVector::zeros(8), 0.03, 2e-4),
        (pulled, 0.0, 1e-3),
    ] {
        let task = Task {
            period,
            ..task(&chain, &start, target)
        };
        let found = minimum_time(&task).unwrap();
        let modal = Modal::new(&chain, 2.0).unwrap();
        let error = DVector::from_fn(8, |i, _| start[i] - if i % 2 == 0 { target } else { 0.0 });
        let span = error[4].abs();
        let programme = Programme {
            start: modal.state(&error),
            output: modal.position(2),
            band: BAND * span,
            span,
            period,
            modal: &modal,
        };
        let settled = (found.settled / period).round() as usize;
        let free = (PERIODS * modal.slowest_period() / period).ceil() as usize;
        let horizon = Horizon::to_settle(settled, hold(settled + free), free);
        let (reach, currents) = programme.solve(&horizon).unwrap();
        assert!(suffices(reach));
        let (f, g) = zero_order_hold(&chain.a(), &chain.b(), period);
        let mut state = error;
        for (k, current) in currents.iter().enumerate() {
            let current = 2.0 * current / reach;
            assert!(current.abs() < 2.0 + 1e-5);
            let inside = state[4].abs() < BAND * span + 1e-5 * span;
            assert!(k < settled || inside, "{k}: {}", state[4]);
            state = &f * state + &g * current;
        }
        let rest = state.iter().step_by(2).all(|x| x.abs() < 1e-5 * span);
        assert!(rest, "{state}");
    }
}

/// Holding the current over several periods costs little: the same motion at a fifth of the period.
#[test]
fn a_coarse_grid_is_near() {
    let chain = Chain::of_table_1(300.0, 0.1);
    let fine = periods(&chain, 0.03, 2.0, 1e-3);
    let coarse = periods(&chain, 0.03, 2.0, 1e-4);
    for (fine, coarse) in fine.iter().zip(coarse) {
        assert!((fine - coarse / 10.0).abs() <= 1.5, "{fine} {coarse}");
    }
}

#[test]
fn what_cannot_be_moved_is_said() {
    let mut broken = Chain::of_table_1(300.0, 0.0);
    broken.stiffness[1] = 0.0;
    let start = DVector::zeros(8);
    let error = minimum_time(&task(&broken, &start, 0.03)).unwrap_err();
    assert!(error.0.contains("no current brings"), "{error}");
    let chain = Chain::of_table_1(300.0, 0.1);
    let error = minimum_time(&task(&chain, &start, 0.0)).unwrap_err();
    assert!(error.0.contains("needs a span"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Distance and current scaled alike leave the times as they are; a longer way takes no less.
    #[test]
    fn times_scale(
        loads in 1_usize..=4,
        mass in prop::collection::vec(0.3_f64..3.0, 5),
        stiffness in prop::collection::vec(0.5_f64..2.0, 4),
        // Rotary or linear, light or heavy, slow or fast.
        (unit, frequency) in (-4.0_f64..2.0, 5.0_f64..40.0),
        (way, factor, samples) in (0.3_f64..3.0, -3.0_f64..3.0, 10.0_f64..40.0),
    ) {
        let unit = 10_f64.powf(unit);
        let rate = (std::f64::consts::TAU * frequency).powi(2);
        let chain = Chain {
            mass: mass[..=loads].iter().map(|m| m * unit).collect(),
            stiffness: stiffness[..loads].iter().map(|k| k * unit * rate).collect(),
            damping: stiffness[..loads].iter().map(|k| 1e-4 * k * unit * rate).collect(),
            viscous: 0.0,
            ground: Vec::new(),
            force_constant: unit,
        };
        let period = 1.0 / (frequency * samples);
        let distance = way / rate;
        let current = 10.0;
        let times = periods(&chain, distance, current, period);
        let factor = 10_f64.powf(factor);
        let scaled = periods(&chain, distance * factor, current * factor, period);
        prop_assert_eq!(times, scaled);
        let longer = periods(&chain, 1.5 * distance, current, period);
        prop_assert!(longer[0] >= times[0] && longer[1] >= times[1], "{:?} {:?}", times, longer);
    }
}
