//! The columns of a sweep's file, for programs.

use super::file::Reader;
use super::table;
use crate::error::Result;
use std::path::Path;

/// A column, with a value for every row.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// Numbers, none where there is none.
    Numbers(Vec<Option<f64>>),
    /// Texts.
    Texts(Vec<Option<String>>),
}

/// All columns of a file, by their names.
///
/// # Errors
/// [`Error::Read`](crate::error::Error::Read), or [`Error::Input`](crate::error::Error::Input) when it is no whole file
/// of a sweep.
pub fn columns(path: &Path) -> Result<Vec<(String, Column)>> {
    let reader = Reader::open(path)?;
    let mut whole = table::Table::new(&reader.schema);
    for rows in reader.groups() {
        whole.append(rows?);
    }
    let names = reader.schema.iter().map(|(name, _)| name.clone());
    let columns = whole.columns.into_iter().map(|column| match column {
        table::Column::Integer(values) => {
            let numbers = values.into_iter().map(|value| value.map(|i| i as f64));
            Column::Numbers(numbers.collect())
        }
        table::Column::Number(values) => Column::Numbers(values),
        table::Column::Text(values) => Column::Texts(values),
    });
    Ok(names.zip(columns).collect())
}
