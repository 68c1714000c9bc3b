//! The closed loop in time: one experiment, its series as arrays and its figures.

use crate::arrays::{object, table};
use crate::description::plant_for;
use crate::design::sound;
use crate::errors::{DriveFault, raised, unusable};
use host_sim::design::Design;
use host_sim::drive::PlantFile;
use host_sim::error::{Error, Result};
use host_sim::simulate::corridor::Record;
use host_sim::simulate::experiment::{Experiment, require_duration};
use host_sim::simulate::metrics::Metrics;
use host_sim::simulate::scenario::{Approach, SCENARIOS, Scenario, Start};
use host_sim::simulate::sequence::MoveSequence;
use host_sim::simulate::watch::{watched, watched_moves};
use host_sim::simulate::{Law, Run as Simulated, Sample};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};

/// Longest step, m.
const LONGEST: f64 = 1e6;

/// One simulated experiment: a row of every array is a control period, ``n`` of them.
///
/// States are ``x_a v_a x_1 v_1 …`` (m, m/s; rad, rad/s of a rotary drive), so that ``run.truth[:, 0::2]`` are the
/// positions of all masses, actuator first. What only the drive's own core finds is None with the law
/// ``"full_state"``.
#[pyclass(module = "arso", frozen, get_all)]
pub(crate) struct Run {
    /// Name of the experiment: ``"fig3"``, …, ``"step"`` or ``"move"``.
    experiment: &'static str,
    /// ``"core"`` or ``"full_state"``.
    law: &'static str,
    /// (n,), start of the period, s.
    time: Py<PyArray1<f64>>,
    /// (n,), unsigned: the encoder's counter at the start of the period.
    count: Py<PyArray1<u32>>,
    /// (n, 2N+2), true state of the plant.
    truth: Py<PyArray2<f64>>,
    /// (n, 2N+2), state as the drive measures and estimates it, or None.
    estimate: Option<Py<PyArray2<f64>>>,
    /// (n,), reference of the actuator, m.
    reference: Py<PyArray1<f64>>,
    /// (n,), current commanded for the period, A.
    command: Py<PyArray1<f64>>,
    /// (n,), current applied over the period before, A.
    applied_current: Py<PyArray1<f64>>,
    /// (n,), bool: whether the current limit acted.
    limited: Py<PyArray1<bool>>,
    /// (n,), true force by which the load holds the actuator back, N.
    true_reaction_force: Py<PyArray1<f64>>,
    /// (n,), the same as the drive estimates it, eq. (18), N, or None.
    reaction_force: Option<Py<PyArray1<f64>>>,
    /// (n,), disturbance of the actuator, eq. (19), N, or None.
    disturbance: Option<Py<PyArray1<f64>>>,
    /// (n,), what the state observer takes of it for a disturbance of the actuator (friction), N, or None.
    disturbance_state: Option<Py<PyArray1<f64>>>,
    /// Figures of the run, of several moves those of the last; SI units. ``settling_time`` (s, to 2 % of the motion,
    /// and at rest at the end; None when it does not), ``within_tolerance_from`` (s), ``overshoot`` (%),
    /// ``residual_vibration`` (m peak to peak of each mass), ``peak_current`` (A), ``estimation_error`` (m rms of each
    /// mass), ``end``, ``fault``, …
    metrics: Py<PyAny>,
    /// Of planned moves a dictionary each: ``distance``, ``target`` (m), ``at`` (s), ``retargeted`` and ``metrics``.
    moves: Py<PyAny>,
}

#[pymethods]
impl Run {
    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.time.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let periods = self.__len__(py)?;
        Ok(format!(
            "<arso.Run {} by {}, {periods} control periods>",
            self.experiment, self.law
        ))
    }
}

/// A distance, or several.
#[derive(FromPyObject)]
pub(crate) enum Numbers {
    One(f64),
    Many(Vec<f64>),
}

impl From<Numbers> for Vec<f64> {
    fn from(numbers: Numbers) -> Self {
        match numbers {
            Numbers::One(number) => vec![number],
            Numbers::Many(numbers) => numbers,
        }
    }
}

/// Simulates one experiment in closed loop: the plant, and the control core of the firmware.
///
/// The interpreter is released meanwhile: several threads simulate at the same time.
///
/// Parameters
/// ----------
/// design : Design or Drive
///     A drive is designed when it is first used.
/// plant : Plant or Drive, optional
///     What is really there; the drive's own machine when not given.
/// move : float or sequence of float, optional
///     Planned moves, each by a distance from the target before, m.
/// step : float, optional
///     Raw step of the reference to a target, m.
/// experiment : str, optional
///     ``"fig3"`` to ``"fig6"`` of the paper, or ``"move"``. Give one of ``move``, ``step`` and ``experiment``.
/// at : float or sequence of float, optional
///     When each move is asked for, s, also while the one before is under way; one after the other when not given.
/// duration : float, optional
///     Length, s: 1.2 s when not given, of moves until the last has ended.
/// law : str, optional
///     ``"core"``, or ``"full_state"``: the same gain on the true state.
///
/// Returns
/// -------
/// Run
///
/// Raises
/// ------
/// ValueError
///     For an argument that cannot be used.
/// RuntimeError
///     For a design that the checks refuse, or a motion that is no longer finite.
/// DriveFault
///     When the drive stopped itself; its ``run`` has the series.
///
/// Examples
/// --------
/// >>> import arso
/// >>> run = arso.simulate(arso.Drive(), move=0.03)
/// >>> 0.05 < run.metrics["settling_time"] < 0.08
/// True
#[pyfunction]
#[pyo3(signature = (design, plant=None, *, r#move=None, step=None, experiment=None, at=None, duration=None, law="core"))]
#[allow(clippy::too_many_arguments, reason = "named in Python")]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    design: &Bound<'py, PyAny>,
    plant: Option<&Bound<'py, PyAny>>,
    r#move: Option<Numbers>,
    step: Option<f64>,
    experiment: Option<&str>,
    at: Option<Numbers>,
    duration: Option<f64>,
    law: &str,
) -> PyResult<Run> {
    let law = match law {
        "core" => Law::Core,
        "full_state" => Law::FullState,
        other => {
            let rule = "must be \"core\" or \"full_state\"";
            return Err(unusable("law", format!("\"{other}\""), rule));
        }
    };
    let design = sound(design)?;
    let plant = plant_for(plant, &design.drive)?;
    let at: Vec<f64> = at.map(Into::into).unwrap_or_default();
    if !at.is_empty() && r#move.is_none() {
        return Err(PyValueError::new_err(
            "`at` says when moves are asked for: give `move`",
        ));
    }
    let asked = match (r#move, step, experiment) {
        (Some(distances), None, None) => {
            let distances: Vec<f64> = distances.into();
            if distances.is_empty() {
                return Err(unusable("move", "[]", "must be one distance at least"));
            }
            let sequence = py.detach(|| MoveSequence::new(&design, &distances, &at));
            Asked::Moves(sequence.map_err(raised)?)
        }
        (None, Some(target), None) => Asked::Scenario(step_to(&design, target)?),
        (None, None, Some(name)) => Asked::Scenario(named(name)?),
        _ => {
            return Err(PyValueError::new_err(
                "give one of `move`, `step` and `experiment`: what is simulated",
            ));
        }
    };
    let period = design.drive.control.sample_time;
    let duration = duration.unwrap_or_else(|| asked.duration());
    require_duration(duration, period, asked.last())
        .map_err(|rule| unusable("duration", duration, rule))?;
    let (run, judged) = py
        .detach(|| asked.simulate(&design, &plant, law, duration))
        .map_err(raised)?;
    let series = made(py, &run, &judged)?;
    match run.fault {
        None => Ok(series),
        Some((time, fault)) => {
            let error = Error::Fault {
                experiment: run.scenario.name,
                time,
                number: fault.number(),
                fault: format!("{fault:?}"),
            };
            let fault = DriveFault::new_err(error.to_string());
            fault.value(py).setattr("run", Py::new(py, series)?)?;
            Err(fault)
        }
    }
}

fn step_to(design: &Design, target: f64) -> PyResult<Scenario> {
    let drive = &design.drive;
    let shortest = drive.encoder.resolution;
    if !(shortest..=LONGEST).contains(&target.abs()) {
        let unit = drive.kind.units().position;
        let rule = format!(
            "must be from a count of the encoder ({shortest:e} {unit}) to {LONGEST:e} {unit}"
        );
        return Err(unusable("step", target, rule));
    }
    Ok(Scenario {
        name: "step",
        linear_title: "raw step",
        approach: Approach::Step,
        target,
        start: Start::Origin,
    })
}

fn named(name: &str) -> PyResult<Scenario> {
    Scenario::named(name).copied().ok_or_else(|| {
        let names = SCENARIOS.map(|scenario| format!("\"{}\"", scenario.name));
        let rule = format!("must be one of {}", names.join(", "));
        unusable("experiment", format!("\"{name}\""), rule)
    })
}

/// What is simulated.
enum Asked {
    Scenario(Scenario),
    Moves(MoveSequence),
}

/// Figures of a run, and of each of its moves.
struct Figures {
    metrics: Value,
    moves: Vec<Value>,
}

impl Asked {
    /// Where none is given, s.
    fn duration(&self) -> f64 {
        match self {
            Self::Scenario(_) => Experiment::Named(&SCENARIOS[0]).duration(),
            Self::Moves(sequence) => sequence.duration(),
        }
    }

    /// When the last thing is asked for, s.
    fn last(&self) -> f64 {
        match self {
            Self::Scenario(_) => 0.0,
            Self::Moves(sequence) => {
                let last = sequence.moves().last();
                last.map_or(0.0, |last| sequence.time(last))
            }
        }
    }

    fn simulate(
        &self,
        design: &Design,
        plant: &PlantFile,
        law: Law,
        duration: f64,
    ) -> Result<(Simulated, Figures)> {
        match self {
            Self::Scenario(scenario) => {
                let (run, metrics) = watched(design, plant, scenario, law, duration)?;
                let metrics = json!(metrics);
                let moves = Vec::new();
                Ok((run, Figures { metrics, moves }))
            }
            Self::Moves(sequence) => {
                let (run, parts) = watched_moves(design, plant, sequence, law, duration)?;
                let each = sequence.moves().iter().zip(&parts);
                let moves: Vec<Value> = each
                    .map(|(one, (_, metrics))| {
                        json!({
                            "distance": one.distance,
                            "target": one.target,
                            "at": sequence.time(one),
                            "retargeted": one.retargeted,
                            "metrics": metrics,
                        })
                    })
                    .collect();
                let last: Option<&Metrics> = parts.last().map(|part| &part.1);
                let metrics = json!(last);
                Ok((run, Figures { metrics, moves }))
            }
        }
    }
}

fn made(py: Python<'_>, run: &Simulated, figures: &Figures) -> PyResult<Run> {
    let samples = &run.samples;
    let series = |value: &dyn Fn(&Sample) -> f64| {
        PyArray1::from_iter(py, samples.iter().map(value)).unbind()
    };
    // Of a run without an observer there is none.
    let found = |value: &dyn Fn(&Record) -> f32| {
        let values: Option<Vec<f64>> = samples
            .iter()
            .map(|sample| sample.record.as_ref().map(|record| value(record).into()))
            .collect();
        values.map(|values| PyArray1::from_vec(py, values).unbind())
    };
    let states = samples.first().map_or(0, |sample| sample.truth.len());
    let rows: Vec<f64> = samples
        .iter()
        .flat_map(|sample| sample.truth.iter().copied())
        .collect();
    let estimates: Vec<f64> = samples
        .iter()
        .filter_map(|sample| sample.record.as_ref())
        .flat_map(Record::columns)
        .filter(|column| column.mass.is_some())
        .map(|column| column.value)
        .collect();
    let observed = estimates.len() == rows.len();
    let shape = (samples.len(), states);
    Ok(Run {
        experiment: run.scenario.name,
        law: match run.law {
            Law::Core => "core",
            Law::FullState => "full_state",
            Law::Rival(name) => name,
        },
        time: series(&|sample| sample.time),
        count: PyArray1::from_iter(py, samples.iter().map(|sample| sample.count)).unbind(),
        truth: table(py, shape, &rows).unbind(),
        estimate: observed.then(|| table(py, shape, &estimates).unbind()),
        reference: series(&|sample| sample.reference),
        command: series(&|sample| sample.command),
        applied_current: series(&|sample| sample.applied_current),
        limited: PyArray1::from_iter(py, samples.iter().map(|sample| sample.limited)).unbind(),
        true_reaction_force: series(&|sample| sample.true_reaction_force),
        reaction_force: found(&|record| record.reaction_force),
        disturbance: found(&|record| record.disturbance),
        disturbance_state: found(&|record| record.disturbance_state),
        metrics: object(py, &figures.metrics)?.unbind(),
        moves: object(py, &Value::from(figures.moves.clone()))?.unbind(),
    })
}

/// What a record of the machine has of a run: time, count and applied current.
pub(crate) fn recorded<'py>(run: &Bound<'py, Run>) -> PyResult<Bound<'py, PyDict>> {
    let (py, run) = (run.py(), run.get());
    let record = PyDict::new(py);
    record.set_item("time", run.time.bind(py))?;
    record.set_item("count", run.count.bind(py))?;
    record.set_item("current", run.applied_current.bind(py))?;
    Ok(record)
}
