//! The control core behind one interface, whatever the number of loads and the observer.
//!
//! The core is generic over sizes that a drive file chooses at run time; here each combination
//! is instantiated once and hidden behind [`Corridor`]. What runs is the core of the firmware,
//! `f32` and all.

use crate::design::{Design, gains_file};
use crate::drive::MAX_LOADS;
use arso_core::observer::Form;
use arso_core::{Command, Controller, GainsError, Measurement, Request, State, Telemetry};

/// A control core of any size.
pub trait Corridor {
    /// See [`Controller::request`].
    fn request(&mut self, request: Request);
    /// See [`Controller::step`].
    fn step(&mut self, measurement: Measurement) -> Command;
    /// What the last step found.
    fn record(&self) -> Record;
}

/// A telemetry record of any size, see [`Telemetry`].
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// State of the drive.
    pub state: State,
    /// m
    pub reference: f64,
    /// N
    pub disturbance: f64,
    /// N
    pub reaction_force: f64,
    /// N
    pub disturbance_state: f64,
    /// Estimated state `x_a v_a x_1 v_1 …`, m and m/s.
    pub estimate: Vec<f64>,
}

impl<const N: usize> From<&Telemetry<N>> for Record {
    fn from(telemetry: &Telemetry<N>) -> Self {
        let mut estimate = vec![f64::from(telemetry.position), f64::from(telemetry.velocity)];
        let loads = telemetry.load_position.iter().zip(&telemetry.load_velocity);
        estimate.extend(loads.flat_map(|(x, v)| [f64::from(*x), f64::from(*v)]));
        Self {
            state: telemetry.state,
            reference: telemetry.reference.into(),
            disturbance: telemetry.disturbance.into(),
            reaction_force: telemetry.reaction_force.into(),
            disturbance_state: telemetry.disturbance_state.into(),
            estimate,
        }
    }
}

impl<const N: usize, const S: usize> Corridor for Controller<N, S> {
    fn request(&mut self, request: Request) {
        Controller::request(self, request);
    }

    fn step(&mut self, measurement: Measurement) -> Command {
        Controller::step(self, measurement)
    }

    fn record(&self) -> Record {
        self.telemetry().into()
    }
}

/// Calls `$function::<N, S>($arguments)` with the sizes of a design.
macro_rules! with_sizes {
    ($design:expr, $function:ident ( $($argument:expr),* )) => {
        match ($design.form(), $design.loads()) {
            (Form::Anchored, 1) => $function::<1, 5>($($argument),*),
            (Form::Anchored, 2) => $function::<2, 7>($($argument),*),
            (Form::Anchored, 3) => $function::<3, 9>($($argument),*),
            (Form::Anchored, 4) => $function::<4, 11>($($argument),*),
            (Form::Anchored, 5) => $function::<5, 13>($($argument),*),
            (Form::Anchored, 6) => $function::<6, 15>($($argument),*),
            (Form::Reaction, 1) => $function::<1, 4>($($argument),*),
            (Form::Reaction, 2) => $function::<2, 6>($($argument),*),
            (Form::Reaction, 3) => $function::<3, 8>($($argument),*),
            (Form::Reaction, 4) => $function::<4, 10>($($argument),*),
            (Form::Reaction, 5) => $function::<5, 12>($($argument),*),
            (Form::Reaction, 6) => $function::<6, 14>($($argument),*),
            (_, loads) => unreachable!("a drive has 1 to {MAX_LOADS} loads, not {loads}"),
        }
    };
}

/// The core with a design's gains.
///
/// # Errors
/// When the core refuses the gains.
pub fn corridor(design: &Design) -> Result<Box<dyn Corridor>, GainsError> {
    fn build<const N: usize, const S: usize>(
        design: &Design,
    ) -> Result<Box<dyn Corridor>, GainsError> {
        Ok(Box::new(Controller::<N, S>::new(&design.gains())?))
    }
    with_sizes!(design, build(design))
}

/// The gains file for the firmware; `origin` says where the drive was described.
#[must_use]
pub fn gains_source(design: &Design, origin: &str) -> String {
    use gains_file::source;
    with_sizes!(design, source(design, origin))
}
