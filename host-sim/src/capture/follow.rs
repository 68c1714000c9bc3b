//! Moves in a record that is still being written: stretches of rows in which the machine begins to move and has
//! come to a stand again, or in which the mode that it moved in has ended.
//!
//! ```text
//! bytes --lines--> header | row --stands or moves--> stretch, with its header: a record of one move
//! ```
//!
//! Only what parts the stretches is read here; what a row says is for whoever reads the stretch.

use crate::error::{Error, Result};
use crate::machine::encoder::LEAST_COUNTS;

/// Counts within which a machine stands.
const STANDING: f64 = 8.0;
/// Rows before a motion that belong to it, and rows of standing still that end it.
const BEFORE: usize = 100;
const STOOD: usize = 150;
/// Rows after which a motion without end is taken for what it is so far.
const LONGEST: usize = 20_000;
/// Modes in which the machine moves as it is told, as the drive names them; in others it proves its signs.
const MOVING: [&str; 3] = ["", "Running", "Exciting"];

/// One move.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// As a file of its own.
    pub text: String,
    /// Its time in the record as that has it, first and last row.
    pub from: String,
    /// See `from`.
    pub to: String,
}

/// Where a line has what.
#[derive(Clone, Debug)]
struct Fields {
    separator: char,
    time: usize,
    place: usize,
    /// Values of the place column after which it begins anew; none where it goes on.
    range: Option<f64>,
    /// What is one count in the place column.
    unit: f64,
    mode: Option<usize>,
}

/// What has come of a record, and what of it is not over.
#[derive(Debug)]
pub struct Follower {
    name: String,
    /// Titles of time, count, position and mode where they are not those of `capture`.
    titles: [Option<String>; 4],
    counter_bits: u32,
    /// m.
    resolution: f64,
    /// What has come of a line.
    line: Vec<u8>,
    header: Option<(String, Fields)>,
    rows: Vec<String>,
    mode: String,
    /// Where the machine stands, or stood last.
    anchor: Option<f64>,
    moving: bool,
    stood: usize,
    /// Where the row before was, and how far the actuator has gone since it stood, with its ends, counts.
    last: Option<f64>,
    gone: [f64; 3],
}

impl Follower {
    /// * `name`: of the record, for messages
    /// * `titles`: of time, count, position and mode, where they are not those of `capture`
    /// * `encoder`: width of its counter, bits, and what is a count, m
    #[must_use]
    pub fn new(name: &str, titles: [Option<String>; 4], encoder: (u32, f64)) -> Self {
        Self {
            name: name.into(),
            titles,
            counter_bits: encoder.0,
            resolution: encoder.1,
            line: Vec::new(),
            header: None,
            rows: Vec::new(),
            mode: String::new(),
            anchor: None,
            moving: false,
            stood: 0,
            last: None,
            gone: [0.0; 3],
        }
    }

    /// Takes what has come; the moves that have ended by it.
    ///
    /// # Errors
    /// [`Error::Input`] where the header has no place of the actuator.
    pub fn take(&mut self, bytes: &[u8]) -> Result<Vec<Stretch>> {
        let mut ended = Vec::new();
        for byte in bytes {
            if *byte != b'\n' {
                self.line.push(*byte);
                continue;
            }
            let line = String::from_utf8_lossy(&self.line).trim().to_owned();
            self.line.clear();
            if !line.is_empty() && !line.starts_with('#') {
                ended.extend(self.take_line(line)?);
            }
        }
        Ok(ended)
    }

    fn take_line(&mut self, line: String) -> Result<Option<Stretch>> {
        let Some((_, fields)) = &self.header else {
            let line = line.trim_start_matches('\u{feff}').to_owned();
            let fields = self.fields(&line)?;
            self.header = Some((line, fields));
            return Ok(None);
        };
        let parts: Vec<&str> = line.split(fields.separator).map(str::trim).collect();
        let field = |index: usize| parts.get(index).copied().unwrap_or("");
        let mode = fields.mode.map(field).unwrap_or_default().to_owned();
        // What is no number is for the reader of the stretch to refuse.
        let place = field(fields.place).replace(',', ".").parse::<f64>().ok();
        let place = place.map(|place| place / fields.unit);
        let range = fields.range;
        let between = |from: f64, to: f64| match range {
            Some(range) => (to - from) - range * ((to - from) / range).round(),
            None => to - from,
        };
        let distance = self.anchor.zip(place);
        let distance = distance.map(|(anchor, place)| between(anchor, place).abs());
        let step = self.last.zip(place);
        let step = step.map_or(0.0, |(last, place)| between(last, place));
        self.last = place.or(self.last);

        let mut ended = None;
        if mode != self.mode {
            ended = self.moving.then(|| self.stretch()).flatten();
            self.begin_anew();
            self.mode = mode;
        }
        if !MOVING.contains(&self.mode.as_str()) {
            return Ok(ended);
        }
        self.rows.push(line);
        let [at, low, high] = self.gone;
        let at = at + step;
        self.gone = [at, low.min(at), high.max(at)];
        if distance.is_none_or(|distance| distance > STANDING) {
            self.moving |= self.anchor.is_some() && place.is_some();
            self.anchor = place.or(self.anchor);
            self.stood = 0;
        } else {
            self.stood += 1;
        }
        if !self.moving {
            let surplus = self.rows.len().saturating_sub(BEFORE);
            self.rows.drain(..surplus);
        } else if self.stood >= STOOD || self.rows.len() >= LONGEST {
            ended = self.stretch();
            self.moving = false;
            self.gone = [0.0; 3];
            let surplus = self.rows.len().saturating_sub(BEFORE);
            self.rows.drain(..surplus);
        }
        Ok(ended)
    }

    fn begin_anew(&mut self) {
        self.rows.clear();
        self.anchor = None;
        self.moving = false;
        self.stood = 0;
        self.gone = [0.0; 3];
    }

    /// The rows that there are; nothing where the machine hardly moved, as when it is pushed to its target.
    fn stretch(&self) -> Option<Stretch> {
        let (header, fields) = self.header.as_ref()?;
        let [_, low, high] = self.gone;
        if high - low < LEAST_COUNTS {
            return None;
        }
        let time = |row: Option<&String>| {
            let field = row.and_then(|row| row.split(fields.separator).nth(fields.time));
            field.unwrap_or_default().trim().to_owned()
        };
        Some(Stretch {
            text: format!("{header}\n{}\n", self.rows.join("\n")),
            from: time(self.rows.first()),
            to: time(self.rows.last()),
        })
    }

    fn fields(&self, header: &str) -> Result<Fields> {
        let count = |separator: &char| header.matches(*separator).count();
        let separator = ['\t', ';', ',']
            .into_iter()
            .max_by_key(count)
            .unwrap_or(',');
        let titles: Vec<&str> = header.split(separator).map(str::trim).collect();
        let word = |title: &str| {
            let end = title.find(['[', '(']).unwrap_or(title.len());
            title[..end].trim().to_ascii_lowercase()
        };
        let find = |given: &Option<String>, usual: &str| {
            let wanted = given.as_deref().unwrap_or(usual);
            let exact = titles.iter().position(|title| *title == wanted);
            exact.or_else(|| titles.iter().position(|title| word(title) == word(wanted)))
        };
        let [time, count, position, mode] = &self.titles;
        let counts = find(count, "count").filter(|_| position.is_none() || count.is_some());
        let (place, range, unit) = match (counts, find(position, "position")) {
            (Some(place), _) => (place, Some(f64::from(self.counter_bits).exp2()), 1.0),
            (None, Some(place)) => {
                let title = titles.get(place).copied().unwrap_or_default();
                let thousandths = ["mm", "mrad"].iter().any(|unit| title.contains(unit));
                let scale = if thousandths { 1e3 } else { 1.0 };
                (place, None, scale * self.resolution)
            }
            (None, None) => {
                return Err(Error::Input {
                    place: format!("{}:1", self.name),
                    message: format!(
                        "has no column count[1]: it has {}; say which it is with --column count=NAME",
                        titles.join(", ")
                    ),
                });
            }
        };
        Ok(Fields {
            separator,
            time: find(time, "time").unwrap_or(0),
            place,
            range,
            unit,
            mode: find(mode, "mode"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of a counter that stands, moves through its end, stands, in some mode.
    fn record(moves: usize, mode: &str) -> String {
        let mut text = String::new();
        let mut count = 65_000_usize;
        for k in 0..moves * 500 {
            if (150..250).contains(&(k % 500)) {
                count = (count + 20) % 65_536;
            }
            text += &format!("{k},{count},0.1,{mode}\n");
        }
        text
    }

    fn follower() -> Follower {
        let none = [const { None }; 4];
        let mut follower = Follower::new("log.csv", none, (16, 1e-6));
        let header = b"time[s],count[1],applied_current[A],mode[name]\n";
        assert_eq!(follower.take(header).unwrap(), []);
        follower
    }

    /// However the bytes come, each move comes once, with rest before and after it.
    #[test]
    fn each_move_comes_once_it_has_ended() {
        let text = record(3, "Running");
        for piece in [1, 7, 1000, 1_000_000] {
            let mut follower = follower();
            let mut found = Vec::new();
            for bytes in text.as_bytes().chunks(piece) {
                found.extend(follower.take(bytes).unwrap());
            }
            let places: Vec<_> = found.iter().map(|one| (&*one.from, &*one.to)).collect();
            assert_eq!(places, [("50", "399"), ("550", "899"), ("1050", "1399")]);
            assert!(found[1].text.starts_with("time[s],count[1],"));
            assert_eq!(found[1].text.lines().count(), 351);
        }
    }

    /// What moves as the signs are proven is no move, and the end of a mode ends one.
    #[test]
    fn modes_part_moves() {
        let mut follower = follower();
        assert_eq!(
            follower
                .take(record(2, "Commissioning").as_bytes())
                .unwrap(),
            []
        );
        let running = record(1, "Running");
        let cut = running.lines().take(300).collect::<Vec<_>>().join("\n") + "\n";
        assert_eq!(follower.take(cut.as_bytes()).unwrap(), []);
        let found = follower.take(b"500,1,0,Idle\n").unwrap();
        assert_eq!((found.len(), &*found[0].to), (1, "299"));
    }

    /// A push by some counts is no move.
    #[test]
    fn a_small_motion_is_no_move() {
        let mut follower = follower();
        let rows = (0..600).map(|k| format!("{k},{},0.1,Running", if k < 200 { 10 } else { 40 }));
        let text = rows.collect::<Vec<_>>().join("\n") + "\n";
        assert_eq!(follower.take(text.as_bytes()).unwrap(), []);
    }

    #[test]
    fn a_record_without_a_place_is_refused() {
        let mut follower = Follower::new("log.csv", [const { None }; 4], (16, 1e-6));
        let error = follower.take(b"time[s],speed\n").unwrap_err();
        assert!(
            error
                .to_string()
                .contains("log.csv:1: has no column count[1]"),
            "{error}"
        );
    }
}
