//! Design: from a drive to the gains its core runs with.
//!
//! ```text
//! drive -> chain -> weights -> regulator (K, eqs. (2) to (13)) -+-> Design -> Settings (f32)
//!            +----------------> observer (L, eq. (17)) ---------+            gains_file (source)
//! ```
//!
//! A drive file that states `K` itself has no weights, no Riccati equation and no gain over the time to go; all else,
//! and every other check, is of it as of any other.
//!
//! What is said of a design before it is trusted: `assessment`, made of `checks`, of the margins of
//! `drive_loop` (`loop_margins`) and of the gain over the time to go. The paper's own numbers: `paper`.

pub mod assessment;
pub mod checks;
pub mod drive_loop;
pub mod gains_file;
pub mod loop_margins;
pub mod observer;
pub mod paper;
pub mod plans;
pub(crate) mod player;
pub mod protection;
pub mod regulator;
pub mod weights;

use crate::chain::{Chain, Mode};
use crate::drive::{Drive, Weights};
use crate::error::{Error, Result};
use crate::linear::eigen::{eigenvalues, spectral_radius};
use crate::linear::zoh::zero_order_hold;
use crate::machine::{Mechanics, chain_of};
use arso_core::Settings;
use arso_core::actuator::Actuator;
use arso_core::encoder::Encoder;
use arso_core::friction::FrictionFeedForward;
use arso_core::limits::Limits;
use arso_core::observer::LinearObserver;
use arso_core::regulator::{MassGain, Regulator};
use arso_core::standstill::{FrictionLearning, Standstill};
use nalgebra::{Complex, DMatrix, DVector, RowDVector};
use std::sync::OnceLock;
use weights::PerformanceIndex;

/// Gains of a drive in `f64`, with all that led to them.
#[derive(Clone, Debug)]
pub struct Design {
    /// What was designed for; weights that were left to the design are stated here.
    pub drive: Drive,
    /// Continuous model.
    pub chain: Chain,
    /// The performance index that is least; none where the drive file states the gain itself.
    pub index: Option<PerformanceIndex>,
    /// Model over one control period, current held: `x_{k+1} = ad x_k + bd i_k`.
    pub ad: DMatrix<f64>,
    /// See `ad`.
    pub bd: DVector<f64>,
    /// Feedback gain `K`, order `x_a v_a x_1 v_1 …`, A/m and A s/m.
    pub regulator: RowDVector<f64>,
    /// Residual of the regulator's Riccati equation, relative to its solution; none where there is no such equation.
    pub riccati_residual: Option<f64>,
    /// The state observer.
    pub observer: observer::ObserverDesign,
    /// Limits of planned moves.
    pub motion: Motion,
    plans: OnceLock<plans::PlanTable>,
    healthy: OnceLock<protection::Healthy>,
}

/// Share of the velocity limit below which Coulomb friction is fed forward in part.
const SMOOTHING: f64 = 1e-3;
/// How far ahead the drive looks for where the actuator wants to move: a share of the slowest mode's period.
const INTENDED_IN: f64 = 0.16;
/// Longest that friction is worked against after arrival: periods of the slowest mode, or time constants of the
/// regulator where those are longer, and s.
const SETTLING: f64 = 8.0;
const TIME_CONSTANTS: f64 = 6.0;
const LONGEST_SETTLING: f64 = 0.8;
/// How fast the compensation follows where it follows slowly, over the slowest mode's frequency.
const FOLLOWING: f64 = 3.0;
/// How fast friction is learned from the disturbance, over the slowest mode's frequency; shares of the motor's force
/// by which it rises while the actuator stands, and the push of one that has settled, in the time for which that one
/// must stand; and the most that friction can be: share of the motor's force, and times what is declared.
const LEARNING: f64 = 1.0;
const RISING: f64 = 0.005;
const PUSHING: f64 = 0.02;
const MOST_FRICTION: (f64, f64) = (0.05, 2.0);
/// Counts within which the actuator stands, and after which share of the slowest mode's period it does.
const STANDS: f64 = 1.5;
const STOOD: f64 = 0.05;
/// Velocity at which it must not stand: a share of that of the slowest mode swinging by the tolerance.
const URGENT: f64 = 1.0;
/// Velocity at which the actuator is quiet: a share of that of the slowest mode swinging by the tolerance.
const QUIET: f64 = 0.1;

impl Design {
    /// Designs regulator and observer for a drive.
    ///
    /// # Errors
    /// [`Error::Input`] when no member of the family of weights settles as fast as the drive file asks for,
    /// [`Error::Design`] when a gain that is stated does not hold the machine, when the chain is too fast for the sample time, a Riccati equation has
    /// no stabilising solution, the result does not fit `f32`, or no weights that follow from the drive
    /// pass its checks.
    pub fn new(drive: &Drive) -> Result<Self> {
        if drive.cost.weights == Weights::Derived {
            return Self::new(&weights::derived::stated(drive)?);
        }
        let chain = chain_of(&drive.actuator, &drive.loads, drive.friction.viscous);
        let sample_time = drive.control.sample_time;
        let modes = chain.modes();
        let fastest = modes.last().map_or(0.0, |mode| mode.frequency_hz);
        if fastest * sample_time >= 0.5 {
            return Err(Error::Design(format!(
                "its fastest mode of {fastest:.1} Hz needs a sample_time below {:.3e} s",
                0.5 / fastest
            )));
        }
        let (ad, bd) = zero_order_hold(&chain.a(), &chain.b(), sample_time);
        let (index, riccati_residual, gain) =
            if let Weights::Gain { position, velocity } = &drive.cost.weights {
                (None, None, regulator::of_masses(position, velocity))
            } else {
                let index = PerformanceIndex::new(&drive.cost, &chain, sample_time)?;
                let found = regulator::regulator(&chain, &index, sample_time)?;
                (Some(index), Some(found.residual), found.gain)
            };
        let closed = &ad - &bd * &gain;
        require_stable("the regulator", &closed)?;
        let decay = decay(&eigenvalues(&closed)?, sample_time);
        let observer = observer::variant(drive.control.observer).design(drive, &chain, decay)?;
        let design = Self {
            drive: drive.clone(),
            regulator: gain,
            riccati_residual,
            observer,
            index,
            motion: Motion::new(drive, &chain, &modes, decay),
            plans: OnceLock::new(),
            healthy: OnceLock::new(),
            chain,
            ad,
            bd,
        };
        design.require_f32()?;
        Ok(design)
    }

    /// The flexible modes of the chain.
    #[must_use]
    pub fn modes(&self) -> Vec<Mode> {
        self.chain.modes()
    }

    /// `ad`, `bd` of a chain in the place of the design's own, with what makes the force of the drive come late:
    /// its memory stands behind the states of the chain.
    #[must_use]
    pub fn sampled(&self, chain: &Chain) -> (DMatrix<f64>, DVector<f64>) {
        let actuator = &self.drive.actuator;
        let mechanics = Mechanics {
            delay: actuator.delay,
            lag: actuator.lag,
            ..Mechanics::of_chain(chain, 0.0)
        };
        mechanics.sampled(self.drive.control.sample_time)
    }

    /// Poles of the sampled full-state loop, `eig(ad − bd K)`.
    ///
    /// # Errors
    /// [`Error::Design`] when they cannot be computed.
    pub fn regulator_poles(&self) -> Result<Vec<Complex<f64>>> {
        Ok(eigenvalues(&(&self.ad - &self.bd * &self.regulator))?)
    }

    /// How fast the slowest of them decays, 1/s.
    ///
    /// # Errors
    /// [`Error::Design`] when they cannot be computed.
    pub fn regulator_decay(&self) -> Result<f64> {
        Ok(decay(
            &self.regulator_poles()?,
            self.drive.control.sample_time,
        ))
    }

    /// Poles of the estimation error, `eig((1 − L c) F)`.
    ///
    /// # Errors
    /// [`Error::Design`] when they cannot be computed.
    pub fn observer_poles(&self) -> Result<Vec<Complex<f64>>> {
        Ok(eigenvalues(&self.observer.error_transition())?)
    }

    /// All that the core must know, as it takes it.
    ///
    /// * `observer`: how the core makes the observer of this design from its coefficients
    /// * `protection`: limits of the running drive, its own or wider ones
    ///
    /// `N` and `S` must be those of the design; with any others the core's [`Settings::check`] refuses.
    #[must_use]
    pub fn settings<const N: usize, const S: usize, O>(
        &self,
        observer: impl FnOnce(LinearObserver<S>) -> O,
        protection: &protection::Protection,
    ) -> Settings<N, O> {
        let drive = &self.drive;
        let mass_gain = |mass: usize| MassGain {
            position: self.regulator[2 * mass] as f32,
            velocity: self.regulator[2 * mass + 1] as f32,
        };
        Settings {
            sample_time: drive.control.sample_time as f32,
            encoder: self.encoder(),
            actuator: self.actuator(),
            amplifier: drive.actuator.amplifier(),
            disturbance_cutoff: drive.control.disturbance_cutoff as f32,
            reaction_force_cutoff: drive.control.reaction_force_cutoff as f32,
            observer: observer(self.coefficients()),
            regulator: Regulator {
                actuator: mass_gain(0),
                loads: std::array::from_fn(|load| mass_gain(load + 1)),
            },
            limits: self.limits(),
            total_mass: drive.total_mass() as f32,
            friction: self.friction(),
            standstill: self.standstill(),
            holding_force: drive.actuator.holding_force as f32,
            protection: protection.limits(drive.encoder.resolution),
        }
    }

    /// Limits of the running drive.
    #[must_use]
    pub fn protection(&self) -> protection::Protection {
        let healthy = self.healthy.get_or_init(|| protection::Healthy::new(self));
        protection::Protection::new(self, healthy)
    }

    /// Coefficients of the state observer as the core takes them.
    pub(crate) fn coefficients<const S: usize>(&self) -> LinearObserver<S> {
        let observer = &self.observer;
        let row = |values: &[f64]| -> [f32; S] {
            std::array::from_fn(|i| values.get(i).map_or(f32::NAN, |value| *value as f32))
        };
        let rows = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let value = observer.transition.get((i, j));
                let unmoved = f64::from(u8::from(i == j));
                value.map_or(f32::NAN, |value| (*value - unmoved) as f32)
            })
        });
        LinearObserver::new(
            rows,
            row(observer.input.as_slice()),
            row(observer.output.as_slice()),
            row(observer.correction.as_slice()),
        )
    }

    /// The encoder as the core takes it.
    #[must_use]
    pub fn encoder(&self) -> Encoder {
        Encoder {
            resolution: self.drive.encoder.resolution as f32,
            counter_bits: self.drive.encoder.counter_bits,
        }
    }

    /// The actuator as the core takes it.
    #[must_use]
    pub fn actuator(&self) -> Actuator {
        let actuator = &self.drive.actuator;
        Actuator {
            mass: actuator.mass as f32,
            force_constant: actuator.force_constant as f32,
            mass_deviation: actuator.mass_deviation as f32,
            force_constant_deviation: actuator.force_constant_deviation as f32,
        }
    }

    /// Limits of the command as the core takes them.
    #[must_use]
    pub fn limits(&self) -> Limits {
        Limits {
            current_limit: self.drive.actuator.current_limit as f32,
            current_resolution: self.drive.actuator.current_resolution as f32,
        }
    }

    /// Friction that is fed forward, as the core takes it.
    #[must_use]
    pub fn friction(&self) -> FrictionFeedForward {
        let friction = &self.drive.friction;
        FrictionFeedForward {
            coulomb: friction.coulomb as f32,
            viscous: self.drive.viscous() as f32,
            smoothing: (SMOOTHING * self.motion.velocity) as f32,
        }
    }

    /// The rule for rest, as the core takes it. Its constants were chosen by measurement, on plants near the
    /// default drive with friction.
    #[must_use]
    pub fn standstill<const N: usize>(&self) -> Standstill<N> {
        let period = self.drive.control.sample_time;
        let slowest = self
            .modes()
            .first()
            .map_or(period, |mode| 1.0 / mode.frequency_hz);
        let periods = |time: f64| (time / period).round() as u32;
        // −(v + τ dv/dt) of the true state under its own feedback.
        let acceleration = self.chain.a().row(1) - self.chain.b()[1] * &self.regulator;
        let mut intention = -INTENDED_IN * slowest * acceleration;
        intention[1] -= 1.0;
        let mass_gain = |mass: usize| MassGain {
            position: intention[2 * mass] as f32,
            velocity: intention[2 * mass + 1] as f32,
        };
        let tolerance = self.motion.settling_tolerance;
        let force = self.drive.actuator.largest_force();
        let rise = force * period / self.motion.standing;
        let swing = tolerance * std::f64::consts::TAU / slowest;
        Standstill {
            tolerance: tolerance as f32,
            settling: periods(self.motion.settling),
            quiet: periods(slowest),
            least_velocity: (QUIET * swing) as f32,
            intention: Regulator {
                actuator: mass_gain(0),
                loads: std::array::from_fn(|load| mass_gain(load + 1)),
            },
            rate: (FOLLOWING * period / slowest.max(FOLLOWING * period)) as f32,
            urgent: (URGENT * swing) as f32,
            averaging: (period / slowest).min(1.0) as f32,
            learning: FrictionLearning {
                gain: (LEARNING * period / slowest).min(1.0) as f32,
                rise: (RISING * rise) as f32,
                push: (PUSHING * rise) as f32,
                most: self.motion.most_friction as f32,
                stands: (STANDS * self.drive.encoder.resolution) as f32,
                patience: periods(STOOD * slowest),
                standing: periods(self.motion.standing),
            },
        }
    }

    /// The planned moves; made when first asked for.
    ///
    /// # Errors
    /// [`Error::Design`] when there are none within the limits of the drive file.
    pub fn plans(&self) -> Result<&plans::PlanTable> {
        if let Some(table) = self.plans.get() {
            return Ok(table);
        }
        let table = plans::plan_table(self)?;
        Ok(self.plans.get_or_init(|| table))
    }

    /// The same with the plans of another design for the same machine under the same limits, where that has made them:
    /// they do not depend on gain and observer.
    #[must_use]
    pub(crate) fn with_plans_of(self, other: &Self) -> Self {
        Self {
            plans: other.plans.clone(),
            ..self
        }
    }

    /// Number of load masses `N`.
    #[must_use]
    pub fn loads(&self) -> usize {
        self.chain.loads()
    }

    /// What is to be known of the observer that was designed.
    pub(crate) fn observer_variant(&self) -> &'static dyn observer::Variant {
        observer::variant(self.drive.control.observer)
    }

    fn require_f32(&self) -> Result<()> {
        let observer = &self.observer;
        let vectors = [&observer.input, &observer.correction];
        let values = observer.transition.iter().chain(self.regulator.iter());
        let values = values.chain(observer.output.iter());
        let mut values = values.chain(vectors.into_iter().flat_map(|v| v.iter()));
        if values.all(|value| (*value as f32).is_finite()) {
            Ok(())
        } else {
            Err(Error::Design(
                "its gains exceed what the drive can hold (f32)".into(),
            ))
        }
    }
}

/// Limits of planned moves, and what they leave to be fed forward and held.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Velocity of the actuator, m/s.
    pub velocity: f64,
    /// Velocity that the drive's own force suggests, m/s.
    pub natural_velocity: f64,
    /// m/s²; none unless stated.
    pub acceleration: Option<f64>,
    /// m/s³; none unless stated.
    pub jerk: Option<f64>,
    /// Of each spring, m; none unless stated.
    pub deflection: Option<Vec<f64>>,
    /// Share of the current limit that plans may use.
    pub current_share: f64,
    /// Bytes of the table.
    pub table: usize,
    /// How far from its target the actuator may come to rest, m.
    pub settling_tolerance: f64,
    /// Longest that it may take to settle after its reference has come to rest, s.
    pub settling: f64,
    /// How long the actuator must have stood after that to be pushed, s.
    pub standing: f64,
    /// Most that Coulomb friction can be, N.
    pub most_friction: f64,
}

/// Settling tolerance where none is stated, m: 50 um, or 5 counts where those are more.
#[must_use]
pub fn settling_tolerance(resolution: f64) -> f64 {
    const TOLERANCE: (f64, f64) = (50e-6, 5.0);
    TOLERANCE.0.max(TOLERANCE.1 * resolution)
}

impl Motion {
    const CURRENT_SHARE: f64 = 0.97;
    const TABLE: usize = 65536;
    /// Control periods in which the velocity limit is reached at the least, where a mode is faster.
    const PERIODS: f64 = 100.0;

    /// What the drive file leaves open follows from the drive. The velocity: what half the current gives the
    /// whole chain in one period of the slowest mode, or in 100 control periods, as far as the encoder's
    /// counter can follow.
    ///
    /// * `decay`: of the regulator's slowest pole, 1/s
    fn new(drive: &Drive, chain: &Chain, modes: &[Mode], decay: f64) -> Self {
        let stated = &drive.motion;
        let sample_time = drive.control.sample_time;
        let slowest = modes.first().map_or(0.0, |mode| 1.0 / mode.frequency_hz);
        let force = chain.force_constant * drive.actuator.current_limit;
        let acceleration = 0.5 * force / drive.total_mass();
        let natural_velocity = acceleration * slowest.max(Self::PERIODS * sample_time);
        let resolution = drive.encoder.resolution;
        let seen =
            0.5 * checks::quarter_of_range(drive.encoder.counter_bits) * resolution / sample_time;
        Self {
            velocity: stated.velocity.unwrap_or(natural_velocity.min(seen)),
            natural_velocity,
            acceleration: stated.acceleration,
            jerk: stated.jerk,
            deflection: stated.deflection.clone(),
            current_share: stated.current_share.unwrap_or(Self::CURRENT_SHARE),
            table: stated.table.unwrap_or(Self::TABLE),
            settling_tolerance: stated
                .settling_tolerance
                .unwrap_or_else(|| settling_tolerance(resolution)),
            settling: (SETTLING * slowest)
                .max(TIME_CONSTANTS / decay)
                .min(LONGEST_SETTLING),
            standing: slowest.max(1.0 / decay),
            most_friction: (MOST_FRICTION.0 * force).max(MOST_FRICTION.1 * drive.friction.coulomb),
        }
    }
}

/// Decay of the slowest of some discrete poles, 1/s.
fn decay(poles: &[Complex<f64>], sample_time: f64) -> f64 {
    let slowest = poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
    -slowest.ln() / sample_time
}

fn require_stable(what: &str, matrix: &DMatrix<f64>) -> Result<()> {
    let radius = spectral_radius(matrix)?;
    if radius < 1.0 {
        Ok(())
    } else {
        Err(Error::Design(format!(
            "{what} is not stable (largest pole {radius:.6})"
        )))
    }
}
