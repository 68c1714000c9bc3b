//! How far a load is from what the drive file says, from the record of one move: cheap enough for every move.
//!
//! ```text
//! record --filter of the drive file's machine, noise held--> innovations, least by friction alone
//!        --the same filter, springs and last mass free-----> how much of what has changed
//!        --the same filter, everything free----------------> the least there is
//! ```
//!
//! The filter follows what is slower than the load and explains nothing else as noise, so that an error of the
//! load stays an error. Friction and damping are fitted in all three: they change from day to day, and are no
//! change of the load. What is left is held against what springs that are a little off would do to the same
//! move: a long move of a fine encoder shows the smallest difference, and is no reason to learn.

use super::least_squares::fit;
use super::predict::{Gain, predict};
use super::{Experiment, Log, Parameters, Quantity, Residuals};
use crate::drive::Drive;
use crate::error::{Error, Result};

/// Rows of the record that are looked at.
const ROWS: usize = 3000;
/// Where the search for the springs begins, as logarithms of their factor.
const STARTS: [f64; 3] = [0.0, -0.3, 0.3];
/// Tolerance of the fits, and evaluations per coordinate after which one is given up.
const FIT: (f64, usize) = (1e-3, 6);
/// Width of the difference by which innovations follow the springs.
const WIDTH: f64 = 0.01;
/// How far off the load counts as changed, as if all springs were off by that: planned moves allow for 2 %, and one
/// inner mass that is 30 % off may look like 4 %.
const CHANGED: f64 = 0.02;
/// Times the least error at which it can count as changed at all.
const ABOVE_LEAST: f64 = 1.2;
/// Share of the excess error that springs and last mass must explain to be named.
const EXPLAINED: f64 = 0.5;

/// What a move says of the load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Root mean square of the prediction errors of the drive file's machine, counts.
    pub error_rms: f64,
    /// The same over that of the machine which predicts this move best.
    pub times_least: f64,
    /// As far off as if all springs were off by this share.
    pub size: f64,
    /// Change of all springs that explains the move best, relative.
    pub stiffness: f64,
    /// Change of the last load's mass beside it, relative.
    pub last_mass: f64,
    /// Whether these two explain the most of it.
    pub explained: bool,
}

impl Drift {
    /// Whether the drive file should be learned again.
    #[must_use]
    pub fn changed(&self) -> bool {
        self.size > CHANGED && self.times_least > ABOVE_LEAST
    }
}

/// Coordinates that vary together, and by what they begin.
type Directions = Vec<(Vec<usize>, f64)>;

/// How far the load is from what the drive file says.
///
/// # Errors
/// [`Error::Identification`] where the machine of the drive file has no filter, and where a changed load would not
/// show in the record.
pub fn drift(drive: &Drive, log: &Log) -> Result<Drift> {
    let log = &log.beginning(ROWS);
    let hold = ["actuator.force_constant".to_owned()];
    let parameters = Parameters::new(drive, Experiment::Excitation, &hold)?;
    let start = parameters.start();
    let nominal = parameters.coordinates(start);
    let noise = Residuals::new(std::slice::from_ref(log), &parameters).held;
    let gain = Gain::new(log, start, noise, parameters.force());
    let gain = gain.ok_or_else(|| {
        Error::Identification("the drive file's machine has no filter for this record".into())
    })?;
    let errors = |x: &[f64]| {
        let found = predict(log, &parameters.machine(x), &gain);
        found.map_or_else(|| vec![1e6; log.current.len()], |found| found.innovations)
    };
    // From some coordinates along some directions: where to, and with which mean square.
    let search = |from: &[f64], directions: &Directions| {
        let at = |y: &[f64]| {
            let mut x = from.to_vec();
            for ((members, _), y) in directions.iter().zip(y) {
                for member in members {
                    x[*member] += y;
                }
            }
            x
        };
        let residuals = |y: &[f64]| {
            let mut residuals = errors(&at(y));
            residuals.extend(y);
            Some(residuals)
        };
        let begin: Vec<f64> = directions.iter().map(|direction| direction.1).collect();
        let x = at(&fit(&residuals, &begin, FIT.0, FIT.1).coordinates);
        let square = mean_square(&errors(&x));
        (x, square)
    };

    let free: Vec<Quantity> = parameters.free().collect();
    let those = |is: &dyn Fn(&Quantity) -> bool| -> Vec<usize> {
        let numbered = free.iter().enumerate().filter(|(_, quantity)| is(quantity));
        numbered.map(|(number, _)| number).collect()
    };
    let alone = |members: Vec<usize>| members.into_iter().map(|member| (vec![member], 0.0));
    let springs = those(&|quantity| matches!(quantity, Quantity::Stiffness(_)));
    let last = drive.loads.len() - 1;
    let last_mass = those(&|quantity| *quantity == Quantity::Mass(last));
    let mut of_no_load: Directions = alone(those(&is_friction)).collect();
    of_no_load.push((
        those(&|quantity| matches!(quantity, Quantity::Damping(_))),
        0.0,
    ));
    let (described, described_square) = search(&nominal, &of_no_load);
    let by_two = STARTS.map(|begin| {
        let mut directions = of_no_load.clone();
        directions.push((springs.clone(), begin));
        directions.push((last_mass.clone(), 0.0));
        search(&nominal, &directions)
    });
    let [first, others @ ..] = by_two;
    let (two, two_square) =
        others.into_iter().fold(
            first,
            |best, other| if other.1 < best.1 { other } else { best },
        );
    let all = alone(those(&|quantity| {
        is_friction(quantity) || quantity.positive()
    }))
    .collect();
    let least = search(&two, &all).1.min(two_square).min(described_square);

    let moved = |by: f64| {
        let mut x = described.clone();
        for spring in &springs {
            x[*spring] += by;
        }
        errors(&x)
    };
    let slopes = moved(WIDTH).into_iter().zip(moved(-WIDTH));
    let slopes: Vec<f64> = slopes.map(|(a, b)| (a - b) / (2.0 * WIDTH)).collect();
    let change = |members: &[usize]| {
        let change = members
            .first()
            .map_or(0.0, |first| two[*first] - nominal[*first]);
        change.exp() - 1.0
    };
    let found = Drift {
        error_rms: described_square.sqrt(),
        times_least: (described_square / least).sqrt(),
        size: ((described_square - least) / mean_square(&slopes)).sqrt(),
        stiffness: change(&springs),
        last_mass: change(&last_mass),
        explained: described_square - two_square >= EXPLAINED * (described_square - least),
    };
    // Nothing seen is nothing wrong only where it would be seen.
    let visible = CHANGED * mean_square(&slopes).sqrt();
    if !found.changed() && visible < least.sqrt() {
        return Err(Error::Identification(
            "the motion is too small or too slow to show a changed load".into(),
        ));
    }
    Ok(found)
}

fn is_friction(quantity: &Quantity) -> bool {
    matches!(
        quantity,
        Quantity::Viscous
            | Quantity::Coulomb
            | Quantity::CoulombBackward
            | Quantity::Static
            | Quantity::LoadViscous(_)
            | Quantity::LoadCoulomb(_)
    )
}

fn mean_square(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64
}
