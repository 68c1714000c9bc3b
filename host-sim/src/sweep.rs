//! Sweeps: many plants and drives, drawn or on a grid, under many laws, a row of figures for each.
//!
//! ```text
//! sweep.toml -> description --+-> variation: sample i -> values, drive, plant --+
//! drive.toml, plant.toml -----+-> design -> laws, the rivals tuned once ---------+-> runs -> rows -> chunks
//!                                                                                                     |
//!                       Parquet file of the sweep, or of a part of it  <------------------------------+
//!                       parts of all machines --merge--> the same file
//! ```
//!
//! Sample `i` is drawn from a random stream of its own, set by the seed and `i`: its rows are the same whatever
//! machine and thread makes them, and in whatever order. Samples are made in chunks, each kept beside the
//! output once it is whole; after a kill, those are found again, unless they are damaged or of another build. The file
//! itself is written from the chunks in their order, a group of rows at a time.

mod columns;
mod description;
mod digest;
mod distribution;
mod file;
mod key;
mod laws;
mod merge;
mod rows;
mod shard;
mod summary;
mod table;
mod variation;

pub use columns::{Column, columns};
pub use merge::merge;
pub use shard::Shard;
pub use summary::{OfLaw, Summary};

use crate::design::Design;
use crate::design::assessment::require_sound_at_first_look;
use crate::drive::{DEFAULT_DRIVE, Drive, PlantFile};
use crate::error::{Error, Result};
use crate::output::{Progress, Unfinished};
use crate::simulate::experiment::require_duration;
use crate::simulate::metrics::Metrics;
use crate::simulate::scenario::{Approach, Scenario, Start};
use crate::simulate::sequence::require_a_count;
use description::{Description, Way};
use file::{Header, Identity, Reader, Writer};
use laws::{Bench, Chosen};
use rayon::prelude::*;
use rows::Rows;
use sha2::{Digest, Sha256};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use table::{Cell, Table};
use variation::Variation;

/// A part of a sweep is made in about so many chunks, of so many samples each.
const CHUNKS: u64 = 20;
const CHUNK: std::ops::RangeInclusive<u64> = 16..=1000;

/// The figures of a run, or why there are none.
type Figures = std::result::Result<Metrics, String>;

/// A sweep, read and checked.
pub struct Sweep {
    description: Description,
    scenario: Scenario,
    variation: Variation,
    design: Design,
    rows: Rows,
    identity: Identity,
    /// The files that it was read from.
    inputs: Vec<PathBuf>,
}

/// How a sweep is watched, and ended before its time.
pub struct Watch<'a> {
    /// What is prepared: designs, rivals.
    pub preparing: &'a Progress<'a>,
    /// Samples that are done, and how many there are.
    pub running: &'a (dyn Fn(u64, u64) + Sync),
    /// Whether it shall end now.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl Watch<'static> {
    /// Nobody watches.
    pub const NONE: Self = Self {
        preparing: &crate::output::unwatched,
        running: &|_, _| (),
        stop: &|| false,
    };
}

impl Sweep {
    /// Reads a sweep file and the files it names, relative to itself.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Input`]; [`Error::Design`] when the drive has no gains.
    pub fn load(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::read(path))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&text, &path.display().to_string(), folder)
    }

    /// * `text`: TOML
    /// * `name`: of the file, for messages
    /// * `folder`: to which the files it names are relative
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, name: &str, folder: &Path) -> Result<Self> {
        let description = Description::parse(text, name)?;
        let read = |file: &Option<String>| -> Result<Option<(PathBuf, String)>> {
            let Some(file) = file else { return Ok(None) };
            let path = folder.join(file);
            let text = std::fs::read_to_string(&path).map_err(Error::read(&path))?;
            Ok(Some((path, text)))
        };
        let drive_file = read(&description.drive)?;
        let drive = match &drive_file {
            None => Drive::default_drive(),
            Some((path, text)) => Drive::parse(text, &path.display().to_string())?,
        };
        let drive_text = drive_file
            .as_ref()
            .map_or(DEFAULT_DRIVE.to_owned(), |(_, text)| text.clone());
        let plant_file = read(&description.plant)?;
        if let Some((path, text)) = &plant_file {
            PlantFile::parse(text, &path.display().to_string())?.require_fit(&drive)?;
        }
        let files = [&drive_file, &plant_file].into_iter().flatten();
        let inputs = files.map(|(path, _)| path.clone());
        let inputs = inputs.chain([PathBuf::from(name)]).collect();
        let plant_text = plant_file.map(|(_, text)| text);
        let variation = Variation::new(&description, &drive_text, plant_text.as_deref())?;
        let (approach, target, way) = match description.way {
            Way::Step(target) => (Approach::Step, target, "step"),
            Way::Move(target) => (Approach::Move, target, "move"),
        };
        // What is no number is no distance.
        if !target.is_finite() || require_a_count(&drive, target).is_err() {
            let (unit, count) = (drive.kind.units().position, drive.encoder.resolution);
            let message = format!(
                "{way} = {target}: must be one count of the encoder at least, {count:e} {unit}"
            );
            return Err(description.error(None, message));
        }
        of_duration(description.duration, drive.control.sample_time)
            .map_err(|message| description.error(None, message))?;
        let scenario = Scenario {
            name: way,
            linear_title: way,
            approach,
            target,
            start: Start::Origin,
        };
        let design = Design::new(&drive)?;
        let known = laws::names(&design, &scenario);
        for (law, span) in &description.laws {
            if !known.contains(&&law[..]) {
                let known: Vec<String> = known.iter().map(|law| format!("\"{law}\"")).collect();
                let message = format!("law \"{law}\": must be one of {}", known.join(", "));
                return Err(description.error(Some(span), message));
            }
        }
        let mut texts = vec![("sweep".to_owned(), text.to_owned())];
        texts.push(("drive".into(), drive_text));
        texts.extend(plant_text.map(|text| ("plant".into(), text)));
        let identity = Identity {
            sha256: sha256(&texts),
            texts,
            version: env!("CARGO_PKG_VERSION").into(),
            sources: env!("HOST_SIM_SOURCES").into(),
            seed: description.seed,
            count: variation.count(),
            laws: description.laws.len() as u64,
        };
        Ok(Self {
            rows: Rows::new(&variation, design.loads()),
            description,
            scenario,
            variation,
            design,
            identity,
            inputs,
        })
    }

    /// How many samples it has, all parts together.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.variation.count()
    }

    /// Makes one part and writes it; chunks that are there already are not made again.
    ///
    /// # Errors
    /// [`Error::Design`] when the drive's gains are unsound at a first look, which those of varied drives must stand
    /// as well; [`Error::Comparison`] when a rival cannot be tuned; [`Error::Write`]; [`Error::Sweep`] when it was
    /// ended before its time.
    pub fn run(&self, out: &Path, shard: Shard, watch: &Watch<'_>) -> Result<Summary> {
        if let Some(input) = self.inputs.iter().find(|input| are_one(input, out)) {
            let name = input.display();
            return Err(Error::Usage(format!(
                "the figures cannot go to {name}: the sweep is read from there"
            )));
        }
        // What cannot be written is said before the work.
        Unfinished::create(out)?;
        let header = self.header(shard, shard.samples(self.samples()));
        let folder = chunk_folder(out);
        let missing = chunks(&header.samples)
            .filter(|samples| !self.is_there(&folder, &self.header(shard, samples.clone())));
        let missing: Vec<Range<u64>> = missing.collect();
        if !missing.is_empty() {
            require_sound_at_first_look(&self.design)?;
            let laws = self.description.laws.iter();
            let names: Vec<String> = laws.map(|(law, _)| law.clone()).collect();
            let chosen = laws::choose(
                &self.design,
                &self.scenario,
                &names,
                self.description.evaluations,
                watch.preparing,
            )?;
            self.make(&missing, &chosen, (&folder, &header), watch)?;
        }
        let mut writer = Writer::create(out, self.rows.schema(), &header)?;
        let mut gathered = summary::Gathered::default();
        for samples in chunks(&header.samples) {
            for rows in Reader::open(&chunk_path(&folder, &samples))?.groups() {
                let rows = rows?;
                gathered.see(self.rows.schema(), &rows);
                writer.push(rows)?;
            }
        }
        writer.finish()?;
        // The file has all of it; what cannot be removed does no harm.
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let number = name.to_str().and_then(|name| name.strip_suffix(".parquet"));
            if number.is_some_and(|number| number.parse::<u64>().is_ok()) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
        let _ = std::fs::remove_dir(&folder);
        Ok(gathered.summary(&header))
    }

    fn header(&self, shard: Shard, samples: Range<u64>) -> Header {
        Header {
            identity: self.identity.clone(),
            shard,
            samples,
        }
    }

    /// Whether a chunk is whole, of this sweep, and made by this build.
    fn is_there(&self, folder: &Path, header: &Header) -> bool {
        let reader = Reader::open(&chunk_path(folder, &header.samples));
        reader.is_ok_and(|found| found.header == *header && found.schema == *self.rows.schema())
    }

    /// Makes chunks, one after the other, the samples of each side by side.
    fn make(
        &self,
        missing: &[Range<u64>],
        chosen: &[Chosen],
        (folder, whole): (&Path, &Header),
        watch: &Watch<'_>,
    ) -> Result<()> {
        let size = |samples: &Range<u64>| samples.end - samples.start;
        let all = size(&whole.samples);
        let mut kept = all - missing.iter().map(size).sum::<u64>();
        let done = AtomicU64::new(kept);
        let stated = Bench::new(
            &self.design,
            &self.scenario,
            self.description.duration,
            chosen,
        );
        (watch.running)(kept, all);
        for samples in missing {
            let sample = |sample: u64| {
                if (watch.stop)() {
                    return None;
                }
                let rows = self.sample(sample, &stated, chosen);
                let done = 1 + done.fetch_add(1, Ordering::Relaxed);
                (watch.running)(done, all);
                Some(rows)
            };
            let numbers: Vec<u64> = samples.clone().collect();
            let rows: Option<Vec<_>> = numbers.into_par_iter().map(sample).collect();
            let Some(rows) = rows else {
                return Err(Error::Sweep(format!(
                    "it was interrupted, {kept} of {all} samples are kept; the same command goes on from there"
                )));
            };
            let mut table = Table::new(self.rows.schema());
            for row in rows.into_iter().flatten() {
                table.push(row);
            }
            let (path, header) = (
                chunk_path(folder, samples),
                self.header(whole.shard, samples.clone()),
            );
            let mut writer = Writer::create(&path, self.rows.schema(), &header)?;
            writer.push(table)?;
            writer.finish()?;
            kept += size(samples);
        }
        Ok(())
    }

    /// The rows of one sample.
    fn sample(&self, sample: u64, stated: &Bench<'_>, chosen: &[Chosen]) -> Vec<Vec<Cell>> {
        let values = self.variation.values(sample);
        let results = self.results(&values, stated, chosen).unwrap_or_else(|why| {
            self.description
                .laws
                .iter()
                .map(|_| Err(why.clone()))
                .collect()
        });
        let laws = self.description.laws.iter().zip(&results);
        laws.map(|((law, _), result)| self.rows.row(sample, law, &values, result))
            .collect()
    }

    /// The figures of every law on one sample.
    fn results(
        &self,
        values: &[toml::Value],
        stated: &Bench<'_>,
        chosen: &[Chosen],
    ) -> std::result::Result<Vec<Figures>, String> {
        let plant = self.variation.plant(values)?;
        let text = |error: Error| error.to_string();
        if !self.variation.designs() {
            plant.require_fit(&self.design.drive).map_err(text)?;
            return Ok(stated.run(&plant));
        }
        let drive = self.variation.drive(values)?;
        plant.require_fit(&drive).map_err(text)?;
        of_duration(self.description.duration, drive.control.sample_time)?;
        if drive.loads.len() != self.design.loads() {
            return Err("it has another number of loads than the drive of the sweep".into());
        }
        let design = Design::new(&drive).map_err(text)?;
        require_sound_at_first_look(&design).map_err(text)?;
        let bench = Bench::new(&design, &self.scenario, self.description.duration, chosen);
        Ok(bench.run(&plant))
    }
}

/// What simulate refuses is refused here, by the name that it has in the file.
fn of_duration(duration: f64, period: f64) -> std::result::Result<(), String> {
    require_duration(duration, period, 0.0).map_err(|rule| format!("duration = {duration}: {rule}"))
}

/// Whether two paths lead to the same file, which is there.
fn are_one(one: &Path, other: &Path) -> bool {
    let [one, other] = [one, other].map(|path| path.canonicalize().ok());
    one.is_some() && one == other
}

/// Where the chunks of an output are kept until it is whole.
fn chunk_folder(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".parts");
    name.into()
}

fn chunk_path(folder: &Path, samples: &Range<u64>) -> PathBuf {
    folder.join(format!("{:010}.parquet", samples.start))
}

/// The samples of every chunk of a part.
fn chunks(samples: &Range<u64>) -> impl Iterator<Item = Range<u64>> + use<> {
    let (start, end) = (samples.start, samples.end);
    let size = ((end - start) / CHUNKS).clamp(*CHUNK.start(), *CHUNK.end());
    (0..(end - start).div_ceil(size)).map(move |k| {
        let first = start + k * size;
        first..end.min(first + size)
    })
}

/// Of all texts and their names, each with its length before it.
fn sha256(texts: &[(String, String)]) -> String {
    let mut hash = Sha256::new();
    for text in texts.iter().flat_map(|(name, text)| [name, text]) {
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text);
    }
    digest::hexadecimal(hash)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What another build has made is made anew, whatever version it has.
    #[test]
    fn chunks_of_another_build_are_not_gone_on_with() {
        let text = "step = 0.03\nduration = 1.2\nlaws = [\"drive\"]\n";
        let sweep = Sweep::parse(text, "sweep.toml", Path::new("")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let own = sweep.header(Shard::WHOLE, 0..0);
        let mut other = own.clone();
        other.identity.sources = "of another build".into();
        for (header, there) in [(&own, true), (&other, false)] {
            let path = chunk_path(folder.path(), &(0..0));
            let writer = Writer::create(&path, sweep.rows.schema(), header).unwrap();
            writer.finish().unwrap();
            assert_eq!(sweep.is_there(folder.path(), &own), there);
        }
    }
}
