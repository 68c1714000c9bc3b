//! Weights from a requested settling time.
//!
//! One family of weights, from slow to fast: every mass weighs the same, and the velocity weight is
//! that of the position over the square of the bandwidth,
//!
//! ```text
//! (n + 1) q = R (ω² M / k_f)²        q_v = q / ω²
//! ```
//!
//! A rigid drive of mass `M` then has the bandwidth `ω` and the damping ratio √3/2. The smallest `ω`
//! is taken with which feedback of the true state, sampled and without current limit, brings the
//! controlled mass into the band of 2 % in the time asked for. The drive's own loop, with its
//! observers, takes a little longer; `host-sim compare` shows both.

use super::PerformanceIndex;
use crate::chain::{Chain, controlled_mass};
use crate::design::regulator::regulator;
use crate::drive::SETTLING_BAND;
use crate::linear::dlqr::Regulator;
use crate::linear::zoh::zero_order_hold;
use nalgebra::{DVector, RowDVector};

/// Ratio between one bandwidth tried and the next.
const STEP: f64 = 1.01;

/// How long is waited for the mass to settle, in settling times asked for.
const HORIZON: f64 = 50.0;
/// Longest request, in control periods.
const LONGEST: f64 = 1e6;
/// Instants at which the motion is looked at within the time asked for, at the least.
const INSTANTS: f64 = 2000.0;

/// Position and velocity weights, one entry per mass, actuator first.
///
/// * `current`: weight `R`
/// * `sample_time`, `settling_time`: s
///
/// # Errors
/// A sentence when no member of the family settles that fast.
pub fn weights(
    chain: &Chain,
    current: f64,
    sample_time: f64,
    settling_time: f64,
) -> Result<(Vec<f64>, Vec<f64>), String> {
    if settling_time > LONGEST * sample_time {
        let longest = LONGEST * sample_time;
        return Err(format!(
            "must be at most {LONGEST} control periods, {longest} s"
        ));
    }
    let masses = chain.mass.len();
    let total: f64 = chain.mass.iter().sum();
    // A rigid drive settles in some 5 / ω; nothing sampled is faster than the samples.
    let mut omega = 1.0 / settling_time;
    let last = (50.0 / settling_time).min(0.5 / sample_time);
    let mut fastest = f64::INFINITY;
    while omega <= last {
        let q = current * (omega * omega * total / chain.force_constant).powi(2) / masses as f64;
        let index = PerformanceIndex {
            current,
            position: vec![q; masses],
            velocity: vec![q / (omega * omega); masses],
        };
        // Far from the request some members have no gain; the search goes on.
        if let Ok(Regulator { gain, .. }) = regulator(chain, &index, sample_time) {
            let settled = settles(chain, &gain, sample_time, settling_time);
            if settled <= settling_time {
                return Ok((index.position, index.velocity));
            }
            fastest = fastest.min(settled);
        }
        omega *= STEP;
    }
    let found = if fastest.is_finite() {
        format!("the fastest found settles in {fastest:.4} s")
    } else {
        "none was found that settles".into()
    };
    Err(format!(
        "equal weights on all masses do not settle this chain that fast at this sample_time ({found}); \
         cost.position and cost.velocity of their own for each mass may"
    ))
}

/// When the controlled mass enters the band around a step's target for good, s; infinite when not
/// within the horizon. Where the time asked for is many control periods, every so many are looked at.
pub(super) fn settles(
    chain: &Chain,
    gain: &RowDVector<f64>,
    sample_time: f64,
    settling_time: f64,
) -> f64 {
    let (f, g) = zero_order_hold(&chain.a(), &chain.b(), sample_time);
    let every = (settling_time / sample_time / INSTANTS).floor().max(1.0);
    let closed = (f - g * gain).pow(every as u32);
    let interval = every * sample_time;
    let controlled = 2 * controlled_mass(chain.loads());
    // Distance from the target, one unit at the start.
    let mut state =
        DVector::<f64>::from_fn(chain.states(), |i, _| if i % 2 == 0 { 1.0 } else { 0.0 });
    let samples = (HORIZON * settling_time / interval).ceil() as usize;
    let mut outside = 0;
    for k in 0..samples {
        // Written so that what is no number is outside.
        let inside = state[controlled].abs() <= SETTLING_BAND;
        if !inside {
            outside = k + 1;
        } else if state.amax() < 1e-9 {
            break;
        }
        state = &closed * state;
    }
    if outside >= samples {
        f64::INFINITY
    } else {
        outside as f64 * interval
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A very stiff chain is rigid: its weights give the gains of the double integrator in closed
    /// form, `√(Q/R)` and `√(2 M √(Q/R) / k_f + Q_v / R)`, up to the sampling.
    #[test]
    fn a_stiff_chain_gets_the_gains_of_a_rigid_drive() {
        let mut chain = Chain::of_table_1(300.0, 0.1);
        for spring in &mut chain.stiffness {
            *spring = 1e6;
        }
        let period = 2e-5;
        let (position, velocity) = weights(&chain, 1.0, period, 0.2).unwrap();
        let index = PerformanceIndex {
            current: 1.0,
            position: position.clone(),
            velocity: velocity.clone(),
        };
        let Regulator { gain, .. } = regulator(&chain, &index, period).unwrap();
        let (q, q_v): (f64, f64) = (position.iter().sum(), velocity.iter().sum());
        let (stiffness, damping): (f64, f64) = (
            gain.iter().step_by(2).sum(),
            gain.iter().skip(1).step_by(2).sum(),
        );
        let total: f64 = chain.mass.iter().sum();
        let expected = (2.0 * total * q.sqrt() / chain.force_constant + q_v).sqrt();
        assert!((stiffness / q.sqrt() - 1.0).abs() < 2e-3);
        assert!((damping / expected - 1.0).abs() < 2e-3);
        // And such a drive settles as asked for: slower weights would not.
        let settled = settles(&chain, &gain, period, 0.2);
        assert!(settled <= 0.2 && settled > 0.19, "{settled}");
    }

    #[test]
    fn faster_than_the_samples_is_refused() {
        let chain = Chain::of_table_1(300.0, 0.1);
        let error = weights(&chain, 1.0, 1e-3, 0.003).unwrap_err();
        assert!(error.contains("the fastest found settles in"), "{error}");
    }
}
