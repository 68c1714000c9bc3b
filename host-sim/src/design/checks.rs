//! Checks before a design is trusted: the paper's conditions, and what experience adds.
//!
//! Each has a value, a limit, a verdict and a sentence on what to change. `warn`: works, with less
//! margin than one would want; `refuse`: do not run this drive.

use super::Design;
use super::drive_loop::DriveLoop;
use super::margins::Margins;
use super::observer::{anchored_model, relative_motion};
use crate::error::Result;
use crate::metrics::SETTLING_BAND;
use crate::model::{eigenvalues, separation, spectral_radius};
use crate::scenario::SCENARIOS;
use arso_core::observer::Form;
use nalgebra::{Complex, DMatrix, DVector, RowDVector};
use serde::Serialize;

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Good.
    Pass,
    /// Works, with little margin.
    Warn,
    /// Must not be run.
    Refuse,
}

/// One check.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// What was checked.
    pub name: &'static str,
    /// How it came out.
    pub verdict: Verdict,
    /// The figure.
    pub value: f64,
    /// Where `warn` begins.
    pub limit: f64,
    /// What the figure means, and what to change.
    pub advice: String,
}

/// All checks of a design but those of its loop, [`closed_loop`] and [`peak_sensitivity`].
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when an eigenvalue iteration does not converge.
pub(super) fn checks(design: &Design) -> Result<Vec<Check>> {
    Ok(vec![
        riccati_residual(design),
        distinct_eigenvalues(design)?,
        observability(design)?,
        samples_per_mode(design),
        observer_samples(design)?,
        observer_speed(design)?,
        encoder_noise(design),
        current_step(design),
        commissioning_brake(design)?,
    ])
}

fn verdict(value: f64, warn_below: f64, refuse_below: f64) -> Verdict {
    // Written so that what is no number is refused.
    if value >= warn_below {
        Verdict::Pass
    } else if value >= refuse_below {
        Verdict::Warn
    } else {
        Verdict::Refuse
    }
}

/// Whether the gain solves its Riccati equation.
fn riccati_residual(design: &Design) -> Check {
    let (value, limit) = (design.riccati_residual, 1e-9);
    Check {
        name: "riccati_residual",
        // The smaller the better.
        verdict: verdict(limit / value, 1.0, 1e-3),
        value,
        limit,
        advice: "residual of the regulator's Riccati equation relative to its solution; weights \
                 that lie fewer decades apart make it smaller"
            .into(),
    }
}

/// The condition of section III, on the matrix that the chosen observer is built on.
fn distinct_eigenvalues(design: &Design) -> Result<Check> {
    let chain = &design.chain;
    let limit = 1e-6;
    let (value, advice) = match design.form() {
        Form::Anchored => {
            let loads = 2 * chain.loads();
            let anchored = chain.a().view((2, 2), (loads, loads)).into_owned();
            let value = separation(&eigenvalues(&anchored)?);
            let advice = "the free chain has a double zero (rigid motion; a single one with viscous \
                          friction), on which eq. (17) alone has no hold; the anchored observer \
                          does not estimate that motion but measures it, and its own eigenvalues, \
                          those of the loads on a held actuator, must be distinct";
            (value, advice)
        }
        Form::Reaction => {
            let advice = "eq. (17) observes the free chain, whose position as a whole makes no \
                          reaction force (a double zero of A without viscous friction): its error \
                          is never corrected and grows under any unmodelled force; use observer = \
                          \"anchored\"";
            (0.0, advice)
        }
    };
    let verdict = match design.form() {
        Form::Anchored => verdict(value, limit, 1e-12),
        Form::Reaction => Verdict::Warn,
    };
    Ok(Check {
        name: "distinct_eigenvalues",
        verdict,
        value,
        limit,
        advice: advice.into(),
    })
}

/// Popov-Belevitch-Hautus test: smallest singular value of `[λ − A; c]` over the eigenvalues of the
/// observer's model, positions in units of the first spring's stretch and time in units of the
/// slowest mode, so that the figure means the same for every drive.
fn observability(design: &Design) -> Result<Check> {
    let chain = &design.chain;
    let omega = design
        .modes()
        .first()
        .map_or(1.0, |mode| std::f64::consts::TAU * mode.frequency_hz);
    let stiffness = chain.stiffness[0];
    let (a, c) = match design.form() {
        Form::Anchored => {
            let (a, b) = anchored_model(&design.drive, chain);
            let n = b.len();
            let mut c = RowDVector::zeros(n);
            c[n - 2] = 1.0;
            (a, c)
        }
        Form::Reaction => {
            let (relative, lift) = relative_motion(chain);
            (
                &relative * chain.a() * &lift,
                chain.reaction_force() * &lift,
            )
        }
    };
    let n = a.nrows();
    let forces = if design.form() == Form::Anchored {
        3
    } else {
        0
    };
    let unit = DVector::from_fn(n, |i, _| match i {
        i if i >= n - forces => stiffness,
        i if i % 2 == 1 => omega,
        _ => 1.0,
    });
    let scaled = DMatrix::from_fn(n, n, |i, j| a[(i, j)] * unit[j] / unit[i] / omega);
    let c = RowDVector::from_fn(n, |_, j| c[j] * unit[j] / stiffness);
    let (mut value, mut worst) = (f64::INFINITY, Complex::new(0.0, 0.0));
    for pole in eigenvalues(&scaled)? {
        let mut pbh = DMatrix::<Complex<f64>>::zeros(n + 1, n);
        for i in 0..n {
            for j in 0..n {
                let diagonal = if i == j { pole } else { Complex::new(0.0, 0.0) };
                pbh[(i, j)] = diagonal - scaled[(i, j)];
            }
            pbh[(n, i)] = c[i].into();
        }
        let smallest = pbh.singular_values().min();
        if smallest < value {
            (value, worst) = (smallest, pole);
        }
    }
    let limit = 1e-3;
    let hz = worst.norm() * omega / std::f64::consts::TAU;
    let rigid = if design.form() == Form::Reaction {
        "; the rigid motion is not observable at all"
    } else {
        ""
    };
    Ok(Check {
        name: "observability",
        verdict: verdict(value, limit, 1e-9),
        value,
        limit,
        advice: format!(
            "the motion at {hz:.2} Hz is the hardest to see in the reaction force{rigid}; a stiffer \
             first spring or a less weakly coupled load shows more of it"
        ),
    })
}

/// Samples in one period of the fastest mode.
fn samples_per_mode(design: &Design) -> Check {
    let fastest = design.modes().last().map_or(0.0, |mode| mode.frequency_hz);
    let value = 1.0 / (fastest * design.drive.control.sample_time);
    let limit = 10.0;
    Check {
        name: "samples_per_fastest_mode",
        verdict: verdict(value, limit, 4.0),
        value,
        limit,
        advice: format!(
            "the fastest mode has {fastest:.1} Hz: control.sample_time below {:.2e} s samples it ten \
             times per period",
            0.1 / fastest
        ),
    }
}

/// How many times faster than the regulator's the slowest part of the estimation error decays, on the
/// discrete poles: "at least twice faster than the control system".
fn observer_speed(design: &Design) -> Result<Check> {
    let slowest = |poles: Vec<Complex<f64>>| {
        let norms = poles.iter().map(|pole| pole.norm());
        // What eq. (17) cannot correct stays at one; the check of eigenvalues tells that.
        -norms
            .filter(|norm| *norm < 1.0 - 1e-6)
            .fold(0.0, f64::max)
            .ln()
    };
    let value = slowest(design.observer_poles()?) / slowest(design.regulator_poles()?);
    let limit = design.drive.observer.speed;
    Ok(Check {
        name: "observer_speed",
        verdict: verdict(value, limit * (1.0 - 1e-6), 0.1),
        value,
        limit,
        advice: "the slowest part of the estimation error decays this many times as fast as the \
                 regulator's slowest pole; a larger observer.load_force_ratio and \
                 observer.disturbance_rate, or observer.design = \"poles\", make it faster, and the \
                 margins smaller"
            .into(),
    })
}

/// Samples in which the fastest part of the estimation error decays by 1/e.
fn observer_samples(design: &Design) -> Result<Check> {
    let poles = design.observer_poles()?;
    // Exact zeros are lags that the correction removes in one sample.
    let fastest = poles
        .iter()
        .map(|pole| pole.norm())
        .filter(|norm| *norm > 1e-9)
        .fold(1.0, f64::min);
    let value = -1.0 / f64::ln(fastest);
    let limit = 0.7;
    Ok(Check {
        name: "observer_samples",
        verdict: verdict(value, limit, 0.2),
        value,
        limit,
        advice: "the observer settles its fastest part in this many samples; below one it follows \
                 every count of noise: lower the cutoffs or shorten control.sample_time"
            .into(),
    })
}

/// Force noise of the reaction-force observer from the encoder's rounding, N rms, against the force
/// of the motor.
fn encoder_noise(design: &Design) -> Check {
    let noise = force_noise(design);
    let actuator = &design.drive.actuator;
    let limit = 0.02 * actuator.actual_force_constant() * actuator.current_limit;
    Check {
        name: "encoder_force_noise",
        // The smaller the better.
        verdict: verdict(limit / noise, 1.0, 0.1),
        value: noise,
        limit,
        advice: format!(
            "{} rms of reaction force from encoder rounding; above 2 % of the motor's force \
                 lower both cutoffs or use a finer encoder",
            design.drive.kind.units().force
        ),
    }
}

/// How far from its target the feedback lets the load stand, because half a step of the current output
/// rounds to none.
fn current_step(design: &Design) -> Check {
    let stiffness: f64 = design.regulator.iter().step_by(2).sum();
    let value = 0.5 * design.drive.actuator.current_resolution / stiffness;
    // Half of the band, on the step of the experiments.
    let step = SCENARIOS[0].target;
    let limit = 0.5 * SETTLING_BAND * step;
    let units = design.drive.kind.units();
    Check {
        name: "current_step",
        // The smaller the better.
        verdict: verdict(limit / value, 1.0, 0.0),
        value,
        limit,
        advice: format!(
            "{} from the target at which the current rounds to none, against the band of a step of {} {}: a \
             finer actuator.current_resolution or a smaller cost.current",
            units.position,
            1e3 * step,
            units.milli_position
        ),
    }
}

/// Transition of the loop closed around actuator and encoder alone: position and filtered velocity of
/// the actuator times a gain each. States: the chain, the actuator's position one sample ago, the
/// filtered velocity then.
///
/// * `position`, `velocity`: gains, A/m and A s/m
#[must_use]
pub fn collocated_loop(design: &Design, position: f64, velocity: f64) -> DMatrix<f64> {
    let control = &design.drive.control;
    let period = control.sample_time;
    let pole = (-control.disturbance_cutoff * period).exp();
    let n = design.bd.len();
    let slope = (1.0 - pole) / period;
    let mut gain = RowDVector::zeros(n + 2);
    gain[0] = -position - velocity * slope;
    gain[n] = velocity * slope;
    gain[n + 1] = -velocity * pole;
    let mut closed = DMatrix::zeros(n + 2, n + 2);
    closed.view_mut((0, 0), (n, n)).copy_from(&design.ad);
    let mut input = DVector::zeros(n + 2);
    input.rows_mut(0, n).copy_from(&design.bd);
    closed += input * gain;
    closed[(n, 0)] = 1.0;
    closed[(n + 1, 0)] = slope;
    closed[(n + 1, n)] = -slope;
    closed[(n + 1, n + 1)] = pole;
    closed
}

/// Largest pole of the loop that commissioning closes around actuator and encoder alone, as if the
/// load were rigid: with the sums of the gains.
fn commissioning_brake(design: &Design) -> Result<Check> {
    let period = design.drive.control.sample_time;
    let position: f64 = design.regulator.iter().step_by(2).sum();
    let velocity: f64 = design.regulator.iter().skip(1).step_by(2).sum();
    let closed = collocated_loop(design, position, velocity);
    let value = spectral_radius(&closed)?;
    // Settled to 2 % within the two seconds that commissioning waits.
    let limit = (-4.0 * period / 2.0).exp();
    let verdict = if value < limit {
        Verdict::Pass
    } else if value < 1.0 {
        Verdict::Warn
    } else {
        Verdict::Refuse
    };
    Ok(Check {
        name: "commissioning_brake",
        verdict,
        value,
        limit,
        advice:
            "largest pole of the loop that brakes the actuator after its signs are proven; from 1 \
                 on it does not brake: smaller cost.position and cost.velocity against \
                 cost.current, a shorter control.sample_time or a higher disturbance_cutoff"
                .into(),
    })
}

/// Largest pole of the drive's own loop, plant, force observers, state observer and gain together.
///
/// # Errors
/// [`Error::Design`](crate::error::Error::Design) when the eigenvalue iteration does not converge.
pub(super) fn closed_loop(design: &Design) -> Result<Check> {
    let closed = DriveLoop::new(design).closed(&design.ad, &design.bd);
    let value = spectral_radius(&closed)?;
    // Of eq. (17) alone the rigid motion stays in the estimate, a double one that rounding splits.
    let limit = match design.form() {
        Form::Anchored => 1.0,
        Form::Reaction => 1.0 + 1e-4,
    };
    Ok(Check {
        name: "closed_loop",
        verdict: if value < limit {
            Verdict::Pass
        } else {
            Verdict::Refuse
        },
        value,
        limit,
        advice:
            "largest pole of the drive's own loop, with its observers; from 1 on it is not stable: \
                 higher control.disturbance_cutoff and control.reaction_force_cutoff, a larger \
                 cost.current or a shorter control.sample_time"
                .into(),
    })
}

/// How far the loop stays from the brink over all frequencies.
pub(super) fn peak_sensitivity(margins: &Margins) -> Check {
    let (value, limit) = (margins.peak_sensitivity, 2.0);
    Check {
        name: "peak_sensitivity",
        // The smaller the better.
        verdict: verdict(limit / value, 1.0, 0.2),
        value,
        limit,
        advice: format!(
            "at {:.1} Hz the loop makes a disturbance this many times larger; below 2 the margins are \
             6 dB and 29 degrees at least: higher cutoffs, a larger cost.current, or a slower observer",
            margins.peak_sensitivity_hz
        ),
    }
}

/// Rounding is as good as noise, uniform over one count and different in each sample; the variance
/// behind the filter is the sum of its squared impulse response.
fn force_noise(design: &Design) -> f64 {
    let (actuator, control) = (&design.drive.actuator, &design.drive.control);
    let period = control.sample_time;
    let pole = |cutoff: f64| (-cutoff * period).exp();
    let (a_dist, a_reac) = (
        pole(control.disturbance_cutoff),
        pole(control.reaction_force_cutoff),
    );
    let (mut x_before, mut velocity, mut acceleration) = (0.0, 0.0, 0.0);
    let mut sum = 0.0;
    for k in 0..100_000 {
        let x = if k == 0 { 1.0 } else { 0.0 };
        let before = velocity;
        velocity = a_dist * velocity + (1.0 - a_dist) * (x - x_before) / period;
        x_before = x;
        acceleration = a_reac * acceleration + (1.0 - a_reac) * (velocity - before) / period;
        sum += acceleration * acceleration;
        if k > 10 && velocity.abs() < 1e-12 / period && acceleration.abs() < 1e-12 / period {
            break;
        }
    }
    actuator.mass * f64::sqrt(sum) * design.drive.encoder.resolution / f64::sqrt(12.0)
}

#[cfg(test)]
mod tests {
    use super::super::judgement::Judgement;
    use super::*;
    use crate::drive::Drive;

    fn design(change: impl FnOnce(&mut Drive)) -> Design {
        let mut drive = Drive::default_drive();
        change(&mut drive);
        Design::new(&drive).unwrap()
    }

    fn named(design: &Design, name: &str) -> Check {
        let judged = Judgement::new(design).unwrap();
        let mut checks = judged.checks.into_iter();
        checks.find(|check| check.name == name).unwrap()
    }

    /// THEORY section 3: 0.005, 0.026, 0.104 N at 1, 5, 20 um.
    #[test]
    fn force_noise_is_as_computed_elsewhere() {
        for (resolution, expected) in [(1e-6, 0.005), (5e-6, 0.026), (20e-6, 0.104)] {
            let noise = force_noise(&design(|drive| drive.encoder.resolution = resolution));
            assert!((noise - expected).abs() < 0.0006, "{noise} {expected}");
        }
    }

    #[test]
    fn the_default_drive_passes_everything() {
        for check in Judgement::new(&design(|_| ())).unwrap().checks {
            assert_eq!(check.verdict, Verdict::Pass, "{check:?}");
        }
    }

    /// What the check foretells is what happens: the same plant is commissioned or not.
    #[test]
    fn the_brake_check_foretells_commissioning() {
        use crate::corridor::corridor;
        use crate::drive::PlantFile;
        use crate::simulate::commission;
        for (current_weight, brakes) in
            [(1.0, true), (0.003, true), (0.001, false), (0.0003, false)]
        {
            let design = design(|drive| drive.cost.current = current_weight);
            let check = named(&design, "commissioning_brake");
            assert_eq!(check.verdict < Verdict::Refuse, brakes, "{check:?}");
            let plant = PlantFile::from(&design.drive);
            let mut core = corridor(&design).unwrap();
            let commissioned = commission(core.as_mut(), &plant, 1e-3);
            assert_eq!(commissioned.is_ok(), brakes, "{current_weight}");
        }
    }

    /// Slow observers make a loop unstable though gain and observer are stable: what the check says is
    /// what the core does on its own plant.
    #[test]
    fn the_loop_check_foretells_the_simulation() {
        use crate::drive::PlantFile;
        use crate::scenario::Scenario;
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
        let reaction = design(|drive| drive.control.observer = Form::Reaction);
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
}
