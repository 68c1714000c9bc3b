//! The text of a record as lines of fields, whatever program wrote it.

use super::Refusal;
use std::io::Read;

/// A header and what stands below it; lines as an editor counts them.
pub(super) struct Table {
    /// Titles of the columns.
    pub(super) header: Vec<String>,
    /// Line of the header.
    pub(super) line: usize,
    /// Line and fields of each row.
    pub(super) rows: Vec<(usize, csv::StringRecord)>,
}

/// Reads everything. Lines that are empty or begin with `#` are none, and neither is the `sep=` of a
/// spreadsheet.
pub(super) fn table(mut text: impl Read) -> Result<Table, Refusal> {
    let mut bytes = Vec::new();
    text.read_to_end(&mut bytes)
        .map_err(|problem| Refusal::of_all(format!("cannot be read: {problem}")))?;
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        let message = "is text in UTF-16: save it as CSV in UTF-8";
        return Err(Refusal::of_all(message.into()));
    }
    let text = String::from_utf8(bytes)
        .map_err(|_| Refusal::of_all("is no CSV: it is not text in UTF-8".into()))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut lines: Vec<(usize, &str)> = (1..).zip(text.lines()).collect();
    lines.retain(|(_, line)| !line.trim().is_empty() && !line.trim_start().starts_with('#'));
    if lines
        .first()
        .is_some_and(|(_, line)| line.to_ascii_lowercase().starts_with("sep="))
    {
        lines.remove(0);
    }
    let separator = separator(lines.first().map_or("", |(_, header)| header));
    let fields = lines.iter().map(|(_, line)| match separator {
        Some(_) => (*line).to_owned(),
        None => aligned(line),
    });
    let text = fields.collect::<Vec<_>>().join("\n");
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator.unwrap_or(b'\t'))
        .flexible(true)
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut records = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|problem| Refusal::of_all(format!("is no CSV: {problem}")))?;
        let kept = record.position().map_or(1, |at| at.line() as usize);
        let line = lines.get(kept - 1).map_or(0, |(line, _)| *line);
        records.push((line, record));
    }
    let mut records = records.into_iter();
    let (line, header) = records.next().unwrap_or((1, csv::StringRecord::new()));
    let header: Vec<String> = header.iter().map(str::to_owned).collect();
    let rows: Vec<_> = records.collect();
    // A separator at the end of every line makes a field without title.
    if let Some((line, row)) = rows.iter().find(|(_, row)| {
        row.len() > header.len() && row.iter().skip(header.len()).any(|field| !field.is_empty())
    }) {
        let mut message = format!(
            "has {} fields where the header has {}",
            row.len(),
            header.len()
        );
        if separator == Some(b',') {
            message += ": where numbers have a decimal comma, fields must be separated by ; or tab";
        }
        return Err(Refusal::of(*line, message));
    }
    Ok(Table { header, line, rows })
}

/// What separates fields: the one of comma, semicolon and tab that is most in the header; spaces where there
/// is none of them.
fn separator(header: &str) -> Option<u8> {
    let count = |separator: &u8| header.bytes().filter(|byte| byte == separator).count();
    // The last of equals is taken.
    let most = [b'\t', b';', b','].into_iter().max_by_key(count);
    most.filter(|separator| count(separator) > 0)
}

/// Fields that spaces separate, with tabs between; a unit belongs to its name.
fn aligned(line: &str) -> String {
    let line = line.replace(" [", "[").replace(" (", "(");
    line.split_whitespace().collect::<Vec<_>>().join("\t")
}

/// A finite number. A comma within a field can only be its point.
pub(super) fn number(text: &str) -> Option<f64> {
    let comma = !text.contains('.') && text.matches(',').count() == 1;
    let number = if comma {
        text.replace(',', ".").parse::<f64>()
    } else {
        text.parse::<f64>()
    };
    number.ok().filter(|value| value.is_finite())
}

/// The last decimal that a number is written to, as 1, 0.1, …; nothing where it has an exponent.
pub(super) fn last_decimal(text: &str) -> Option<f64> {
    if text.contains(['e', 'E']) {
        return None;
    }
    let decimals = text
        .split_once(['.', ','])
        .map_or(0, |(_, rest)| rest.len());
    Some(10_f64.powi(-(decimals as i32)))
}
