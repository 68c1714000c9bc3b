//! From records of ordinary moves to the machine behind them, and new gains.
//!
//! A record that is given as arrays is written as the CSV that host-sim reads, so that the same checks hold for
//! it; what is wrong with a line of it is said of the sample.

use crate::arrays::object;
use crate::description::Drive;
use crate::errors::{no_such, raised};
use crate::simulate::{Run, recorded};
use host_sim::capture::Origin;
use host_sim::error::{Error, Result};
use host_sim::identify::{Columns, Experiment, Log, Parameters, drive_file, identify};
use host_sim::output::unwatched;
use host_sim::report::learning::{self, Learned as Told};
use host_sim::simulate::proposal::Proposal;
use host_sim::simulate::sequence::require_a_count;
use numpy::{AllowTypeChange, PyArrayLike1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::PathBuf;

/// What :func:`learn` found.
#[pyclass(module = "arso", frozen)]
pub(crate) struct Learned {
    /// The drive with the identified values in its file, comments kept.
    #[pyo3(get)]
    drive: Py<Drive>,
    found: Value,
}

#[pymethods]
impl Learned {
    /// By key of the drive file a dictionary with ``value`` and ``std`` (SI; None where the record does not determine
    /// it), ``unit``, and ``held`` (taken from the drive file).
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.found["parameters"])
    }

    /// What control needs of the whole: a list of dictionaries with ``name``, ``value``, ``std`` and ``unit``.
    #[getter]
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.found["figures"])
    }

    /// What else is to be said, a sentence each.
    #[getter]
    fn remarks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.found["remarks"])
    }

    /// How much of the motion the machine explains, %.
    #[getter]
    fn fit_percent<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.found["fit_percent"])
    }

    /// Frequencies of the modes, Hz: a dictionary with lists ``before`` and ``after``.
    #[getter]
    fn modes_hz<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.found["modes_hz"])
    }

    /// What the new gains buy: a planned move on the machine that was learned. A dictionary with ``distance`` (m),
    /// settling times ``before`` and ``after`` (s), ``bound`` (s), ``times_bound`` and both metrics; None where the new
    /// design is refused.
    #[getter]
    fn benefit<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.found["move"])
    }

    /// Why there are no new gains, or None.
    #[getter]
    fn refused<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.found["refused"])
    }

    /// Checks of the new gains, as :attr:`Design.checks`.
    #[getter]
    fn checks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.found["checks"])
    }

    fn __repr__(&self) -> String {
        let fit = self.found["fit_percent"].as_f64().unwrap_or_default();
        format!("<arso.Learned: explains {fit:.1} % of the motion>")
    }
}

/// Learns the machine from records of its moves, and designs new gains for it.
///
/// Identifies masses, springs, dampers and friction (the force constant is taken from the drive), writes them into
/// the drive file, designs, and simulates a planned move on that machine with the old gains and the new ones. Takes
/// seconds; the interpreter is released meanwhile.
///
/// Parameters
/// ----------
/// drive : Drive
///     Whose gains the machine ran with.
/// record : str, os.PathLike, Run or dict, or a list of these
///     Records of the same machine, one row per control period: a CSV file as `capture` or `simulate` write it, a
///     simulated run, or a dictionary of arrays: ``count`` (n,), the encoder's counter, and ``current`` (n,), A, the one
///     applied over the period that ends there; ``time`` (n,), s, when the rows are not a control period apart.
/// move : float, optional
///     The planned move that shows what the new gains buy, m.
///
/// Returns
/// -------
/// Learned
///
/// Raises
/// ------
/// ValueError
///     For a record or an argument that cannot be used.
/// OSError
///     For a file that cannot be read.
/// RuntimeError
///     When the records do not determine the machine.
#[pyfunction]
#[pyo3(signature = (drive, record, *, r#move=None))]
pub(crate) fn learn<'py>(
    py: Python<'py>,
    drive: &Bound<'py, Drive>,
    record: &Bound<'py, PyAny>,
    r#move: Option<f64>,
) -> PyResult<Learned> {
    let described = drive.get();
    let old = &described.drive;
    if let Some(distance) = r#move {
        require_a_count(old, distance).map_err(raised)?;
    }
    let records: Vec<Bound<'py, PyAny>> = match record.cast::<PyList>() {
        Ok(list) => list.iter().collect(),
        Err(_) => vec![record.clone()],
    };
    if records.is_empty() {
        return Err(PyValueError::new_err(
            "`record`: must be one record at least",
        ));
    }
    let sources = records.iter().enumerate().map(|(number, record)| {
        let name = match records.len() {
            1 => "record".to_owned(),
            _ => format!("record {}", number + 1),
        };
        Source::of(record, name, old.control.sample_time)
    });
    let sources = sources.collect::<PyResult<Vec<Source>>>()?;
    let design = py.detach(|| described.made());
    let text = described.text();
    let (text, identification, warnings) = py
        .detach(|| {
            let mut logs = Vec::new();
            let mut warnings = Vec::new();
            for source in &sources {
                let log = source.log(old)?;
                if let Some(mark) = &log.drive {
                    let record = (&*log.name, &**mark, log.period);
                    let differences = Origin::of_record(record, old.kind, design.ok())?;
                    if !differences.is_empty() {
                        warnings.push(format!(
                            "{} is not of this drive: it is of one with {}",
                            log.name,
                            differences.join(", ")
                        ));
                    }
                }
                logs.push(log);
            }
            let hold = ["actuator.force_constant".to_owned()];
            let parameters = Parameters::new(old, Experiment::Excitation, &hold)?;
            let identification = identify(old, &logs, &parameters, &unwatched)?;
            let text = drive_file(text, &identification.quantities)?;
            Ok::<_, Error>((text, identification, warnings))
        })
        .map_err(raised)?;
    for warning in warnings {
        let category = py.get_type::<pyo3::exceptions::PyUserWarning>();
        let text = std::ffi::CString::new(warning)?;
        PyErr::warn(py, &category, &text, 1)?;
    }
    let learned = Drive::read(text, "learned".into())?;
    let found = py.detach(|| {
        let proposal = Proposal::new(design, &learned.drive, r#move);
        let told = Told {
            old,
            new: &learned.drive,
            identification: &identification,
        };
        let refused = proposal.as_ref().err().map(ToString::to_string);
        let checks = proposal.as_ref().map_or(&[][..], |found| &found.checks);
        let benefit = proposal.as_ref().map(|found| &found.benefit);
        let benefit = benefit.map_err(|_| refused.as_deref().unwrap_or_default());
        learning::json(&told, benefit, checks, &json!({}))
    });
    Ok(Learned {
        drive: Py::new(py, learned)?,
        found,
    })
}

/// Where a record comes from.
enum Source {
    File(PathBuf),
    /// Its name, and the CSV that was made of its arrays.
    Arrays(String, String),
}

impl Source {
    fn of(record: &Bound<'_, PyAny>, name: String, period: f64) -> PyResult<Self> {
        if let Ok(run) = record.cast::<Run>() {
            return Self::of_arrays(&recorded(run)?, name, period);
        }
        if let Ok(arrays) = record.cast::<PyDict>() {
            return Self::of_arrays(arrays, name, period);
        }
        let allowed = "a path, a Run, a dictionary of arrays, or a list of these";
        let path = record.extract().map(Self::File);
        path.map_err(|_| no_such(record, "record", allowed))
    }

    fn of_arrays(arrays: &Bound<'_, PyDict>, name: String, period: f64) -> PyResult<Self> {
        const KEYS: [&str; 3] = ["time", "count", "current"];
        for key in arrays.keys() {
            let key: String = key.extract()?;
            if !KEYS.contains(&&*key) {
                return Err(PyValueError::new_err(format!(
                    "{name}: \"{key}\": must be \"time\", \"count\" or \"current\""
                )));
            }
        }
        let count = array(arrays, &name, "count")?
            .ok_or_else(|| PyValueError::new_err(format!("{name}: \"count\" is missing")))?;
        let current = array(arrays, &name, "current")?
            .ok_or_else(|| PyValueError::new_err(format!("{name}: \"current\" is missing")))?;
        let time = array(arrays, &name, "time")?;
        let time = time.unwrap_or_else(|| (0..count.len()).map(|k| k as f64 * period).collect());
        if time.len() != count.len() || current.len() != count.len() {
            return Err(PyValueError::new_err(format!(
                "{name}: time, count and current have {}, {} and {} values: must be as many",
                time.len(),
                count.len(),
                current.len()
            )));
        }
        let mut text = String::from("time[s],count[1],applied_current[A]\n");
        for ((time, count), current) in time.iter().zip(&count).zip(&current) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{},{count},{current}", host_sim::report::time(*time));
        }
        Ok(Self::Arrays(name, text))
    }

    fn log(&self, drive: &host_sim::drive::Drive) -> Result<Log> {
        match self {
            Self::File(path) => Log::load(path, drive, &Columns::default()),
            Self::Arrays(name, text) => {
                let read = Log::parse(text.as_bytes(), name, drive, &Columns::default());
                read.map_err(|error| of_sample(error, name))
            }
        }
    }
}

/// The line of a CSV that nobody has seen as the number of the sample.
fn of_sample(error: Error, name: &str) -> Error {
    match error {
        Error::Input { place, message } => {
            let line = place
                .strip_prefix(name)
                .and_then(|rest| rest.strip_prefix(':'));
            let sample = line.and_then(|line| line.parse::<usize>().ok()?.checked_sub(2));
            let place = sample.map_or(place, |sample| format!("{name}, sample {sample}"));
            Error::Input { place, message }
        }
        other => other,
    }
}

/// One column of a record.
fn array(arrays: &Bound<'_, PyDict>, name: &str, key: &str) -> PyResult<Option<Vec<f64>>> {
    let Some(values) = arrays.get_item(key)? else {
        return Ok(None);
    };
    let values: PyArrayLike1<'_, f64, AllowTypeChange> = values.extract().map_err(|_| {
        PyValueError::new_err(format!(
            "{name}: \"{key}\": must be an array of numbers, (n,)"
        ))
    })?;
    Ok(Some(values.as_array().to_vec()))
}
