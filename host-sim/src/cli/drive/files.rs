//! Files that telemetry goes into, record by record.

use super::telemetry::written;
use crate::capture::Origin;
use crate::error::{Error, Result};
use crate::output::Unfinished;
use crate::report::log::Rows;
use crate::report::mcap::Recording;
use crate::simulate::corridor::Record;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

/// A CSV file that grows row by row.
pub(super) struct CsvFile {
    path: PathBuf,
    /// Until the first record comes.
    empty: Option<File>,
    rows: Option<Rows<File>>,
}

impl CsvFile {
    pub(super) fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(Error::write(path))?;
        Ok(Self {
            path: path.to_owned(),
            empty: Some(file),
            rows: None,
        })
    }

    /// * `time`: from the first record on, s
    pub(super) fn add(&mut self, origin: &Origin, record: &Record, time: f64) -> Result<()> {
        let failed = Error::write(&self.path);
        if let Some(file) = self.empty.take() {
            let rows = Rows::of(file, record, origin).map_err(written);
            self.rows = Some(rows.map_err(&failed)?);
        }
        let Some(rows) = &mut self.rows else {
            return Ok(());
        };
        let added = rows.add(record, time).map_err(written);
        added.and_then(|()| rows.flush()).map_err(failed)
    }
}

/// An MCAP file; it is there once it is finished.
pub(super) struct McapFile {
    path: PathBuf,
    /// Until the first record comes.
    empty: Option<Unfinished>,
    recording: Option<Recording<BufWriter<Unfinished>>>,
}

impl McapFile {
    pub(super) fn create(path: &Path) -> Result<Self> {
        let file = Unfinished::create(path)?;
        Ok(Self {
            path: path.to_owned(),
            empty: Some(file),
            recording: None,
        })
    }

    pub(super) fn add(&mut self, origin: &Origin, record: &Record) -> Result<()> {
        let failed = Error::write(&self.path);
        if let Some(file) = self.empty.take() {
            let recording = Recording::new(BufWriter::new(file), origin, record);
            self.recording = Some(recording.map_err(&failed)?);
        }
        let added = self
            .recording
            .as_mut()
            .map(|recording| recording.add(record));
        added.unwrap_or(Ok(())).map_err(failed)
    }

    /// Puts it in its place; without any record the old file stands.
    pub(super) fn finish(self) -> Result<()> {
        let Some(recording) = self.recording else {
            return Ok(());
        };
        let file = recording.finish();
        let file = file.and_then(|file| file.into_inner().map_err(io::IntoInnerError::into_error));
        file.map_err(Error::write(&self.path))?.finish()
    }
}
