//! From what a value of a sweep is drawn, and the checks of what the file says of it.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use serde::Deserialize;
use toml::Value;

/// Less of a normal distribution than this must not be left by `within`: it is drawn again until it is inside.
const LEAST_SHARE: f64 = 0.01;

/// What stands beside a key under `[vary]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Stated {
    uniform: Option<[f64; 2]>,
    log_uniform: Option<[f64; 2]>,
    normal: Option<[f64; 2]>,
    within: Option<[f64; 2]>,
    choice: Option<Vec<Value>>,
    grid: Option<Vec<Value>>,
    /// Whether what is drawn multiplies the value of the file.
    #[serde(default)]
    pub(super) relative: bool,
    /// Whether every element behind a `*` is drawn by itself.
    #[serde(default)]
    pub(super) each: bool,
}

/// The words of which one names the distribution.
pub(super) const WORDS: [&str; 5] = ["uniform", "log_uniform", "normal", "choice", "grid"];

/// Where a value comes from.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Distribution {
    /// Between two ends, all equally likely.
    Uniform([f64; 2]),
    /// Between two ends, its logarithm equally likely.
    LogUniform([f64; 2]),
    /// Mean and standard deviation; drawn again until it is within two ends.
    Normal([f64; 2], Option<[f64; 2]>),
    /// One of several, all equally likely.
    Choice(Vec<Value>),
    /// All of several, one after the other.
    Grid(Vec<Value>),
}

impl Stated {
    /// The distribution.
    ///
    /// # Errors
    /// What is wrong with it, and what is allowed.
    pub(super) fn distribution(&self) -> Result<Distribution, String> {
        let mut found = Vec::new();
        if let Some(ends) = self.uniform {
            rising("uniform", ends)?;
            found.push(Distribution::Uniform(ends));
        }
        if let Some(ends) = self.log_uniform {
            rising("log_uniform", ends)?;
            if ends[0] <= 0.0 {
                return Err(format!("log_uniform = {ends:?}: both must be positive"));
            }
            found.push(Distribution::LogUniform(ends));
        }
        if let Some([mean, deviation]) = self.normal {
            if !(mean.is_finite() && deviation.is_finite() && deviation > 0.0) {
                return Err(format!(
                    "normal = {:?}: must be a mean and a standard deviation, which is positive",
                    [mean, deviation]
                ));
            }
            if let Some(ends) = self.within {
                rising("within", ends)?;
                let [low, high] = ends.map(|end| (end - mean) / deviation);
                let share = below(high) - below(low);
                if share < LEAST_SHARE {
                    return Err(format!(
                        "within = {ends:?}: must hold {} % of the distribution at least",
                        100.0 * LEAST_SHARE
                    ));
                }
            }
            found.push(Distribution::Normal([mean, deviation], self.within));
        } else if self.within.is_some() {
            return Err("within: belongs to normal".into());
        }
        for (word, values) in [("choice", &self.choice), ("grid", &self.grid)] {
            let Some(values) = values else { continue };
            if values.is_empty() {
                return Err(format!("{word} = []: must hold one value at least"));
            }
            if self.relative && values.iter().any(|value| number(value).is_none()) {
                return Err(format!(
                    "{word}: must hold numbers only where it is relative"
                ));
            }
            let infinite = |value: &Value| number(value).is_some_and(|x| !x.is_finite());
            if values.iter().any(infinite) {
                return Err(format!("{word}: must hold finite numbers"));
            }
            found.push(match word {
                "choice" => Distribution::Choice(values.clone()),
                _ => Distribution::Grid(values.clone()),
            });
        }
        match (found.pop(), found.is_empty()) {
            (Some(distribution), true) => Ok(distribution),
            _ => Err(format!("must have one of {}", WORDS.join(", "))),
        }
    }
}

/// A number, whole or not.
pub(super) fn number(value: &Value) -> Option<f64> {
    value.as_float().or(value.as_integer().map(|i| i as f64))
}

fn rising(word: &str, [low, high]: [f64; 2]) -> Result<(), String> {
    if low < high && (high - low).is_finite() {
        Ok(())
    } else {
        Err(format!(
            "{word} = {:?}: must be two finite numbers, the first below the second, and their difference finite",
            [low, high]
        ))
    }
}

/// Share of a standard normal distribution that is below.
fn below(x: f64) -> f64 {
    0.5 * libm::erfc(-x / std::f64::consts::SQRT_2)
}

impl Distribution {
    /// One value.
    ///
    /// * `point`: number of the value, for a grid
    pub(super) fn draw(&self, random: &mut ChaCha8Rng, point: usize) -> Value {
        match self {
            Self::Uniform([low, high]) => Value::Float(random.random_range(*low..=*high)),
            Self::LogUniform([low, high]) => {
                let logarithm: f64 = random.random_range(low.ln()..=high.ln());
                Value::Float(logarithm.exp().clamp(*low, *high))
            }
            Self::Normal([mean, deviation], within) => {
                // Both are finite: such a distribution there is.
                let Ok(normal) = Normal::new(*mean, *deviation) else {
                    return Value::Float(*mean);
                };
                let mut value = normal.sample(random);
                while within.is_some_and(|[low, high]| !(low..=high).contains(&value)) {
                    value = normal.sample(random);
                }
                Value::Float(value)
            }
            Self::Choice(values) => values[random.random_range(0..values.len())].clone(),
            Self::Grid(values) => values[point % values.len()].clone(),
        }
    }

    /// How many points it has on the grid.
    pub(super) fn points(&self) -> usize {
        match self {
            Self::Grid(values) => values.len(),
            _ => 1,
        }
    }

    /// The values that must be allowed: the ends, or all there are.
    pub(super) fn ends(&self) -> Vec<Value> {
        match self {
            Self::Uniform(ends) | Self::LogUniform(ends) | Self::Normal(_, Some(ends)) => {
                ends.map(Value::Float).into()
            }
            Self::Normal([mean, _], None) => vec![Value::Float(*mean)],
            Self::Choice(values) | Self::Grid(values) => values.clone(),
        }
    }

    /// Whether all of its values are numbers.
    pub(super) fn numeric(&self) -> bool {
        self.ends().iter().all(|value| number(value).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    fn distribution(text: &str) -> Result<Distribution, String> {
        toml::from_str::<Stated>(text).unwrap().distribution()
    }

    fn drawn(text: &str, count: usize) -> Vec<f64> {
        let distribution = distribution(text).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let drawn = (0..count).map(|_| number(&distribution.draw(&mut random, 0)).unwrap());
        drawn.collect()
    }

    fn moments(values: &[f64]) -> (f64, f64) {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        (mean, variance.sqrt())
    }

    /// Mean and deviation as the textbook has them, within four times what so many draws scatter by.
    #[test]
    fn draws_have_the_moments_of_their_distributions() {
        let count = 20_000;
        let ln2 = std::f64::consts::LN_2;
        // A normal distribution cut at one deviation each way: variance 1 - 2 phi(1) / (2 Phi(1) - 1).
        let cut = (1.0 - 2.0 * 0.241_970_724_5 / 0.682_689_492_1_f64).sqrt();
        for (text, mean, deviation) in [
            ("uniform = [0.7, 1.3]", 1.0, 0.6 / 12.0_f64.sqrt()),
            ("normal = [3.0, 0.5]", 3.0, 0.5),
            ("normal = [3.0, 0.5]\nwithin = [2.5, 3.5]", 3.0, 0.5 * cut),
            (
                "log_uniform = [1.0, 2.0]",
                1.0 / ln2,
                (1.5 / ln2 - (1.0 / ln2).powi(2)).sqrt(),
            ),
            ("choice = [1, 2, 3]", 2.0, (2.0_f64 / 3.0).sqrt()),
        ] {
            let (found, spread) = moments(&drawn(text, count));
            let scatter = 4.0 * deviation / (count as f64).sqrt();
            assert!((found - mean).abs() < scatter, "{text}: {found}");
            assert!((spread / deviation - 1.0).abs() < 0.03, "{text}: {spread}");
        }
        let inside = drawn("normal = [0.0, 1.0]\nwithin = [1.0, 2.0]", 500);
        assert!(inside.iter().all(|x| (1.0..=2.0).contains(x)));
    }

    #[test]
    fn what_cannot_be_drawn_from_is_refused() {
        for (text, part) in [
            ("uniform = [1.0, 1.0]", "the first below the second"),
            ("uniform = [2.0, 1.0]", "the first below the second"),
            ("uniform = [nan, 1.0]", "two finite numbers"),
            ("log_uniform = [0.0, 1.0]", "both must be positive"),
            ("normal = [1.0, 0.0]", "which is positive"),
            (
                "normal = [0.0, 1.0]\nwithin = [8.0, 9.0]",
                "1 % of the distribution",
            ),
            (
                "uniform = [0.0, 1.0]\nwithin = [0.0, 1.0]",
                "belongs to normal",
            ),
            ("choice = []", "one value at least"),
            ("grid = ['a', 1]\nrelative = true", "numbers only"),
            ("grid = [1]\nchoice = [1]", "must have one of"),
            ("relative = true", "must have one of"),
        ] {
            let error = distribution(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
