//! Numbers into the text of a drive file: everything else, comments included, stays as it was.

use toml_edit::{Item, Value};

/// Replaces a value and keeps the comment behind it; one that is not there yet is added.
pub(crate) fn set(table: &mut Item, key: &str, new: impl Into<Value>) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => {
            let decor = old.decor().clone();
            *old = new.into();
            *old.decor_mut() = decor;
        }
        None => table[key] = toml_edit::value(new),
    }
}

/// Takes a value out, where it is there.
pub(crate) fn remove(table: &mut Item, key: &str) {
    if let Some(table) = table.as_table_like_mut() {
        table.remove(key);
    }
}
