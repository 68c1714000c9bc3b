//! Records of a machine and the drive file that they are held against: the same way in `identify` and `learn`.

use super::progress::Progress;
use crate::capture::Origin;
use crate::design::Design;
use crate::drive::{DEFAULT_DRIVE, DEFAULT_NAME, Drive};
use crate::error::{Error, Result};
use crate::identify::{Columns, Experiment, Identification, Log, Parameters, identify};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A drive as a file describes it, with the text to be rewritten.
pub(super) struct DescribedDrive {
    path: Option<PathBuf>,
    /// The file, or that of the paper's rig.
    pub(super) text: String,
    /// What it describes.
    pub(super) drive: Drive,
    design: OnceLock<Result<Design>>,
}

impl DescribedDrive {
    pub(super) fn load(path: Option<&Path>) -> Result<Self> {
        let text = match path {
            None => DEFAULT_DRIVE.to_owned(),
            Some(path) => std::fs::read_to_string(path).map_err(Error::read(path))?,
        };
        Ok(Self {
            path: path.map(Path::to_owned),
            text,
            drive: Drive::load(path)?,
            design: OnceLock::new(),
        })
    }

    /// The file as it was given.
    pub(super) fn shown(&self) -> String {
        let path = self.path.as_ref().map(|path| path.display().to_string());
        path.unwrap_or(DEFAULT_NAME.into())
    }

    /// Whether that is where something is to be written.
    pub(super) fn is_at(&self, path: &Path) -> bool {
        let own = self.path.as_ref().and_then(|path| path.canonicalize().ok());
        own.is_some_and(|own| path.canonicalize().is_ok_and(|path| path == own))
    }

    /// Its design, made when first asked for; or why there is none.
    pub(super) fn design(&self) -> std::result::Result<&Design, &Error> {
        let design = self.design.get_or_init(|| Design::new(&self.drive));
        design.as_ref()
    }

    /// The records, each of a drive of its kind.
    pub(super) fn logs(&self, paths: &[PathBuf], columns: &[Columns]) -> Result<Vec<Log>> {
        let columns = together(columns);
        let logs = paths
            .iter()
            .map(|path| Log::load(path, &self.drive, &columns))
            .collect::<Result<Vec<Log>>>()?;
        for log in &logs {
            self.require_same_kind(log)?;
        }
        Ok(logs)
    }

    /// The machine behind some records.
    ///
    /// * `hold`: what is known beforehand, by its keys
    pub(super) fn identified(
        &self,
        logs: &[Log],
        experiment: Experiment,
        hold: &[String],
        quiet: bool,
    ) -> Result<Identification> {
        let parameters = Parameters::new(&self.drive, experiment, hold)?;
        let progress = Progress::new(quiet, "frequency response");
        identify(&self.drive, logs, &parameters, &|done, of, what| {
            progress.step(done, of, what);
        })
    }

    /// A log of the other kind of drive is refused; whatever else differs is said.
    fn require_same_kind(&self, log: &Log) -> Result<()> {
        let Some(mark) = &log.drive else {
            return Ok(());
        };
        // A description for which there are no gains is not that of a drive that ran.
        let design = self.design().ok();
        let record = (&*log.name, &**mark, log.period);
        let differences = Origin::of_record(record, self.drive.kind, design)?;
        if !differences.is_empty() {
            eprintln!(
                "warning: the log is not of the drive that {} describes: it is of one with {}; what is taken \
                 from the file is right only where it holds for that drive too",
                self.shown(),
                differences.join(", ")
            );
        }
        Ok(())
    }
}

/// Names of columns, as often as they were given.
pub(super) fn together(columns: &[Columns]) -> Columns {
    let columns = columns.iter().cloned();
    columns.fold(Columns::default(), Columns::with)
}

/// What is held where nothing else is said.
pub(super) fn held_by_default() -> Vec<String> {
    vec!["actuator.force_constant".to_owned()]
}
