//! A part of a sweep: which samples it has.

use std::ops::Range;
use std::str::FromStr;

/// One of several parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 1.
    number: u64,
    /// Of how many.
    of: u64,
}

/// Most parts.
const MOST: u64 = 1_000_000;

impl Shard {
    /// All of it.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Which, from 1.
    #[must_use]
    pub fn number(self) -> u64 {
        self.number
    }

    /// Of how many.
    #[must_use]
    pub fn of(self) -> u64 {
        self.of
    }

    /// Its samples.
    ///
    /// * `count`: of all parts
    #[must_use]
    pub fn samples(self, count: u64) -> Range<u64> {
        let end = |number: u64| {
            let end = u128::from(count) * u128::from(number) / u128::from(self.of);
            end as u64
        };
        end(self.number - 1)..end(self.number)
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("must be I/N with I from 1 to N and N at most {MOST}");
        let (number, of) = text.split_once('/').ok_or_else(wrong)?;
        let shard = Self {
            number: number.parse().map_err(|_| wrong())?,
            of: of.parse().map_err(|_| wrong())?,
        };
        if (1..=shard.of).contains(&shard.number) && shard.of <= MOST {
            Ok(shard)
        } else {
            Err(wrong())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All parts together have every sample once, and none has more than one more than another.
    #[test]
    fn parts_share_the_samples_evenly() {
        for (count, of) in [(10, 3), (2, 5), (0, 2), (1_000_000_000, 7)] {
            let mut next = 0;
            for number in 1..=of {
                let shard: Shard = format!("{number}/{of}").parse().unwrap();
                let samples = shard.samples(count);
                assert_eq!(samples.start, next);
                let size = samples.end - samples.start;
                assert!(size == count / of || size == count.div_ceil(of));
                next = samples.end;
            }
            assert_eq!(next, count);
        }
        for text in ["0/2", "3/2", "1", "1/0", "-1/2", "1/2000000", "a/b"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
