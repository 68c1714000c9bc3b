//! A Parquet file read row by row, by another way than the program's own.

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use std::collections::HashMap;
use std::path::Path;

/// A row by the names of its columns.
pub struct Row(HashMap<String, Field>);

impl Row {
    /// A number; none where there is nothing.
    pub fn number(&self, name: &str) -> Option<f64> {
        match &self.0[name] {
            Field::Null => None,
            Field::Double(value) => Some(*value),
            Field::Long(value) => Some(*value as f64),
            other => panic!("{name} is {other}"),
        }
    }

    /// A text; none where there is nothing.
    pub fn text(&self, name: &str) -> Option<&str> {
        match &self.0[name] {
            Field::Null => None,
            Field::Str(text) => Some(text),
            other => panic!("{name} is {other}"),
        }
    }
}

/// All rows of a file.
pub fn rows(path: &Path) -> Vec<Row> {
    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    let rows = reader.get_row_iter(None).unwrap();
    let rows = rows.map(|row| Row(row.unwrap().into_columns().into_iter().collect()));
    rows.collect()
}
