//! Descriptions of drives and plants: a path, TOML, or a dictionary.

use crate::arrays::{matrix, object};
use crate::errors::{no_such, raised};
use host_sim::chain::Chain;
use host_sim::design::Design;
use host_sim::design::assessment::require_sound;
use host_sim::drive::{DEFAULT_DRIVE, DEFAULT_NAME, Drive as Described, PlantFile};
use host_sim::error::Error;
use host_sim::machine::chain_of;
use numpy::PyArray1;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// A drive as its controller believes it: actuator, encoder, loads, control, weights.
///
/// Parameters
/// ----------
/// path : str or os.PathLike, optional
///     A drive file (TOML, SI units). The drive of the paper when not given.
///
/// Raises
/// ------
/// ValueError
///     With file, line, key and what is allowed, for what cannot be used.
/// OSError
///     When the file cannot be read.
///
/// Examples
/// --------
/// >>> import arso
/// >>> arso.Drive().loads
/// 3
#[pyclass(module = "arso", frozen)]
pub(crate) struct Drive {
    text: String,
    name: String,
    pub(crate) drive: Described,
    design: OnceLock<Result<Arc<Design>, Error>>,
    /// Why its design may not run, if so.
    refusal: OnceLock<Option<String>>,
}

impl Drive {
    pub(crate) fn read(text: String, name: String) -> PyResult<Self> {
        Ok(Self {
            drive: Described::parse(&text, &name).map_err(raised)?,
            text,
            name,
            design: OnceLock::new(),
            refusal: OnceLock::new(),
        })
    }

    /// Its design, made when first asked for; or why there is none.
    pub(crate) fn made(&self) -> Result<&Design, &Error> {
        let made = || Design::new(&self.drive).map(Arc::new);
        self.design.get_or_init(made).as_deref()
    }

    /// The same, for results that outlive the drive.
    pub(crate) fn design(&self, py: Python<'_>) -> PyResult<Arc<Design>> {
        py.detach(|| self.made().map(drop)).map_err(raised)?;
        match self.design.get() {
            Some(Ok(design)) => Ok(Arc::clone(design)),
            _ => unreachable!("it has just been made"),
        }
    }

    /// Its design, where that may run.
    pub(crate) fn sound(&self, py: Python<'_>) -> PyResult<Arc<Design>> {
        let design = self.design(py)?;
        let found = || require_sound(&design).err().map(|error| error.to_string());
        let refusal = py.detach(|| self.refusal.get_or_init(found));
        match refusal {
            None => Ok(design),
            Some(sentence) => Err(PyRuntimeError::new_err(sentence.clone())),
        }
    }

    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    pub(crate) fn chain_of(drive: &Described) -> Chain {
        chain_of(&drive.actuator, &drive.loads, drive.friction.viscous)
    }
}

#[pymethods]
impl Drive {
    #[new]
    #[pyo3(signature = (path=None))]
    fn new(path: Option<PathBuf>) -> PyResult<Self> {
        match path {
            None => Self::read(DEFAULT_DRIVE.into(), DEFAULT_NAME.into()),
            Some(path) => Self::read(file(&path)?, path.display().to_string()),
        }
    }

    /// A drive from the text of a drive file.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     TOML.
    /// name : str, optional
    ///     How messages name it.
    #[classmethod]
    #[pyo3(signature = (text, name="text"))]
    fn from_toml(_: &Bound<'_, PyType>, text: String, name: &str) -> PyResult<Self> {
        Self::read(text, name.into())
    }

    /// A drive from the tables of a drive file as a dictionary, such as :meth:`to_dict` gives.
    #[classmethod]
    fn from_dict(_: &Bound<'_, PyType>, tables: &Bound<'_, PyDict>) -> PyResult<Self> {
        Self::read(toml_of(tables)?, "dictionary".into())
    }

    /// The text of its drive file, with comments where it has any.
    fn to_toml(&self) -> &str {
        &self.text
    }

    /// The tables of its drive file as it states them, SI units: what is not stated is not there.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        dictionary(py, &self.text)
    }

    /// ``"linear"`` (kg, m, N) or ``"rotary"`` (kg m², rad, N m).
    #[getter]
    fn kind(&self) -> &'static str {
        self.drive.kind.name()
    }

    /// Number of load masses ``N``.
    #[getter]
    fn loads(&self) -> usize {
        self.drive.loads.len()
    }

    /// Control period, s.
    #[getter]
    fn sample_time(&self) -> f64 {
        self.drive.control.sample_time
    }

    /// The chain of actuator, springs and loads.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``mass`` (N+1,) kg, actuator first; ``stiffness`` (N,) N/m and ``damping`` (N,) N s/m of the springs from
    ///     the actuator outwards; ``viscous`` (N+1,) N s/m against the ground; ``force_constant`` N/A; ``a``
    ///     (2N+2, 2N+2) and ``b`` (2N+2,) of ``dx/dt = a x + b i`` with the state ``x_a v_a x_1 v_1 …``;
    ///     ``reaction_force`` (2N+2,), its row of the reaction force, N; ``modes``, a list of dictionaries with
    ///     ``frequency_hz``, ``damping_ratio`` and ``shape`` (N+1,).
    #[getter]
    fn chain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let chain = Self::chain_of(&self.drive);
        let mut viscous = vec![chain.viscous];
        viscous.extend(&chain.ground);
        viscous.resize(chain.mass.len(), 0.0);
        let modes = chain.modes().into_iter().map(|mode| {
            let of_mode = PyDict::new(py);
            of_mode.set_item("frequency_hz", mode.frequency_hz)?;
            of_mode.set_item("damping_ratio", mode.damping_ratio)?;
            of_mode.set_item("shape", PyArray1::from_slice(py, &mode.shape))?;
            Ok(of_mode)
        });
        let all = PyDict::new(py);
        all.set_item("mass", PyArray1::from_slice(py, &chain.mass))?;
        all.set_item("stiffness", PyArray1::from_slice(py, &chain.stiffness))?;
        all.set_item("damping", PyArray1::from_slice(py, &chain.damping))?;
        all.set_item("viscous", PyArray1::from_vec(py, viscous))?;
        all.set_item("force_constant", chain.force_constant)?;
        all.set_item("a", matrix(py, &chain.a()))?;
        all.set_item("b", PyArray1::from_slice(py, chain.b().as_slice()))?;
        let row = chain.reaction_force();
        all.set_item("reaction_force", PyArray1::from_slice(py, row.as_slice()))?;
        all.set_item("modes", modes.collect::<PyResult<Vec<_>>>()?)?;
        Ok(all)
    }

    fn __repr__(&self) -> String {
        let (kind, loads) = (self.drive.kind.name(), self.drive.loads.len());
        format!("<arso.Drive {}: {kind}, {loads} loads>", self.name)
    }

    fn __reduce__(&self, py: Python<'_>) -> PyResult<(Py<PyAny>, (String, String))> {
        let read = py.get_type::<Self>().getattr("from_toml")?;
        Ok((read.unbind(), (self.text.clone(), self.name.clone())))
    }
}

/// What is really there: a drive file without control, with forces and imperfections where there are any.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     A plant file (TOML, SI units), or a drive file.
///
/// Raises
/// ------
/// ValueError, OSError
///     As :class:`Drive`.
#[pyclass(module = "arso", frozen)]
pub(crate) struct Plant {
    text: String,
    name: String,
    pub(crate) plant: PlantFile,
}

impl Plant {
    fn read(text: String, name: String) -> PyResult<Self> {
        Ok(Self {
            plant: PlantFile::parse(&text, &name).map_err(raised)?,
            text,
            name,
        })
    }
}

#[pymethods]
impl Plant {
    #[new]
    #[allow(clippy::needless_pass_by_value, reason = "what Python hands over")]
    fn new(path: PathBuf) -> PyResult<Self> {
        Self::read(file(&path)?, path.display().to_string())
    }

    /// A plant from the text of a plant file.
    ///
    /// Parameters
    /// ----------
    /// text : str
    ///     TOML.
    /// name : str, optional
    ///     How messages name it.
    #[classmethod]
    #[pyo3(signature = (text, name="text"))]
    fn from_toml(_: &Bound<'_, PyType>, text: String, name: &str) -> PyResult<Self> {
        Self::read(text, name.into())
    }

    /// A plant from the tables of a plant or drive file as a dictionary, such as :meth:`Drive.to_dict` gives.
    #[classmethod]
    fn from_dict(_: &Bound<'_, PyType>, tables: &Bound<'_, PyDict>) -> PyResult<Self> {
        Self::read(toml_of(tables)?, "dictionary".into())
    }

    /// The text of its file.
    fn to_toml(&self) -> &str {
        &self.text
    }

    /// The tables of its file, SI units.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        dictionary(py, &self.text)
    }

    fn __repr__(&self) -> String {
        let (kind, loads) = (self.plant.kind.name(), self.plant.loads.len());
        format!("<arso.Plant {}: {kind}, {loads} loads>", self.name)
    }

    fn __reduce__(&self, py: Python<'_>) -> PyResult<(Py<PyAny>, (String, String))> {
        let read = py.get_type::<Self>().getattr("from_toml")?;
        Ok((read.unbind(), (self.text.clone(), self.name.clone())))
    }
}

/// The plant that was given (a plant, or the machine that a drive believes in), or a drive's own machine; held against
/// the drive.
pub(crate) fn plant_for(
    given: Option<&Bound<'_, PyAny>>,
    drive: &Described,
) -> PyResult<PlantFile> {
    let plant = match given {
        None => PlantFile::from(drive),
        Some(given) => match (given.cast::<Plant>(), given.cast::<Drive>()) {
            (Ok(plant), _) => plant.get().plant.clone(),
            (_, Ok(other)) => PlantFile::from(&other.get().drive),
            _ => return Err(no_such(given, "plant", "a Plant or a Drive")),
        },
    };
    plant.require_fit(drive).map_err(raised)?;
    Ok(plant)
}

fn file(path: &std::path::Path) -> PyResult<String> {
    std::fs::read_to_string(path).map_err(|error| raised(Error::read(path)(error)))
}

pub(crate) fn toml_of(tables: &Bound<'_, PyDict>) -> PyResult<String> {
    let value: toml::Value = pythonize::depythonize(tables).map_err(|error| {
        PyValueError::new_err(format!("dictionary: no tables of a file: {error}"))
    })?;
    toml::to_string(&value)
        .map_err(|error| PyValueError::new_err(format!("dictionary: no tables of a file: {error}")))
}

fn dictionary<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
    let value: toml::Table = text
        .parse()
        .map_err(|error: toml::de::Error| PyValueError::new_err(error.to_string()))?;
    let value =
        serde_json::to_value(value).map_err(|error| PyValueError::new_err(error.to_string()))?;
    object(py, &value)
}
