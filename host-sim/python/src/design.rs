//! Gains, poles, checks and margins of a drive.

use crate::arrays::{matrix, object, poles};
use crate::description::Drive;
use crate::errors::{no_such, raised};
use host_sim::design::Design as Designed;
use host_sim::design::assessment::Assessment;
use host_sim::design::drive_loop::{Compensation, DriveLoop};
use host_sim::error::Error;
use host_sim::report;
use host_sim::simulate::stillness::stillness;
use numpy::{Complex64, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::{Value, json};
use std::sync::{Arc, OnceLock};

/// Regulator and observer of a drive, as :func:`design` makes them.
///
/// States are ``x_a v_a x_1 v_1 …`` (m, m/s), actuator first, ``n = 2N + 2`` of them with ``N`` loads; models are
/// sampled with the control period, the current held.
#[pyclass(module = "arso", frozen)]
pub(crate) struct Design {
    drive: Py<Drive>,
    design: Arc<Designed>,
    assessment: OnceLock<Assessment>,
    report: OnceLock<Value>,
}

impl Design {
    fn of(drive: &Bound<'_, Drive>) -> PyResult<Self> {
        Ok(Self {
            design: drive.get().design(drive.py())?,
            drive: drive.clone().unbind(),
            assessment: OnceLock::new(),
            report: OnceLock::new(),
        })
    }

    /// Checks, margins and the gain over the time to go, made when first asked for.
    fn assessment(&self, py: Python<'_>) -> PyResult<&Assessment> {
        if let Some(made) = self.assessment.get() {
            return Ok(made);
        }
        let made = py.detach(|| {
            let mut made = Assessment::new(&self.design)?;
            if made.require_sound().is_ok() {
                made.checks.push(stillness(&self.design)?);
            }
            Ok::<_, Error>(made)
        });
        let made = made.map_err(raised)?;
        Ok(self.assessment.get_or_init(|| made))
    }

    /// A part of the assessment.
    fn assessed<'py>(
        &self,
        py: Python<'py>,
        part: impl Fn(&Assessment) -> Value,
    ) -> PyResult<Bound<'py, PyAny>> {
        object(py, &part(self.assessment(py)?))
    }

    /// A part of what `host-sim design --json` says, made when first asked for.
    fn said<'py>(&self, py: Python<'py>, part: &str) -> PyResult<Bound<'py, PyAny>> {
        if let Some(made) = self.report.get() {
            return object(py, &made[part]);
        }
        let assessment = self.assessment(py)?;
        let made = py
            .detach(|| report::design::json(&self.design, assessment))
            .map_err(raised)?;
        object(py, &self.report.get_or_init(|| made)[part])
    }
}

/// Designs regulator and observer of a drive.
///
/// Parameters
/// ----------
/// drive : Drive, optional
///     The drive of the paper when not given.
///
/// Returns
/// -------
/// Design
///     Also one that the checks refuse: see :attr:`Design.checks` and :meth:`Design.require_sound`.
///
/// Raises
/// ------
/// RuntimeError
///     When there are no gains for it.
///
/// Examples
/// --------
/// >>> import arso
/// >>> arso.design(arso.Drive()).k.shape
/// (8,)
#[pyfunction]
#[pyo3(signature = (drive=None))]
pub(crate) fn design(py: Python<'_>, drive: Option<Bound<'_, Drive>>) -> PyResult<Design> {
    Design::of(&or_default(py, drive)?)
}

/// The drive that was given, or that of the paper.
pub(crate) fn or_default<'py>(
    py: Python<'py>,
    drive: Option<Bound<'py, Drive>>,
) -> PyResult<Bound<'py, Drive>> {
    match drive {
        Some(drive) => Ok(drive),
        None => py
            .get_type::<Drive>()
            .call0()?
            .cast_into()
            .map_err(Into::into),
    }
}

#[pymethods]
impl Design {
    /// What was designed for.
    #[getter]
    fn drive(&self, py: Python<'_>) -> Py<Drive> {
        self.drive.clone_ref(py)
    }

    /// Control period, s.
    #[getter]
    fn sample_time(&self) -> f64 {
        self.design.drive.control.sample_time
    }

    /// (n, n), ``a`` of the continuous model ``dx/dt = a x + b i``.
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.design.chain.a())
    }

    /// (n,), ``b`` of the continuous model, per A.
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.design.chain.b().as_slice())
    }

    /// (n, n), ``ad`` of the sampled model ``x[k+1] = ad x[k] + bd i[k]``.
    #[getter]
    fn ad<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.design.ad)
    }

    /// (n,), ``bd`` of the sampled model, per A.
    #[getter]
    fn bd<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.design.bd.as_slice())
    }

    /// (n,), gain of the regulator ``i = -k (x - x_ref)``, A/m and A s/m.
    #[getter]
    fn k<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.design.regulator.as_slice())
    }

    /// (n,), complex: discrete poles of the loop with the true state fed back, ``eig(ad - bd k)``.
    #[getter]
    fn poles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        Ok(poles(py, &self.design.regulator_poles().map_err(raised)?))
    }

    /// The state observer ``z = f z + g u``, then ``z = z + l (f_hat - c z)``.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``name``: ``"anchored"`` (states ``r_1 v_1 … q_1 q_2 d``: loads relative to the actuator, lags of the
    ///     force observers, disturbance in N; ``u`` is the actuator's mean velocity over the period, m/s) or
    ///     ``"reaction"`` (states of the chain; ``u`` is the current, A); ``transition`` ``f`` (s, s); ``input`` ``g``
    ///     (s,); ``output`` ``c`` (s,), N; ``gain`` ``l`` (s,), per N; ``poles`` (s,), complex, of the estimation error.
    #[getter]
    fn observer<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let observer = &self.design.observer;
        let all = PyDict::new(py);
        all.set_item("name", self.design.drive.control.observer.name())?;
        all.set_item("transition", matrix(py, &observer.transition))?;
        let vector = |values: &[f64]| PyArray1::from_slice(py, values);
        all.set_item("input", vector(observer.input.as_slice()))?;
        all.set_item("output", vector(observer.output.as_slice()))?;
        all.set_item("gain", vector(observer.correction.as_slice()))?;
        let of_error = self.design.observer_poles().map_err(raised)?;
        all.set_item("poles", poles(py, &of_error))?;
        Ok(all)
    }

    /// List of dictionaries: ``name``, ``verdict`` (``"pass"``, ``"warn"``, ``"refuse"``), ``value``, ``limit``,
    /// ``advice``.
    #[getter]
    fn checks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.assessed(py, |made| json!(made.checks))
    }

    /// Margins of the loop, broken at the current command.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``drive`` (as it moves), ``held`` (as it is held at rest), ``full_state`` (the true state fed back); each a
    ///     dictionary with gain margins in dB, ``phase_margin_deg``, ``delay_margin`` in s and ``peak_sensitivity``,
    ///     or None where the loop is not stable.
    #[getter]
    fn margins<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        all.set_item("drive", self.assessed(py, |made| json!(made.margins))?)?;
        all.set_item("held", self.assessed(py, |made| json!(made.margins_held))?)?;
        all.set_item(
            "full_state",
            self.assessed(py, |made| json!(made.margins_full_state))?,
        )?;
        Ok(all)
    }

    /// Limits of the running drive by their keys in the drive file, SI units.
    #[getter]
    fn protection<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.said(py, "protection")
    }

    /// The table of planned moves: a dictionary with ``plans``, ``bytes``, ``velocity`` in m/s, and of the move of
    /// 30 mm ``duration`` and ``bound`` in s; None where a refused design has none.
    #[getter]
    fn moves<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.said(py, "moves")
    }

    /// Gain over the time to go, eq. (14): a list of dictionaries with ``time_to_go`` in s, ``k`` (n,) and its
    /// ``distance`` from the constant gain, relative.
    #[getter]
    fn finite_horizon<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.assessed(py, |made| json!(made.finite_horizon))
    }

    /// Raises a RuntimeError with the sentence of the first check that refuses the design; does nothing where it
    /// may run.
    fn require_sound(&self, py: Python<'_>) -> PyResult<()> {
        self.assessment(py)?.require_sound().map_err(raised)
    }

    /// The sampled model of the machine with what makes its force come late.
    ///
    /// Returns
    /// -------
    /// tuple
    ///     ``ad`` (m, m) and ``bd`` (m,); ``m`` is ``n`` and the memory of delay and lag where the drive file states
    ///     any, behind the states of the chain.
    fn plant_matrices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let (ad, bd) = self.design.sampled(&self.design.chain);
        let bd = PyArray1::from_slice(py, bd.as_slice());
        (matrix(py, &ad), bd).into_pyobject(py)
    }

    /// The drive from the measured position of the actuator (m) to its command (A), without limits and reference:
    /// ``s[k+1] = a s[k] + b x_a[k]``, ``i[k] = c s[k] + d x_a[k]``.
    ///
    /// Parameters
    /// ----------
    /// held : bool, optional
    ///     As it is held at rest, where the compensation of the disturbance stands still; as it moves when not given.
    ///
    /// Returns
    /// -------
    /// tuple
    ///     ``a`` (s, s), ``b`` (s,), ``c`` (s,) and ``d``. The states: position and command of the period before,
    ///     eight of the force observers, those of the state observer.
    #[pyo3(signature = (held=false))]
    fn controller_matrices<'py>(
        &self,
        py: Python<'py>,
        held: bool,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let compensation = if held {
            Compensation::Held
        } else {
            Compensation::Follows
        };
        let drive = DriveLoop::new(&self.design, compensation);
        let (a, b, c, d) = drive.matrices();
        let vector = |values: &[f64]| PyArray1::from_slice(py, values);
        let (b, c) = (vector(b.as_slice()), vector(c.as_slice()));
        (matrix(py, a), b, c, d).into_pyobject(py)
    }

    fn __repr__(&self) -> String {
        let drive = &self.design.drive;
        format!(
            "<arso.Design of a {} drive with {} loads, {} s>",
            drive.kind.name(),
            drive.loads.len(),
            drive.control.sample_time
        )
    }

    fn __reduce__(&self, py: Python<'_>) -> PyResult<(Py<PyAny>, (Py<Drive>,))> {
        let made = py.import("arso")?.getattr("design")?;
        Ok((made.unbind(), (self.drive.clone_ref(py),)))
    }
}

/// The design that was given, or that of the drive that was, where it may run.
pub(crate) fn sound(given: &Bound<'_, PyAny>) -> PyResult<Arc<Designed>> {
    let py = given.py();
    match (given.cast::<Design>(), given.cast::<Drive>()) {
        (Ok(design), _) => design.get().drive.get().sound(py),
        (_, Ok(drive)) => drive.get().sound(py),
        _ => Err(no_such(given, "design", "a Design or a Drive")),
    }
}
