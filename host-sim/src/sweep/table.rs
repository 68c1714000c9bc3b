//! Rows of a sweep as they are kept: column by column, each of one kind, with places that hold nothing.

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::{Type, TypePtr};
use std::sync::Arc;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Integer,
    Number,
    Text,
}

/// The columns: names and kinds.
pub(super) type Schema = Vec<(String, Kind)>;

/// A column.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Column {
    Integer(Vec<Option<i64>>),
    Number(Vec<Option<f64>>),
    Text(Vec<Option<String>>),
}

/// One value of a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    Integer(Option<i64>),
    Number(Option<f64>),
    Text(Option<String>),
}

/// Some rows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    pub(super) columns: Vec<Column>,
}

impl Column {
    fn new(kind: Kind) -> Self {
        match kind {
            Kind::Integer => Self::Integer(Vec::new()),
            Kind::Number => Self::Number(Vec::new()),
            Kind::Text => Self::Text(Vec::new()),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Integer(values) => values.len(),
            Self::Number(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }

    /// Takes the first rows out.
    fn take(&mut self, rows: usize) -> Self {
        match self {
            Self::Integer(values) => Self::Integer(values.drain(..rows).collect()),
            Self::Number(values) => Self::Number(values.drain(..rows).collect()),
            Self::Text(values) => Self::Text(values.drain(..rows).collect()),
        }
    }

    fn append(&mut self, other: Self) {
        match (self, other) {
            (Self::Integer(own), Self::Integer(more)) => own.extend(more),
            (Self::Number(own), Self::Number(more)) => own.extend(more),
            (Self::Text(own), Self::Text(more)) => own.extend(more),
            // Tables of one schema are put together.
            _ => {}
        }
    }

    /// Writes it as a column of a Parquet file.
    pub(super) fn write(&self, writer: &mut ColumnWriter<'_>) -> Result<()> {
        match (self, writer) {
            (Self::Integer(values), ColumnWriter::Int64ColumnWriter(writer)) => {
                let (there, present) = split(values, |value| *value);
                writer.write_batch(&present, Some(&there), None)?;
            }
            (Self::Number(values), ColumnWriter::DoubleColumnWriter(writer)) => {
                let (there, present) = split(values, |value| *value);
                writer.write_batch(&present, Some(&there), None)?;
            }
            (Self::Text(values), ColumnWriter::ByteArrayColumnWriter(writer)) => {
                let (there, present) = split(values, |text| ByteArray::from(&text[..]));
                writer.write_batch(&present, Some(&there), None)?;
            }
            _ => return Err(ParquetError::General("a column of another kind".into())),
        }
        Ok(())
    }

    /// Reads it from a Parquet file.
    pub(super) fn read(reader: ColumnReader, rows: usize) -> Result<Self> {
        let mut there = Vec::with_capacity(rows);
        let column = match reader {
            ColumnReader::Int64ColumnReader(mut reader) => {
                let mut present = Vec::new();
                reader.read_records(rows, Some(&mut there), None, &mut present)?;
                Self::Integer(joined(&there, present))
            }
            ColumnReader::DoubleColumnReader(mut reader) => {
                let mut present = Vec::new();
                reader.read_records(rows, Some(&mut there), None, &mut present)?;
                Self::Number(joined(&there, present))
            }
            ColumnReader::ByteArrayColumnReader(mut reader) => {
                let mut present: Vec<ByteArray> = Vec::new();
                reader.read_records(rows, Some(&mut there), None, &mut present)?;
                let texts = present.iter().map(|bytes| Ok(bytes.as_utf8()?.to_owned()));
                Self::Text(joined(&there, texts.collect::<Result<_>>()?))
            }
            _ => return Err(ParquetError::General("a column of another kind".into())),
        };
        if column.len() == rows {
            Ok(column)
        } else {
            Err(ParquetError::General("a column has too few rows".into()))
        }
    }
}

/// Which are there, and those.
fn split<T, U>(values: &[Option<T>], of: impl Fn(&T) -> U) -> (Vec<i16>, Vec<U>) {
    let there = values.iter().map(|value| i16::from(value.is_some()));
    (there.collect(), values.iter().flatten().map(of).collect())
}

fn joined<T>(there: &[i16], present: Vec<T>) -> Vec<Option<T>> {
    let mut present = present.into_iter();
    let each = there
        .iter()
        .map(|there| if *there > 0 { present.next() } else { None });
    each.collect()
}

impl Table {
    /// No rows yet.
    pub(super) fn new(schema: &Schema) -> Self {
        Self {
            columns: schema.iter().map(|(_, kind)| Column::new(*kind)).collect(),
        }
    }

    /// How many rows.
    pub(super) fn rows(&self) -> usize {
        self.columns.first().map_or(0, Column::len)
    }

    /// Adds a row, a cell for each column and of its kind.
    pub(super) fn push(&mut self, row: Vec<Cell>) {
        for (column, cell) in self.columns.iter_mut().zip(row) {
            match (column, cell) {
                (Column::Integer(values), Cell::Integer(value)) => values.push(value),
                // Nothing is written that is no number.
                (Column::Number(values), Cell::Number(value)) => {
                    values.push(value.filter(|value| value.is_finite()));
                }
                (Column::Text(values), Cell::Text(value)) => values.push(value),
                (Column::Integer(values), _) => values.push(None),
                (Column::Number(values), _) => values.push(None),
                (Column::Text(values), _) => values.push(None),
            }
        }
    }

    /// Puts the rows of another one of the same schema behind its own.
    pub(super) fn append(&mut self, other: Self) {
        for (own, more) in self.columns.iter_mut().zip(other.columns) {
            own.append(more);
        }
    }

    /// Takes the first rows out.
    pub(super) fn take(&mut self, rows: usize) -> Self {
        let columns = self.columns.iter_mut().map(|column| column.take(rows));
        Self {
            columns: columns.collect(),
        }
    }
}

/// The schema as Parquet has it.
pub(super) fn parquet_schema(schema: &Schema) -> Result<TypePtr> {
    let fields = schema.iter().map(|(name, kind)| {
        let (physical, logical) = match kind {
            Kind::Integer => (Physical::INT64, None),
            Kind::Number => (Physical::DOUBLE, None),
            Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let field = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical);
        Ok(Arc::new(field.build()?))
    });
    let fields = fields.collect::<Result<Vec<_>>>()?;
    let group = Type::group_type_builder("sweep").with_fields(fields);
    Ok(Arc::new(group.build()?))
}

/// The schema of a Parquet file of a sweep; none when it is no such file.
pub(super) fn schema_of(root: &Type) -> Option<Schema> {
    let fields = root.get_fields().iter().map(|field| {
        if !field.is_primitive() {
            return None;
        }
        let kind = match field.get_physical_type() {
            Physical::INT64 => Kind::Integer,
            Physical::DOUBLE => Kind::Number,
            Physical::BYTE_ARRAY => Kind::Text,
            _ => return None,
        };
        Some((field.name().to_owned(), kind))
    });
    fields.collect()
}
