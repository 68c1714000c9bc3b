//! Parts of a sweep put together.

use super::are_one;
use super::file::{Header, Reader, Writer, wrong};
use super::shard::Shard;
use super::summary::{Gathered, Summary};
use crate::error::{Error, Result};
use crate::output::Progress;
use std::path::Path;

/// Writes the file that one machine would have made of the whole sweep, from all of its parts.
///
/// * `progress`: told of each part as its turn comes
///
/// # Errors
/// [`Error::Input`] or [`Error::Usage`] when a part is missing, given twice, not whole, or of another sweep or
/// version; [`Error::Write`].
pub fn merge(out: &Path, parts: &[impl AsRef<Path>], progress: &Progress<'_>) -> Result<Summary> {
    if let Some(part) = parts.iter().find(|part| are_one(part.as_ref(), out)) {
        return Err(Error::Usage(format!(
            "the whole cannot go to {}: that is one of its parts",
            part.as_ref().display()
        )));
    }
    let readers = parts.iter().map(|path| Reader::open(path.as_ref()));
    let mut readers = readers.collect::<Result<Vec<_>>>()?;
    readers.sort_by_key(|reader| reader.header.shard.number());
    let Some(first) = readers.first() else {
        return Err(Error::Usage("there are no parts to merge".into()));
    };
    for other in &readers[1..] {
        require_same(first, other)?;
    }
    let of = first.header.shard.of();
    for (one, next) in readers.iter().zip(&readers[1..]) {
        if one.header.shard == next.header.shard {
            let (shard, other) = (one.header.shard, next.path().display());
            let message = format!("is part {shard}, and so is {other}: each can be there once");
            return Err(wrong(one.path(), message));
        }
    }
    if readers.len() as u64 != of {
        let there = |number: &u64| readers.iter().any(|r| r.header.shard.number() == *number);
        let missing = (1..=of)
            .filter(|number| !there(number))
            .map(|n| n.to_string());
        let missing: Vec<String> = missing.take(20).collect();
        let more = if of - readers.len() as u64 > 20 {
            " and more"
        } else {
            ""
        };
        return Err(Error::Usage(format!(
            "the sweep has {of} parts and {} of them are missing: {}{more}",
            of - readers.len() as u64,
            missing.join(", ")
        )));
    }
    for reader in &readers {
        let header = &reader.header;
        if header.samples != header.shard.samples(header.identity.count) {
            let message = format!("has other samples than part {}", header.shard);
            return Err(wrong(reader.path(), message));
        }
    }
    let header = Header {
        identity: first.header.identity.clone(),
        shard: Shard::WHOLE,
        samples: 0..first.header.identity.count,
    };
    let mut writer = Writer::create(out, &first.schema, &header)?;
    let mut gathered = Gathered::default();
    for (done, reader) in readers.iter().enumerate() {
        progress(done, readers.len(), "merging");
        for rows in reader.groups() {
            let rows = rows?;
            gathered.see(&reader.schema, &rows);
            writer.push(rows)?;
        }
    }
    writer.finish()?;
    Ok(gathered.summary(&header))
}

/// Refuses two files that are not of the same sweep.
fn require_same(first: &Reader, other: &Reader) -> Result<()> {
    let (own, others) = (&first.header, &other.header);
    let beside = first.path().display();
    let differ = |what: &str, own: &dyn std::fmt::Display, others: &dyn std::fmt::Display| {
        let message =
            format!("{what} {others}, and {beside} {own}: parts of one sweep have the same");
        Err(wrong(other.path(), message))
    };
    if own.identity.version != others.identity.version {
        let (own, others) = (&own.identity.version, &others.identity.version);
        return differ("was made by version", own, others);
    }
    let short = |digits: &str| digits.chars().take(12).collect::<String>();
    if own.identity.sources != others.identity.sources {
        let (own, others) = (&own.identity.sources, &others.identity.sources);
        return differ("was made by the build", &short(own), &short(others));
    }
    if own.identity != others.identity {
        let (own, others) = (&own.identity.sha256, &others.identity.sha256);
        return differ("is of the sweep", &short(own), &short(others));
    }
    if own.shard.of() != others.shard.of() {
        let number = |header: &Header| header.shard.of();
        return differ("is a part of", &number(own), &number(others));
    }
    if first.schema != other.schema {
        return Err(wrong(
            other.path(),
            format!("has other columns than {beside}"),
        ));
    }
    Ok(())
}
