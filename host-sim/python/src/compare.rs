//! The drive beside its rivals, and beside what is possible at all.

use crate::arrays::object;
use crate::description::{Drive, plant_for};
use crate::design::{or_default, sound};
use crate::errors::{raised, unusable};
use host_sim::compare::{Effort, bounds, compare as compared, require_comparable};
use host_sim::error::Error;
use host_sim::report;
use host_sim::simulate::bound::step_bound;
use pyo3::prelude::*;

/// Fewest and most evaluations, and most plants.
const EVALUATIONS: (usize, usize) = (20, 1_000_000);
const PLANTS: usize = 100_000;

/// Sets the drive beside its rivals, tuned in the same run with the same number of evaluations, on plants that
/// differ from it: PD alone, with notch, disturbance observer and input shapers, a Kalman filter on the encoder, the
/// drive with other weights, and its gain on the true state. Takes minutes with the usual effort; the interpreter is
/// released meanwhile, and Ctrl-C is seen at the end.
///
/// Parameters
/// ----------
/// design : Design or Drive
/// evaluations : int, optional
///     For each law that is tuned.
/// plants : int, optional
///     How many are drawn at random.
/// progress : callable, optional
///     Called as ``progress(done, of, what)``.
///
/// Returns
/// -------
/// dict
///     ``bounds``: least times of the named plants, s; ``laws`` and ``moves``: by raw steps and by planned moves, a
///     dictionary for each law with ``law``, ``tuning``, ``outcomes`` (a dictionary for each named plant with
///     ``case``, ``metrics`` as of :attr:`Run.metrics`, ``times_bound``) and ``held_out`` (over the plants drawn).
///
/// Raises
/// ------
/// ValueError
///     For an argument that cannot be used.
/// RuntimeError
///     For a design that the checks refuse, or that cannot be compared.
#[pyfunction]
#[allow(clippy::needless_pass_by_value, reason = "what Python hands over")]
#[pyo3(signature = (design, *, evaluations=1200, plants=50, progress=None))]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    design: &Bound<'py, PyAny>,
    evaluations: usize,
    plants: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (fewest, most) = EVALUATIONS;
    if !(fewest..=most).contains(&evaluations) {
        let rule = format!("must be from {fewest} to {most}");
        return Err(unusable("evaluations", evaluations, rule));
    }
    if plants > PLANTS {
        return Err(unusable(
            "plants",
            plants,
            format!("must be {PLANTS} at most"),
        ));
    }
    let design = sound(design)?;
    let effort = Effort {
        evaluations,
        plants,
    };
    let found = py.detach(|| {
        require_comparable(&design)?;
        let found = compared(&design, effort, &|done, of, what| {
            if let Some(progress) = &progress {
                // What fails in it is said, and stops nothing.
                Python::attach(|py| {
                    if let Err(error) = progress.call1(py, (done, of, what)) {
                        error.write_unraisable(py, Some(progress.bind(py)));
                    }
                });
            }
        })?;
        Ok::<_, Error>(report::comparison::json(&design, &found, &bounds(&design)))
    });
    object(py, &found.map_err(raised)?)
}

/// The least time in which any control could make a step from rest, whatever it knows: by linear programmes,
/// without friction and forces from outside.
///
/// Parameters
/// ----------
/// drive : Drive, optional
///     Its current limit and control period hold; the drive of the paper when not given.
/// plant : Plant or Drive, optional
///     What is really there; the drive's own machine when not given.
/// distance : float, optional
///     m.
///
/// Returns
/// -------
/// dict
///     ``settled``: until the controlled mass stays within 2 %, s; ``rest``: until all masses are at rest, s;
///     ``current_limit``, A; ``hold``: control periods over which the current was held, above 1 for upper estimates.
///
/// Raises
/// ------
/// ValueError
///     For an argument that cannot be used.
/// RuntimeError
///     When none is found.
#[pyfunction]
#[pyo3(signature = (drive=None, plant=None, *, distance=0.03))]
pub(crate) fn bound<'py>(
    py: Python<'py>,
    drive: Option<Bound<'py, Drive>>,
    plant: Option<&Bound<'py, PyAny>>,
    distance: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let drive = or_default(py, drive)?;
    let drive = &drive.get().drive;
    let plant = plant_for(plant, drive)?;
    let found = py
        .detach(|| step_bound(drive, &plant, distance))
        .map_err(raised)?;
    object(py, &report::bound::json(drive, &plant, distance, &found))
}
