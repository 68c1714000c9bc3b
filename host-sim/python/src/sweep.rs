//! Sweeps: made on all cores, put together from parts, and read as columns.
//!
//! A sweep runs in a thread of its own; the one that asked for it looks after signals and progress meanwhile, so
//! that Ctrl-C ends it, with what is done kept.

use crate::arrays::object;
use crate::description::toml_of;
use crate::errors::{no_such, raised, unusable};
use host_sim::error::Error;
use host_sim::output::unwatched;
use host_sim::sweep::{Column, Shard, Sweep, Watch, columns, merge};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// How often signals and progress are looked at.
const LOOK: Duration = Duration::from_millis(100);

/// Where a sweep is described.
enum Described {
    File(PathBuf),
    /// As TOML.
    Tables(String),
}

impl Described {
    fn read(&self) -> Result<Sweep, Error> {
        match self {
            Self::File(path) => Sweep::load(path),
            Self::Tables(text) => Sweep::parse(text, "dictionary", Path::new("")),
        }
    }
}

/// Runs many plants and drives, drawn at random or on a grid, under many laws, on all cores; the figures go to a
/// Parquet file, which pandas, polars and DuckDB read as well as :func:`read_sweep`.
///
/// The file is the same whatever the number of threads. A sweep that was ended before its time (by Ctrl-C too) goes on
/// from there when the same is asked for again.
///
/// Parameters
/// ----------
/// description : str, os.PathLike or dict
///     A sweep file (TOML), or its tables; files that a dictionary names are relative to the working directory.
/// out : str or os.PathLike
///     The Parquet file.
/// shard : str, optional
///     ``"I/N"``: one part of several, for as many machines; :func:`merge_sweep` puts them together.
/// progress : callable, optional
///     Called as ``progress(done, of)`` in samples, some ten times a second; what it raises ends the sweep.
///
/// Returns
/// -------
/// dict
///     ``samples``, ``seed``, ``sha256``, ``version``, ``shard``, and ``laws``: for each ``law``, ``settling_time`` (s) over
///     all samples, and how many were ``not_settled``, ended in ``faults`` or ``failed``.
///
/// Raises
/// ------
/// ValueError, OSError
///     For a description that cannot be used or read.
/// RuntimeError
///     When it cannot be run or written.
#[pyfunction]
#[pyo3(signature = (description, out, *, shard="1/1", progress=None))]
#[allow(clippy::needless_pass_by_value, reason = "what Python hands over")]
pub(crate) fn sweep<'py>(
    py: Python<'py>,
    description: &Bound<'py, PyAny>,
    out: PathBuf,
    shard: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let shard: Shard = shard
        .parse()
        .map_err(|rule: String| unusable("shard", shard, rule))?;
    let described = if let Ok(tables) = description.cast::<PyDict>() {
        Described::Tables(toml_of(tables)?)
    } else {
        let path = description.extract().map(Described::File);
        path.map_err(|_| no_such(description, "description", "a path or a dictionary"))?
    };
    let (stop, made, all) = (AtomicBool::new(false), AtomicU64::new(0), AtomicU64::new(0));
    let looked_at = |seen: &mut u64| -> PyResult<()> {
        Python::attach(|py| {
            py.check_signals()?;
            let (done, of) = (made.load(Ordering::Relaxed), all.load(Ordering::Relaxed));
            match &progress {
                Some(progress) if *seen != done && of > 0 => {
                    *seen = done;
                    progress.call1(py, (done, of)).map(drop)
                }
                _ => Ok(()),
            }
        })
    };
    let summary = py.detach(|| {
        let sweep = described.read().map_err(raised)?;
        std::thread::scope(|scope| {
            let asking = std::thread::current();
            let (sweep, out, stop) = (&sweep, &out, &stop);
            let (made, all) = (&made, &all);
            let running = scope.spawn(move || {
                let summary = sweep.run(
                    out,
                    shard,
                    &Watch {
                        preparing: &unwatched,
                        running: &|done, of| {
                            made.fetch_max(done, Ordering::Relaxed);
                            all.store(of, Ordering::Relaxed);
                        },
                        stop: &|| stop.load(Ordering::Relaxed),
                    },
                );
                asking.unpark();
                summary
            });
            let (mut seen, mut ended) = (0, Ok(()));
            while !running.is_finished() {
                std::thread::park_timeout(LOOK);
                if ended.is_ok() {
                    ended = looked_at(&mut seen);
                    stop.store(ended.is_err(), Ordering::Relaxed);
                }
            }
            let summary = match running.join() {
                Ok(summary) => summary.map_err(raised),
                Err(panic) => std::panic::resume_unwind(panic),
            };
            ended.and_then(|()| looked_at(&mut seen)).and(summary)
        })
    })?;
    object(py, &json!(summary))
}

/// Puts the parts of a sweep together: all of them, each once, all of the same sweep, in any order.
///
/// Parameters
/// ----------
/// out : str or os.PathLike
///     The Parquet file of the whole, to the very bytes that one machine would have written.
/// parts : sequence of str or os.PathLike
///
/// Returns
/// -------
/// dict
///     As :func:`sweep`.
///
/// Raises
/// ------
/// ValueError, OSError, RuntimeError
///     For parts that are missing, doubled or of another sweep, or cannot be read or written.
#[pyfunction]
#[allow(clippy::needless_pass_by_value, reason = "what Python hands over")]
pub(crate) fn merge_sweep(
    py: Python<'_>,
    out: PathBuf,
    parts: Vec<PathBuf>,
) -> PyResult<Bound<'_, PyAny>> {
    let summary = py.detach(|| merge(&out, &parts, &unwatched));
    object(py, &json!(summary.map_err(raised)?))
}

/// The columns of a sweep's file, each an array with a value for every row: a sample under a law.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     The Parquet file.
///
/// Returns
/// -------
/// dict
///     By name: ``sample``, ``law``, every key that varies, and the figures as in :attr:`Run.metrics`, SI units.
///     Numbers are float64, nan where there is none (a settling time of what does not settle); texts are objects,
///     None where there is none.
///
/// Raises
/// ------
/// OSError
///     When the file cannot be read.
/// ValueError
///     When it is no file of a sweep, or damaged.
#[pyfunction]
#[allow(clippy::needless_pass_by_value, reason = "what Python hands over")]
pub(crate) fn read_sweep(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let columns = py.detach(|| columns(&path)).map_err(raised)?;
    let array = py.import("numpy")?.getattr("array")?;
    let all = PyDict::new(py);
    for (name, column) in columns {
        match column {
            Column::Numbers(numbers) => {
                let numbers = numbers.into_iter().map(|number| number.unwrap_or(f64::NAN));
                all.set_item(name, PyArray1::from_iter(py, numbers))?;
            }
            Column::Texts(texts) => {
                let texts = PyList::new(py, texts)?;
                all.set_item(name, array.call1((texts, "object"))?)?;
            }
        }
    }
    Ok(all)
}
