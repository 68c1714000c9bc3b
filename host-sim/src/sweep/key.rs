//! A key of a drive or plant file as a sweep names it: the names of its tables and itself, with a dot between
//! them; an element of a list by its number from 1, all of them by `*`.

use super::distribution::number;
use toml::{Table, Value};

/// One step on the way to a value.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Name(String),
    /// From 0.
    Element(usize),
    All,
}

/// The way to a value, or to several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Path(Vec<Step>);

impl Path {
    /// * `text`: without the file
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let steps = text.split('.').map(|step| match step {
            "" => Err("a name is missing between its dots".to_owned()),
            "*" => Ok(Step::All),
            _ if step.bytes().all(|byte| byte.is_ascii_digit()) => match step.parse::<usize>() {
                Ok(count) if count > 0 => Ok(Step::Element(count - 1)),
                _ => Err(format!("{step}: elements are counted from 1")),
            },
            name => Ok(Step::Name(name.to_owned())),
        });
        steps.collect::<Result<_, _>>().map(Self)
    }

    /// The paths of all single elements behind its `*`, each with how it is written.
    ///
    /// # Errors
    /// Where there is no list.
    pub(super) fn each(&self, document: &Table) -> Result<Vec<Self>, String> {
        let Some(at) = self.0.iter().position(|step| *step == Step::All) else {
            return Ok(vec![self.clone()]);
        };
        let mut list = Value::Table(document.clone());
        for step in &self.0[..at] {
            let next = match (step, &list) {
                (Step::Name(name), Value::Table(table)) => table.get(name),
                (Step::Element(index), Value::Array(list)) => list.get(*index),
                _ => None,
            };
            list = next.cloned().unwrap_or(Value::Boolean(false));
        }
        let Value::Array(list) = list else {
            return Err("there is no list where it has a `*`".into());
        };
        let mut found = Vec::new();
        for index in 0..list.len() {
            let mut one = self.clone();
            one.0[at] = Step::Element(index);
            found.extend(one.each(document)?);
        }
        Ok(found)
    }

    /// Sets a value; all of them where it has a `*`.
    ///
    /// * `relative`: whether it multiplies what is there
    ///
    /// # Errors
    /// Where there is no such place, or no number to multiply.
    pub(super) fn set(
        &self,
        document: &mut Table,
        value: &Value,
        relative: bool,
    ) -> Result<(), String> {
        set_in_table(&self.0, document, value, relative)
    }
}

impl std::fmt::Display for Path {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (k, step) in self.0.iter().enumerate() {
            let dot = if k == 0 { "" } else { "." };
            match step {
                Step::Name(name) => write!(f, "{dot}{name}")?,
                Step::Element(index) => write!(f, "{dot}{}", index + 1)?,
                Step::All => write!(f, "{dot}*")?,
            }
        }
        Ok(())
    }
}

fn set_in_table(
    steps: &[Step],
    table: &mut Table,
    value: &Value,
    relative: bool,
) -> Result<(), String> {
    let Some((Step::Name(name), rest)) = steps.split_first() else {
        return Err("a table has names, not elements".into());
    };
    if rest.is_empty() {
        let new = multiplied(name, table.get(name), value, relative)?;
        table.insert(name.clone(), new);
        return Ok(());
    }
    // A table that is not there yet is begun; whether the file can have it, its reader says.
    let begun = || Value::Table(Table::new());
    let next = table.entry(name.clone()).or_insert_with(begun);
    set_in(name, rest, next, value, relative)
}

/// * `name`: of what is set in
fn set_in(
    name: &str,
    steps: &[Step],
    inside: &mut Value,
    value: &Value,
    relative: bool,
) -> Result<(), String> {
    let list = match inside {
        Value::Table(table) if matches!(steps.first(), Some(Step::Name(_))) => {
            return set_in_table(steps, table, value, relative);
        }
        Value::Array(list) => list,
        _ => return Err(format!("`{name}` is no list in the file")),
    };
    let (chosen, rest) = match steps.split_first() {
        Some((Step::All, rest)) => (0..list.len(), rest),
        Some((Step::Element(index), rest)) if *index < list.len() => (*index..*index + 1, rest),
        Some((Step::Element(index), _)) => {
            let (count, wanted) = (list.len(), index + 1);
            return Err(format!("`{name}` has {count} in the file, and no {wanted}"));
        }
        _ => {
            return Err(format!(
                "`{name}` is a list: name one of it by its number, or all by `*`"
            ));
        }
    };
    for one in &mut list[chosen] {
        if rest.is_empty() {
            *one = multiplied(name, Some(one), value, relative)?;
        } else {
            set_in(name, rest, one, value, relative)?;
        }
    }
    Ok(())
}

fn multiplied(
    name: &str,
    stands: Option<&Value>,
    value: &Value,
    relative: bool,
) -> Result<Value, String> {
    if !relative {
        return Ok(value.clone());
    }
    let stands = stands.ok_or_else(|| {
        format!("`{name}` is not stated in the file: there is nothing it could be relative to")
    })?;
    match (number(stands), number(value)) {
        (Some(stands), Some(factor)) => Ok(Value::Float(stands * factor)),
        _ => Err(format!(
            "`{name}` is no number in the file: nothing can be relative to it"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document() -> Table {
        toml::from_str("a = 2\nlist = [1.0, 4.0]\n[[load]]\nk = 10.0\n[[load]]\nk = 20.0").unwrap()
    }

    fn set(key: &str, value: f64, relative: bool) -> Result<Table, String> {
        let mut document = document();
        let path = Path::parse(key)?;
        path.set(&mut document, &Value::Float(value), relative)?;
        Ok(document)
    }

    #[test]
    fn values_are_set_where_they_are_named() {
        let k = |table: &Table| -> Vec<f64> {
            let loads = table["load"].as_array().unwrap().iter();
            loads.map(|load| load["k"].as_float().unwrap()).collect()
        };
        assert_eq!(k(&set("load.*.k", 1.5, true).unwrap()), [15.0, 30.0]);
        assert_eq!(k(&set("load.2.k", 1.5, true).unwrap()), [10.0, 30.0]);
        assert_eq!(k(&set("load.*.k", 1.5, false).unwrap()), [1.5, 1.5]);
        let list = &set("list.1", 3.0, true).unwrap()["list"];
        assert_eq!(list.as_array().unwrap()[0].as_float(), Some(3.0));
        assert_eq!(set("a", 0.5, true).unwrap()["a"].as_float(), Some(1.0));
        let new = set("friction.coulomb", 0.1, false).unwrap();
        assert_eq!(new["friction"]["coulomb"].as_float(), Some(0.1));
    }

    #[test]
    fn places_that_are_none_are_named() {
        for (key, part) in [
            ("load.3.k", "`load` has 2 in the file, and no 3"),
            ("load.0.k", "counted from 1"),
            ("load.k", "`load` is a list"),
            ("a.b", "`a` is no list"),
            ("a..b", "a name is missing"),
            ("friction.coulomb", "not stated in the file"),
            ("load", "no number in the file"),
        ] {
            let error = set(key, 2.0, true).unwrap_err();
            assert!(error.contains(part), "{key}: {error}");
        }
    }

    #[test]
    fn each_element_is_a_path_of_its_own() {
        let each = Path::parse("load.*.k").unwrap().each(&document()).unwrap();
        let names: Vec<String> = each.iter().map(ToString::to_string).collect();
        assert_eq!(names, ["load.1.k", "load.2.k"]);
        assert!(Path::parse("a.*").unwrap().each(&document()).is_err());
    }
}
