//! The samples of a sweep: which values each has, and the drive and the plant they make.
//!
//! ```text
//! (seed, number of the sample) -> values -> drive.toml and plant.toml with them -> Drive, PlantFile
//! ```
//!
//! The varied files go through the readers of drive and plant files themselves: a key need not be known here,
//! and what those refuse is refused. The plant is its own file where there is one, and otherwise the
//! drive as it is varied; its keys are varied after that.

use super::description::{Description, Vary};
use super::distribution::{Distribution, number};
use super::key::Path;
use crate::drive::{Drive, PlantFile};
use crate::error::{Error, Result};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use toml::{Table, Value};

/// Tables of a drive file that say nothing of what is there.
const BELIEFS: [&str; 6] = ["control", "observer", "cost", "gain", "move", "protection"];
/// Most samples of a sweep, grid and draws together.
const MOST: u64 = 1_000_000_000;

/// Which file a key belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Of {
    Drive,
    Plant,
}

/// A key with one value in every sample.
struct Key {
    /// File and path.
    name: String,
    of: Of,
    path: Path,
    distribution: Distribution,
    relative: bool,
}

/// All samples.
pub(super) struct Variation {
    seed: u64,
    /// For each point of the grid.
    draws: u64,
    count: u64,
    drive: Table,
    plant: Option<Table>,
    keys: Vec<Key>,
}

impl Variation {
    /// Checks that every key is one of its file, and that all its values are allowed.
    ///
    /// * `drive`, `plant`: the files' texts, known to be good
    ///
    /// # Errors
    /// [`Error::Input`].
    pub(super) fn new(description: &Description, drive: &str, plant: Option<&str>) -> Result<Self> {
        let table = |text: &str| -> Result<Table> {
            let parsed = toml::from_str(text);
            parsed.map_err(|error| description.error(None, error.message().into()))
        };
        let mut variation = Self {
            seed: description.seed,
            draws: description.samples,
            count: 0,
            drive: table(drive)?,
            plant: plant.map(table).transpose()?,
            keys: Vec::new(),
        };
        for vary in &description.vary {
            let keys = variation
                .keys_of(vary)
                .map_err(|why| wrong(description, vary, &why))?;
            let others = variation.keys.iter();
            let twice = |key: &Key| others.clone().find(|other| overlap(&key.name, &other.name));
            if let Some((key, other)) = keys.iter().find_map(|key| Some((key, twice(key)?))) {
                let why = format!(
                    "{} varies by another line as well, {}",
                    key.name, other.name
                );
                return Err(wrong(description, vary, &why));
            }
            variation.keys.extend(keys);
        }
        let mut count = Some(description.samples);
        for key in &variation.keys {
            count = count.and_then(|count| count.checked_mul(key.distribution.points() as u64));
        }
        let count = count.filter(|count| *count <= MOST);
        variation.count = count.ok_or_else(|| {
            description.error(None, format!("grid and samples together: at most {MOST}"))
        })?;
        variation.require_allowed(description)?;
        Ok(variation)
    }

    /// The keys that a line of the file stands for.
    fn keys_of(&self, vary: &Vary) -> std::result::Result<Vec<Key>, String> {
        let distribution = vary.stated.distribution()?;
        let (of, path) = match vary.key.split_once('.') {
            Some(("drive", path)) => (Of::Drive, path),
            Some(("plant", path)) => (Of::Plant, path),
            _ => return Err("must begin with `drive.` or `plant.`".into()),
        };
        let table = path.split('.').next().unwrap_or_default();
        if of == Of::Plant && BELIEFS.contains(&table) {
            return Err(format!(
                "a plant has no `{table}`: what the drive does is varied as `drive.{path}`"
            ));
        }
        let path = Path::parse(path)?;
        let paths = if vary.stated.each {
            let document = match of {
                Of::Drive => self.drive.clone(),
                Of::Plant => self.plant_table(&self.drive),
            };
            path.each(&document)?
        } else {
            vec![path]
        };
        let of_file = match of {
            Of::Drive => "drive",
            Of::Plant => "plant",
        };
        let keys = paths.into_iter().map(|path| Key {
            name: format!("{of_file}.{path}"),
            of,
            path,
            distribution: distribution.clone(),
            relative: vary.stated.relative,
        });
        Ok(keys.collect())
    }

    /// Every end of every distribution must make files that can be read, the other keys at their first ends.
    fn require_allowed(&self, description: &Description) -> Result<()> {
        let ends = |key: &Key| key.distribution.ends().into_iter().next();
        let first: Vec<Value> = self.keys.iter().filter_map(ends).collect();
        let mut at = 0;
        for vary in &description.vary {
            let keys = self.keys_of(vary).unwrap_or_default().len();
            for k in at..at + keys {
                for end in self.keys[k].distribution.ends() {
                    let mut values = first.clone();
                    values[k] = end;
                    let made = self.drive(&values).and_then(|_| self.plant(&values));
                    made.map_err(|why| wrong(description, vary, &why))?;
                }
            }
            at += keys;
        }
        Ok(())
    }

    /// How many samples.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Names of the keys, and whether their values are numbers.
    pub(super) fn keys(&self) -> impl Iterator<Item = (&str, bool)> {
        let keys = self.keys.iter();
        keys.map(|key| (&key.name[..], key.distribution.numeric()))
    }

    /// Whether every sample is designed anew.
    pub(super) fn designs(&self) -> bool {
        self.keys.iter().any(|key| key.of == Of::Drive)
    }

    /// What the keys are in one sample.
    pub(super) fn values(&self, sample: u64) -> Vec<Value> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(sample);
        let mut point = (sample / self.draws) as usize;
        let mut points = vec![0; self.keys.len()];
        // The last key is the first to change.
        for (at, key) in points.iter_mut().zip(&self.keys).rev() {
            *at = point % key.distribution.points();
            point /= key.distribution.points();
        }
        let keys = self.keys.iter().zip(points);
        keys.map(|(key, point)| key.distribution.draw(&mut random, point))
            .collect()
    }

    /// The drive of one sample.
    ///
    /// # Errors
    /// What of it cannot be.
    pub(super) fn drive(&self, values: &[Value]) -> std::result::Result<Drive, String> {
        let table = self.varied(&self.drive, values, Of::Drive)?;
        Drive::parse(&toml_of(&table)?, "drive").map_err(|error| message(&error))
    }

    /// The plant of one sample.
    ///
    /// # Errors
    /// What of it cannot be.
    pub(super) fn plant(&self, values: &[Value]) -> std::result::Result<PlantFile, String> {
        let base = if self.plant.is_some() {
            self.plant_table(&self.drive)
        } else {
            self.plant_table(&self.varied(&self.drive, values, Of::Drive)?)
        };
        let table = self.varied(&base, values, Of::Plant)?;
        PlantFile::parse(&toml_of(&table)?, "plant").map_err(|error| message(&error))
    }

    /// The plant before its keys are varied.
    fn plant_table(&self, drive: &Table) -> Table {
        self.plant.clone().unwrap_or_else(|| {
            let mut table = drive.clone();
            table.retain(|name, _| !BELIEFS.contains(&name));
            table
        })
    }

    fn varied(&self, base: &Table, values: &[Value], of: Of) -> std::result::Result<Table, String> {
        let mut table = base.clone();
        let keys = self.keys.iter().zip(values);
        for (key, value) in keys.filter(|(key, _)| key.of == of) {
            key.path.set(&mut table, value, key.relative)?;
        }
        Ok(table)
    }
}

/// Whether two keys have a value in common: one names what the other does, an element of it, or all of its kind.
fn overlap(one: &str, other: &str) -> bool {
    let steps = one.split('.').zip(other.split('.'));
    let number = |step: &str| step.parse::<usize>().is_ok();
    let same = |a: &str, b: &str| a == b || (a == "*" && number(b)) || (b == "*" && number(a));
    steps.into_iter().all(|(a, b)| same(a, b))
}

/// A value as a column of numbers or of texts has it.
pub(super) fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// A value of a column of numbers.
pub(super) fn figure(value: &Value) -> Option<f64> {
    number(value)
}

fn wrong(description: &Description, vary: &Vary, why: &str) -> Error {
    description.error(Some(&vary.span), format!("vary.\"{}\": {why}", vary.key))
}

fn toml_of(table: &Table) -> std::result::Result<String, String> {
    toml::to_string(table).map_err(|error| error.to_string())
}

/// What is wrong, without the line of a text that nobody sees.
fn message(error: &Error) -> String {
    match error {
        Error::Input { message, .. } => message.clone(),
        Error::PlantOnly { what, .. } => format!("{what} belongs into a plant file"),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::DEFAULT_DRIVE;

    fn variation(vary: &str) -> Result<Variation> {
        let text = format!(
            "seed = 5\nsamples = 3\nstep = 0.03\nduration = 1.0\nlaws = [\"drive\"]\n[vary]\n{vary}"
        );
        let description = Description::parse(&text, "sweep.toml")?;
        Variation::new(&description, DEFAULT_DRIVE, None)
    }

    /// A plant that nothing varies is the drive as the controller believes it.
    #[test]
    fn without_its_own_keys_the_plant_is_the_drive() {
        let variation =
            variation("\"drive.load.3.mass\" = { uniform = [1.1, 1.5], relative = true }").unwrap();
        let values = variation.values(1);
        let drive = variation.drive(&values).unwrap();
        let mut expected = PlantFile {
            sample_time: None,
            ..PlantFile::from(&drive)
        };
        // A file without backlash has one of nothing in every spring.
        expected.imperfections.backlash = vec![0.0; 3];
        assert_eq!(variation.plant(&values).unwrap(), expected);
        let factor = drive.loads[2].mass / Drive::default_drive().loads[2].mass;
        assert!((factor - number(&values[0]).unwrap()).abs() < 1e-12);
        assert!(variation.designs());
    }

    /// Keys of the plant leave the drive as it is; one factor for all, or one for each.
    #[test]
    fn one_factor_for_all_or_one_for_each() {
        let stiffness = |vary: &str| -> Vec<f64> {
            let variation = variation(vary).unwrap();
            assert!(!variation.designs());
            let values = variation.values(2);
            let own = Drive::default_drive();
            assert_eq!(variation.drive(&values).unwrap(), own);
            let plant = variation.plant(&values).unwrap();
            let loads = plant.loads.iter().zip(&own.loads);
            loads
                .map(|(load, own)| load.stiffness / own.stiffness)
                .collect()
        };
        let all =
            stiffness("\"plant.load.*.stiffness\" = { uniform = [0.7, 1.3], relative = true }");
        assert!(all.iter().all(|factor| (factor - all[0]).abs() < 1e-12) && all[0] != 1.0);
        let each = stiffness(
            "\"plant.load.*.stiffness\" = { uniform = [0.7, 1.3], relative = true, each = true }",
        );
        assert!(each[0] != each[1] && each[1] != each[2]);
    }

    /// Every point of a grid comes as often as samples are drawn, and with other draws each time.
    #[test]
    fn a_grid_is_gone_through_from_end_to_end() {
        let variation = variation(
            "\"drive.control.observer\" = { grid = [\"anchored\", \"reaction\"] }\n\
             \"plant.friction.coulomb\" = { grid = [0.0, 0.1] }\n\
             \"plant.load.1.mass\" = { uniform = [0.01, 0.02] }",
        )
        .unwrap();
        assert_eq!(variation.count(), 12);
        let all: Vec<Vec<Value>> = (0..12).map(|sample| variation.values(sample)).collect();
        for observer in ["anchored", "reaction"] {
            for coulomb in [0.0, 0.1] {
                let here = all.iter().filter(|values| {
                    values[0].as_str() == Some(observer) && values[1].as_float() == Some(coulomb)
                });
                assert_eq!(here.count(), 3);
            }
        }
        let mut masses: Vec<String> = all.iter().map(|values| shown(&values[2])).collect();
        masses.sort();
        masses.dedup();
        assert_eq!(masses.len(), 12);
    }

    #[test]
    fn a_key_varies_once() {
        let error = variation(
            "\"plant.load.*.mass\" = { uniform = [0.1, 0.2], each = true }\n\
             \"plant.load.2.mass\" = { uniform = [0.1, 0.2] }",
        );
        let error = error.err().unwrap().to_string();
        assert!(
            error.contains("plant.load.2.mass varies by another line"),
            "{error}"
        );
    }

    /// Whichever line comes first, and whatever its kind.
    #[test]
    fn keys_that_overlap_are_refused() {
        let each = "{ uniform = [0.1, 0.2] }";
        for (one, other) in [
            ("plant.load.*.mass", "plant.load.1.mass"),
            ("plant.load.2.mass", "plant.load.*.mass"),
            ("drive.actuator.mass", "drive.actuator.mass"),
        ] {
            let error = variation(&format!("\"{one}\" = {each}\n\"{other}\" = {each}"));
            let error = error.err().unwrap().to_string();
            assert!(
                error.contains("by another line") || error.contains("duplicate key"),
                "{error}"
            );
        }
        let apart = format!("\"plant.load.1.mass\" = {each}\n\"drive.load.1.mass\" = {each}");
        assert!(variation(&apart).is_ok());
    }

    #[test]
    fn what_no_file_can_have_is_refused_with_its_key_and_line() {
        for (vary, part) in [
            (
                "\"plant.load.3.mas\" = { uniform = [1.0, 2.0] }",
                "unknown field `mas`",
            ),
            (
                "\"plant.load.4.mass\" = { uniform = [1.0, 2.0] }",
                "has 3 in the file, and no 4",
            ),
            (
                "\"plant.cost.current\" = { choice = [1.0, 2.0] }",
                "a plant has no `cost`",
            ),
            (
                "\"plant.gain.position.1\" = { choice = [1.0, 2.0] }",
                "a plant has no `gain`",
            ),
            (
                "\"plant.friction.coulomb\" = { uniform = [-1e308, 1e308] }",
                "their difference finite",
            ),
            (
                "\"load.3.mass\" = { uniform = [1.0, 2.0] }",
                "must begin with `drive.` or `plant.`",
            ),
            (
                "\"plant.load.3.mass\" = { uniform = [-1.0, 2.0] }",
                "mass = -1",
            ),
            (
                "\"plant.load.3.mass\" = { choice = [\"heavy\"] }",
                "invalid type",
            ),
            (
                "\"drive.encoder.counter_bits\" = { uniform = [8.0, 16.0] }",
                "invalid type",
            ),
            (
                "\"drive.friction.backlash\" = { choice = [0.1] }",
                "unknown field `backlash`",
            ),
            (
                "\"drive.load.1.backlash\" = { choice = [0.1] }",
                "belongs into a plant file",
            ),
            (
                "\"plant.friction.coulomb\" = { uniform = [0.5, 1.0], relative = true }",
                "not stated in the file",
            ),
            (
                "plant.friction.coulomb = { uniform = [0.0, 0.1] }",
                "must stand in quotes",
            ),
            (
                "\"plant.friction.coulomb\" = { uniform = [0.2, 0.1] }",
                "the first below the second",
            ),
            (
                "\"plant.friction.coulomb\" = { evenly = [0.1, 0.2] }",
                "unknown field `evenly`",
            ),
        ] {
            let error = variation(vary).err().expect(vary).to_string();
            assert!(error.contains(part), "{vary}: {error}");
            assert!(error.starts_with("sweep.toml:7: vary."), "{vary}: {error}");
        }
    }
}
