//! The Parquet file of a sweep, of a part of one, or of a chunk of a part: rows in groups of one size, so that the
//! same rows make the same bytes whatever pieces they came in; and what it is of, in its metadata.

use super::digest;
use super::shard::Shard;
use super::table::{Column, Schema, Table, parquet_schema, schema_of};
use crate::error::{Error, Result};
use crate::output::Unfinished;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rows of a group: what is held in memory.
const GROUP: usize = 16_384;

/// Which sweep a file is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Identity {
    /// The files it was described by: names of the metadata, and texts.
    pub(super) texts: Vec<(String, String)>,
    /// Of all texts, hexadecimal.
    pub(super) sha256: String,
    /// Of the program.
    pub(super) version: String,
    /// Of what the program was built from, hexadecimal.
    pub(super) sources: String,
    /// Of all that is drawn.
    pub(super) seed: u64,
    /// Of the whole sweep.
    pub(super) count: u64,
    /// Rows for each sample.
    pub(super) laws: u64,
}

/// What a file is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) identity: Identity,
    pub(super) shard: Shard,
    /// The samples in it.
    pub(super) samples: Range<u64>,
}

/// Names of the metadata begin with it.
const PREFIX: &str = "host-sim.";

impl Header {
    /// How many rows the file has.
    pub(super) fn rows(&self) -> u64 {
        (self.samples.end - self.samples.start) * self.identity.laws
    }

    fn metadata(&self) -> Vec<KeyValue> {
        let identity = &self.identity;
        let texts = identity.texts.iter().cloned();
        let others = [
            ("sha256", identity.sha256.clone()),
            ("version", identity.version.clone()),
            ("sources", identity.sources.clone()),
            ("seed", identity.seed.to_string()),
            ("count", identity.count.to_string()),
            ("laws", identity.laws.to_string()),
            ("shard", self.shard.to_string()),
            ("first", self.samples.start.to_string()),
            ("end", self.samples.end.to_string()),
            ("rows", self.rows().to_string()),
        ];
        let others = others.map(|(name, value)| (name.to_owned(), value));
        let all = texts.chain(others);
        let all = all.map(|(name, value)| KeyValue::new(format!("{PREFIX}{name}"), value));
        let digest = KeyValue::new(digest::KEY.into(), digest::BLANK.to_owned());
        all.chain([digest]).collect()
    }

    /// Out of the metadata; none where something is missing.
    fn of(metadata: &[KeyValue]) -> Option<Self> {
        let pairs = metadata.iter().filter_map(|pair| {
            let name = pair.key.strip_prefix(PREFIX)?;
            Some((name.to_owned(), pair.value.clone()?))
        });
        let pairs: Vec<(String, String)> = pairs.collect();
        let find = |wanted: &str| pairs.iter().find(|(name, _)| name == wanted);
        let value = |wanted: &str| Some(find(wanted)?.1.clone());
        let number = |wanted: &str| value(wanted)?.parse::<u64>().ok();
        let described = pairs.iter().take_while(|(name, _)| name != "sha256");
        let (first, end) = (number("first")?, number("end")?);
        (first <= end).then_some(())?;
        Some(Self {
            identity: Identity {
                texts: described.cloned().collect(),
                sha256: value("sha256")?,
                version: value("version")?,
                sources: value("sources")?,
                seed: number("seed")?,
                count: number("count")?,
                laws: number("laws")?,
            },
            shard: value("shard")?.parse().ok()?,
            samples: first..end,
        })
    }
}

/// A file on its way, there once it is finished.
pub(super) struct Writer {
    path: PathBuf,
    file: SerializedFileWriter<Unfinished>,
    pending: Table,
    schema: Schema,
}

impl Writer {
    /// Begins a file.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub(super) fn create(path: &Path, schema: &Schema, header: &Header) -> Result<Self> {
        let properties = WriterProperties::builder()
            .set_created_by(format!("host-sim {}", env!("CARGO_PKG_VERSION")))
            .set_key_value_metadata(Some(header.metadata()))
            .build();
        let failed = unwritten(path);
        let parquet = parquet_schema(schema).map_err(&failed)?;
        let unfinished = Unfinished::create(path)?;
        let file = SerializedFileWriter::new(unfinished, parquet, Arc::new(properties));
        Ok(Self {
            path: path.to_owned(),
            file: file.map_err(&failed)?,
            pending: Table::new(schema),
            schema: schema.clone(),
        })
    }

    /// Adds rows.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub(super) fn push(&mut self, rows: Table) -> Result<()> {
        self.pending.append(rows);
        while self.pending.rows() >= GROUP {
            let group = self.pending.take(GROUP);
            self.write(&group)?;
        }
        Ok(())
    }

    fn write(&mut self, group: &Table) -> Result<()> {
        let failed = unwritten(&self.path);
        let mut writer = self.file.next_row_group().map_err(&failed)?;
        for column in &group.columns {
            let next = writer.next_column().map_err(&failed)?;
            let Some(mut next) = next else { break };
            column.write(next.untyped()).map_err(&failed)?;
            next.close().map_err(&failed)?;
        }
        writer.close().map_err(&failed)?;
        Ok(())
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub(super) fn finish(mut self) -> Result<()> {
        if self.pending.rows() > 0 {
            let rest = std::mem::replace(&mut self.pending, Table::new(&self.schema));
            self.write(&rest)?;
        }
        let failed = unwritten(&self.path);
        let mut written = self.file.into_inner().map_err(failed)?;
        digest::put(&mut written).map_err(Error::write(&self.path))?;
        written.finish()
    }
}

fn unwritten(path: &Path) -> impl Fn(ParquetError) -> Error + use<> {
    let path = path.to_owned();
    move |error| Error::Write {
        path: path.clone(),
        source: std::io::Error::other(error.to_string()),
    }
}

/// A file that is there.
pub(super) struct Reader {
    path: PathBuf,
    file: SerializedFileReader<File>,
    pub(super) header: Header,
    pub(super) schema: Schema,
}

impl Reader {
    /// Opens a file and reads what it is of.
    ///
    /// # Errors
    /// [`Error::Read`], or [`Error::Input`] when it is no whole file of a sweep.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let mut opened = File::open(path).map_err(Error::read(path))?;
        digest::require(&mut opened, path)?;
        let file = SerializedFileReader::new(opened).map_err(unreadable(path))?;
        let metadata = file.metadata().file_metadata();
        let header = metadata
            .key_value_metadata()
            .and_then(|pairs| Header::of(pairs));
        let schema = schema_of(metadata.schema());
        let (Some(header), Some(schema)) = (header, schema) else {
            return Err(wrong(path, "is no file of a sweep".into()));
        };
        let (found, expected) = (metadata.num_rows(), header.rows());
        if u64::try_from(found) != Ok(expected) {
            return Err(wrong(
                path,
                format!("has {found} rows and should have {expected}"),
            ));
        }
        Ok(Self {
            path: path.to_owned(),
            file,
            header,
            schema,
        })
    }

    /// Its file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Its rows, group by group.
    pub(super) fn groups(&self) -> impl Iterator<Item = Result<Table>> {
        (0..self.file.num_row_groups()).map(|number| {
            let failed = unreadable(&self.path);
            let group = self.file.get_row_group(number).map_err(&failed)?;
            let rows = group.metadata().num_rows() as usize;
            let columns = (0..group.num_columns()).map(|column| {
                let reader = group.get_column_reader(column)?;
                Column::read(reader, rows)
            });
            let columns = columns.collect::<std::result::Result<_, _>>();
            Ok(Table {
                columns: columns.map_err(&failed)?,
            })
        })
    }
}

fn unreadable(path: &Path) -> impl Fn(ParquetError) -> Error + use<> {
    let path = path.to_owned();
    move |error| wrong(&path, format!("is no whole Parquet file: {error}"))
}

/// A file that cannot be used.
pub(super) fn wrong(path: &Path, message: String) -> Error {
    Error::Input {
        place: path.display().to_string(),
        message,
    }
}

#[cfg(test)]
mod tests {
    use super::super::merge::merge;
    use super::super::table::{Cell, Kind};
    use super::*;
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    fn header(rows: u64) -> Header {
        Header {
            identity: Identity {
                texts: vec![
                    ("sweep".into(), "seed = 1".into()),
                    ("drive".into(), "x".into()),
                ],
                sha256: "ab".into(),
                version: "1".into(),
                sources: "cd".into(),
                seed: 1,
                count: rows,
                laws: 1,
            },
            shard: Shard::WHOLE,
            samples: 0..rows,
        }
    }

    /// The same rows in pieces of any size make the same bytes, and come back as they were.
    #[test]
    fn pieces_do_not_show_in_the_file() {
        let schema: Schema = vec![
            ("n".into(), Kind::Integer),
            ("plant.load.*.mass".into(), Kind::Number),
            ("t".into(), Kind::Text),
        ];
        let rows = GROUP + 1234;
        let row = |i: usize| {
            vec![
                Cell::Integer((!i.is_multiple_of(3)).then_some(i as i64)),
                Cell::Number((!i.is_multiple_of(5)).then_some((i as f64).sqrt())),
                Cell::Text((!i.is_multiple_of(7)).then(|| format!("row {i}"))),
            ]
        };
        let folder = tempfile::tempdir().unwrap();
        let header = header(rows as u64);
        let mut whole = Table::new(&schema);
        (0..rows).for_each(|i| whole.push(row(i)));
        let written = |piece: usize| {
            let path = folder.path().join(format!("{piece}.parquet"));
            let mut writer = Writer::create(&path, &schema, &header).unwrap();
            let mut rest = whole.clone();
            while rest.rows() > 0 {
                let next = rest.take(piece.min(rest.rows()));
                writer.push(next).unwrap();
            }
            writer.finish().unwrap();
            std::fs::read(path).unwrap()
        };
        let bytes = written(rows);
        assert!(written(100) == bytes && written(GROUP) == bytes);
        let reader = Reader::open(&folder.path().join("100.parquet")).unwrap();
        assert_eq!(reader.header, header);
        assert_eq!(reader.schema, schema);
        let mut back = Table::new(&schema);
        for group in reader.groups() {
            back.append(group.unwrap());
        }
        assert_eq!(back, whole);
    }

    /// A part of two, of a sweep of eight samples.
    fn part(path: &Path, number: u64, sources: &str) -> Vec<u8> {
        let schema: Schema = vec![
            ("sample".into(), Kind::Integer),
            ("law".into(), Kind::Text),
            ("plant.load.1.mass".into(), Kind::Number),
        ];
        let mut header = header(8);
        header.identity.sources = sources.into();
        header.shard = format!("{number}/2").parse().unwrap();
        header.samples = header.shard.samples(8);
        let mut rows = Table::new(&schema);
        for sample in header.samples.clone() {
            rows.push(vec![
                Cell::Integer(Some(sample as i64)),
                Cell::Text(Some("drive".into())),
                Cell::Number((sample != 6).then_some((sample as f64).sqrt())),
            ]);
        }
        let mut writer = Writer::create(path, &schema, &header).unwrap();
        writer.push(rows).unwrap();
        writer.finish().unwrap();
        std::fs::read(path).unwrap()
    }

    /// Every bit by itself, and two or three anywhere: a damaged part is refused in a sentence, before any decoder has
    /// seen it.
    #[test]
    fn a_part_with_flipped_bits_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["1.parquet", "2.parquet"].map(|name| folder.path().join(name));
        let out = folder.path().join("whole.parquet");
        part(&paths[0], 1, "cd");
        let bytes = part(&paths[1], 2, "cd");
        assert!(merge(&out, &paths, &crate::output::unwatched).is_ok());
        let whole = std::fs::read(&out).unwrap();
        let bits = 8 * bytes.len();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let some = (0..4000).map(|k| {
            let each = (0..2 + k % 2).map(|_| random.random_range(0..bits));
            each.collect::<std::collections::BTreeSet<_>>()
        });
        let each = (0..bits).map(|bit| [bit].into());
        for flipped in each.chain(some) {
            let mut damaged = bytes.clone();
            for bit in &flipped {
                damaged[bit / 8] ^= 1 << (bit % 8);
            }
            std::fs::write(&paths[1], damaged).unwrap();
            let error = merge(&out, &paths, &crate::output::unwatched).unwrap_err();
            let sentence = error.to_string();
            assert!(error.exit_code() == 2, "{flipped:?}: {sentence}");
            assert!(
                sentence.contains("2.parquet: ") && sentence.lines().count() == 1,
                "{sentence}"
            );
        }
        assert!(std::fs::read(&out).unwrap() == whole);
    }

    #[test]
    fn parts_of_two_builds_are_not_merged() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["1.parquet", "2.parquet"].map(|name| folder.path().join(name));
        part(&paths[0], 1, "cd");
        part(&paths[1], 2, "ef");
        let out = folder.path().join("whole.parquet");
        let error = merge(&out, &paths, &crate::output::unwatched).unwrap_err();
        let sentence = error.to_string();
        assert!(
            sentence.contains("2.parquet: was made by the build ef, and "),
            "{sentence}"
        );
        assert!(!out.exists());
    }

    #[test]
    fn what_is_cut_off_is_no_file() {
        let schema: Schema = vec![("n".into(), Kind::Integer)];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let writer = Writer::create(&path, &schema, &header(0)).unwrap();
        assert!(!path.exists());
        writer.finish().unwrap();
        assert!(Reader::open(&path).is_ok());
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 20]).unwrap();
        let error = Reader::open(&path).err().unwrap();
        assert!(
            error.to_string().contains("no whole Parquet file"),
            "{error}"
        );
        assert_eq!(error.exit_code(), 2);
    }
}
