//! Files that telemetry goes into, record by record.

use crate::capture::Origin;
use crate::error::{Error, Result};
use crate::output::Unfinished;
use crate::report::log::Rows;
use crate::report::mcap::Recording;
use crate::simulate::corridor::Record;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// CSV, row by row; a file is there once it is finished.
pub(super) struct CsvFile<W: Write> {
    path: PathBuf,
    /// Until the first record comes.
    empty: Option<W>,
    rows: Option<Rows<W>>,
}

impl CsvFile<Unfinished> {
    pub(super) fn create(path: &Path) -> Result<Self> {
        Ok(Self::new(Unfinished::create(path)?, path))
    }

    /// Puts it in its place; without any record the old file stands.
    pub(super) fn finish(self) -> Result<()> {
        match self.rows.map(Rows::into_inner) {
            Some(file) => file.map_err(Error::write(&self.path))?.finish(),
            None => Ok(()),
        }
    }
}

impl<W: Write> CsvFile<W> {
    /// * `path`: as it is called when it cannot be written
    pub(super) fn new(into: W, path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            empty: Some(into),
            rows: None,
        }
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

/// Why a row could not be written.
fn written(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
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
