//! The laws that are compared: what of each is searched, in which box, and the law that a point stands for.
//!
//! Every variable is the logarithm of a ratio, so that no box depends on a unit. What they are ratios to:
//! frequencies to the slowest mode `ω_1`, times to its period, masses to the whole mass, forces to the
//! motor's largest `F`, position weights to that of a rigid drive of bandwidth `ω_1`,
//! `R (ω_1² M / k_f)²`, and velocity weights to that over `ω_1²`.

use super::encoder_observer::EncoderObserver;
use super::guide::Guide;
use super::pd::{DisturbanceSettings, Pd};
use super::shaper::Shaper;
use super::tune::Space;
use super::{
    Case, EncoderSettings, LawSettings, NotchSettings, PdSettings, ReferenceSettings, Tuning,
};
use crate::design::Design;
use crate::design::protection::{Healthy, Protection};
use crate::drive::Weights;
use crate::error::Result;
use crate::simulate::scenario::Scenario;
use crate::simulate::{Control, Core, FullState};
use std::f64::consts::TAU;

/// Makes the law for a plant.
pub(super) type Make<'a> = Box<dyn Fn(&Case) -> Result<Box<dyn Control + 'a>> + Sync + 'a>;

/// The law of a point in a box, and what that point says.
pub(super) type Form<'a> = Box<dyn Fn(&[f64]) -> Result<(Tuning, Make<'a>)> + Sync + 'a>;

/// A law that is tuned.
pub(super) struct Tuned<'a> {
    pub(super) name: &'static str,
    pub(super) space: Space,
    /// Whether it can remove friction, and so is tuned on the plant that has it as well.
    pub(super) removes_friction: bool,
    /// Whether it goes by a shaped reference of its own.
    pub(super) shaped: bool,
    /// What has to follow the two variables of PD for the law to be PD itself; none where it never is.
    pub(super) neutral: Option<Vec<f64>>,
    /// The law of a point.
    pub(super) form: Form<'a>,
}

/// The laws that are taken as they are designed.
pub(super) fn designed<'a>(
    design: &'a Design,
    scenario: &'a Scenario,
) -> [(&'static str, Make<'a>); 2] {
    [
        (
            "full state",
            Box::new(|_| Ok(Box::new(FullState::new(design, scenario)?))),
        ),
        (
            "drive",
            Box::new(|case| Ok(Box::new(Core::new(design, &case.plant, scenario)?))),
        ),
    ]
}

/// The laws that are tuned.
pub(super) fn tuned<'a>(design: &'a Design, scenario: &'a Scenario) -> Vec<Tuned<'a>> {
    let pd = |name, shaper, extra| tuned_pd(design, scenario, name, shaper, extra);
    vec![
        tuned_drive(design, scenario),
        tuned_encoder_filter(design, scenario),
        // The first of its kind: the others also start from what it finds.
        pd("PD", Shaper::None, Extra::None),
        pd("PD + notch", Shaper::None, Extra::Notch),
        pd("PD + observer", Shaper::None, Extra::Disturbance),
        pd("PD + ZV", Shaper::Zv, Extra::None),
        pd("PD + ZVD", Shaper::Zvd, Extra::None),
        pd("PD + EI", Shaper::Ei, Extra::None),
        pd("PD + MZV", Shaper::Mzv, Extra::None),
    ]
}

/// The slowest mode, rad/s.
pub(super) fn slowest(design: &Design) -> f64 {
    TAU * design.modes().first().map_or(1.0, |mode| mode.frequency_hz)
}

/// A box, each variable from its lower to its upper end, and starts.
fn space(ends: &[(f64, f64)], starts: &[Vec<f64>]) -> Space {
    let logarithms = |point: &Vec<f64>| point.iter().map(|x| x.ln()).collect();
    Space {
        ends: ends
            .iter()
            .map(|(low, high)| (low.ln(), high.ln()))
            .collect(),
        starts: starts.iter().map(logarithms).collect(),
    }
}

/// What a PD law has besides.
#[derive(Clone, Copy, PartialEq)]
enum Extra {
    None,
    Notch,
    Disturbance,
}

/// Bandwidth and damping of a rigid drive; with a shaper, duration of the ramps and the shaper's frequency and
/// damping; with a notch its centre, depth and width; with a disturbance observer its cutoff and mass.
fn tuned_pd<'a>(
    design: &'a Design,
    scenario: &'a Scenario,
    name: &'static str,
    shaper: Shaper,
    extra: Extra,
) -> Tuned<'a> {
    let omega = slowest(design);
    let mut ends = vec![(0.05, 10.0), (0.1, 3.0)];
    // Slow and damped; with a shaper also a stiff motor, whose load then vibrates as if it were held.
    let mut start = vec![0.35, 0.85];
    let mut stiff = Vec::new();
    let mut neutral: Vec<f64> = Vec::new();
    match extra {
        Extra::None => {}
        Extra::Notch => {
            ends.extend([(0.3, 4.0), (0.02, 1.0), (0.1, 2.0)]);
            start.extend([1.0, 0.3, 0.7]);
            neutral.extend([1.0, 0.5, 0.5]);
        }
        Extra::Disturbance => {
            ends.extend([(0.02, 10.0), (0.3, 1.5)]);
            start.extend([0.3, 0.9]);
            neutral.extend([0.02, 0.9]);
        }
    }
    if shaper != Shaper::None {
        ends.extend([(0.01, 3.0), (0.2, 100.0), (0.01, 0.9)]);
        start.extend([0.01, 0.6, 0.3]);
        stiff = vec![2.0, 0.7, 0.7, 0.7, 0.05];
        neutral.extend([0.01, 100.0, 0.3]);
    }
    let mut starts = vec![start, stiff];
    starts.retain(|start| !start.is_empty());
    let form = move |point: &[f64]| {
        let value = |i: usize| point[i].exp();
        let mut settings = PdSettings::new(design, omega * value(0), value(1));
        if shaper != Shaper::None {
            settings.reference = Some(ReferenceSettings {
                ramp: TAU / omega * value(2),
                frequency: omega * value(3),
                damping: value(4),
            });
        }
        match extra {
            Extra::None => {}
            Extra::Notch => {
                settings.notch = Some(NotchSettings {
                    centre: omega * value(2),
                    depth: value(3),
                    width: value(4),
                });
            }
            Extra::Disturbance => {
                settings.disturbance = Some(DisturbanceSettings {
                    cutoff: omega * value(2),
                    mass: design.drive.total_mass() * value(3),
                });
            }
        }
        let make: Make<'a> = Box::new(move |_: &Case| {
            let guide = if shaper == Shaper::None {
                Guide::of(design, scenario)?
            } else {
                Guide::shaped(design, settings.reference, shaper, scenario)
            };
            Ok(Box::new(Pd::new(design, settings, guide)))
        });
        Ok((Tuning::Pd(settings), make))
    };
    Tuned {
        name,
        space: space(&ends, &starts),
        removes_friction: extra == Extra::Disturbance,
        shaped: shaper != Shaper::None,
        neutral: Some(neutral.iter().map(|x| x.ln()).collect()),
        form: Box::new(form),
    }
}

/// Density of the random force on each load, over `F √T_1`, and of the disturbance's random walk, over
/// `F / √T_1`.
fn tuned_encoder_filter<'a>(design: &'a Design, scenario: &'a Scenario) -> Tuned<'a> {
    let force = design.drive.actuator.largest_force();
    let period = TAU / slowest(design);
    let form = move |point: &[f64]| {
        let settings = EncoderSettings {
            load_force: force * period.sqrt() * point[0].exp(),
            disturbance: force / period.sqrt() * point[1].exp(),
        };
        let make: Make<'a> = Box::new(move |_: &Case| {
            let guide = Guide::of(design, scenario)?;
            let law = EncoderObserver::new(design, settings, guide)?;
            Ok(Box::new(law))
        });
        Ok((Tuning::Encoder(settings), make))
    };
    Tuned {
        name: "encoder filter",
        space: space(&[(1e-5, 1.0), (1e-3, 10.0)], &[vec![7e-3, 3e-2]]),
        removes_friction: true,
        shaped: false,
        neutral: None,
        form: Box::new(form),
    }
}

/// Ends of the weights' box, over the weights of a rigid drive as slow as the slowest mode.
const WEIGHTS: (f64, f64) = (5e-5, 150.0);

/// The drive's own law: two weights for each mass, and the two densities of its observer.
fn tuned_drive<'a>(design: &'a Design, scenario: &'a Scenario) -> Tuned<'a> {
    let omega = slowest(design);
    let drive = &design.drive;
    let (current, masses) = (drive.cost.current, design.loads() + 1);
    let unit = drive.total_mass() / design.chain.force_constant;
    let position = current * (omega * omega * unit).powi(2);
    let velocity = position / (omega * omega);
    let own = |weights: &[f64], unit: f64| -> Vec<f64> {
        let floor = WEIGHTS.0;
        weights
            .iter()
            .map(|weight| (weight / unit).max(floor))
            .collect()
    };
    let observer = &drive.observer;
    let densities = [observer.load_force_ratio, observer.disturbance_rate / omega];
    // A drive that states its gain has no weights: those of a rigid drive as slow as the slowest mode then.
    let weights = design.index.as_ref().map_or_else(
        || vec![1.0; 2 * masses],
        |index| {
            [
                own(&index.position, position),
                own(&index.velocity, velocity),
            ]
            .concat()
        },
    );
    let start = [weights, densities.to_vec()].concat();
    let mut ends = vec![WEIGHTS; 2 * masses];
    ends.extend([(0.1, 1e3), (1e-2, 1e3)]);
    let form = move |point: &[f64]| {
        let value = |i: usize| point[i].exp();
        let settings = LawSettings {
            position: (0..masses).map(|mass| position * value(mass)).collect(),
            velocity: (masses..2 * masses).map(|i| velocity * value(i)).collect(),
            load_force_ratio: value(2 * masses),
            disturbance_rate: omega * value(2 * masses + 1),
        };
        let weights = Weights::Given {
            position: settings.position.clone(),
            velocity: settings.velocity.clone(),
        };
        let tuned = Design::new(&settings.put_into(&design.drive, weights))?;
        // Plans do not depend on the weights; limits do, and what machines near this one need is not looked for.
        let plans = design.plans()?;
        let widest = Protection::new(&tuned, &Healthy::widest(&tuned));
        let make: Make<'a> = Box::new(move |case: &Case| {
            let core = Core::with_plans(&tuned, plans, &widest, &case.plant, scenario)?;
            Ok(Box::new(core))
        });
        Ok((Tuning::Weights(settings), make))
    };
    Tuned {
        name: "drive, tuned",
        space: space(&ends, &[start]),
        removes_friction: drive.observer.disturbance,
        shaped: false,
        neutral: None,
        form: Box::new(form),
    }
}
