//! Whether a plant can stand in the place of the machine that a drive file describes.

use super::{Drive, PlantFile};
use crate::error::{Error, Result};

impl PlantFile {
    /// # Errors
    /// [`Error::Usage`] when the plant is of another kind than the drive, has another number of loads, or
    /// states another control period.
    pub fn require_fit(&self, drive: &Drive) -> Result<()> {
        let (kind, other) = (self.kind.name(), drive.kind.name());
        if self.kind != drive.kind {
            return Err(Error::Usage(format!(
                "the plant is {kind} and the drive {other}: they must be of the same kind"
            )));
        }
        let (loads, others) = (self.loads.len(), drive.loads.len());
        if loads != others {
            return Err(Error::Usage(format!(
                "the plant has {} and the drive {others}: they must have the same number",
                if loads == 1 {
                    "1 load".into()
                } else {
                    format!("{loads} loads")
                },
            )));
        }
        let period = drive.control.sample_time;
        match self.sample_time {
            Some(stated) if (stated / period - 1.0).abs() > 1e-9 => Err(Error::Usage(format!(
                "the plant file has control.sample_time = {stated} s and the drive {period} s: they must be the \
                 same, or leave [control] out of the plant file"
            ))),
            _ => Ok(()),
        }
    }
}
