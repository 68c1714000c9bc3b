//! The last moves, kept in the drive's memory for who was not connected: encoder counter and applied current of
//! every period from the moment the machine is commanded to move until it stands.
//!
//! A move is a *stretch*: four words, and one word a period. It begins at rest, in the period in which a plan, a
//! step or an excitation begins, with the counter as it was read then. What is asked on top of it belongs to it. It
//! ends when the actuator has stayed within the settling tolerance for 250 ms, so that no standstill pushes moves
//! out, or when the next move begins, if it has for 50 ms. A machine whose amplifier is switched off in a move is
//! followed until it stands.
//!
//! A stretch takes half of the ring at most: of a longer move the first part is kept, which begins at rest, and the
//! move before it is still there. The oldest stretches make room, each as a whole.
//!
//! Everything is words, lowest byte first where they are bytes, so that the same code reads them where they were
//! written and in a copy on a PC, without a pointer in it:
//!
//! | word | what |
//! |---|---|
//! | 0 to 3 | [`MAGIC`], 16 characters |
//! | 4 | [`VERSION`] of this layout |
//! | 5 | words of the ring, which follows the [`HEADER`] words of this table |
//! | 6 | control period, s, `f32` |
//! | 7 | current of a step, A, `f32` |
//! | 8 | width of the encoder's counter |
//! | 9 | number of load masses |
//! | 10, 11 | `"linear"` or `"rotary"`, filled up with zeros |
//! | 12 | fingerprint of the settings |
//! | 13 | word of the ring at which the oldest stretch begins |
//! | 14 | how many stretches there are, one after the other, round the end of the ring |
//!
//! | word of a stretch | what |
//! |---|---|
//! | 0 | its number since the reset, from 1 |
//! | 1 | number of the control period in which it begins |
//! | 2 | encoder counter then |
//! | 3 | number of its samples, below bit 16; bit 16: it has ended; bit 17: the move went on |
//! | from 4 on | a sample each: lower half of the counter as read, and above it the current applied over the period before, in steps |
//!
//! Nothing here takes more than a few words a period; a reset empties the ring.

use crate::settings::Settings;
use crate::telemetry::Identity;
use crate::units::{Counts, Current, Place};
use core::sync::atomic::{AtomicU32, Ordering};

/// How a record begins.
pub const MAGIC: [u8; 16] = *b"arso: last moves";
/// Of the layout.
pub const VERSION: u32 = 1;
/// Words before the ring.
pub const HEADER: usize = 15;

/// Words of a stretch before its samples.
pub const BEFORE: usize = 4;
/// Place in the header: where the oldest stretch begins.
pub const OLDEST: usize = 13;
/// Place in the header: how many stretches there are.
pub const HELD: usize = 14;
const FINGERPRINT: usize = 12;
/// In the last word before the samples: how many there are.
pub const SAMPLES: u32 = 0xFFFF;
const ENDED: u32 = 1 << 16;
const CUT: u32 = 1 << 17;

/// How long the actuator must have stood where a move ends, and where the next one begins, s.
const STOOD: f32 = 0.25;
const RESTED: f32 = 0.05;
/// Steps of a current that has none of its own.
const STEPS: f32 = 32_767.0;

/// The memory of a record: so many words beside its header. Who reads it while it is written finds each word whole,
/// and may find its oldest stretch overwritten.
#[derive(Debug)]
#[repr(C)]
pub struct LastMoves<const RING: usize> {
    header: [AtomicU32; HEADER],
    ring: [AtomicU32; RING],
}

impl<const RING: usize> LastMoves<RING> {
    /// Nothing yet, not even that it is a record.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "for a static")]
    pub const fn new() -> Self {
        Self {
            header: [const { AtomicU32::new(0) }; HEADER],
            ring: [const { AtomicU32::new(0) }; RING],
        }
    }

    /// The word at a place, from the beginning of the header.
    #[must_use]
    pub fn word(&self, place: usize) -> Option<u32> {
        let word = match place.checked_sub(HEADER) {
            None => self.header.get(place),
            Some(place) => self.ring.get(place),
        };
        word.map(read)
    }

    /// From now on the moves are of a drive with other settings.
    ///
    /// * `fingerprint`: of them
    pub fn changed(&self, fingerprint: u32) {
        write(&self.header[FINGERPRINT], fingerprint);
    }

    /// All words, in their order.
    pub fn words(&self) -> impl Iterator<Item = u32> {
        self.header.iter().chain(&self.ring).map(read)
    }
}

fn read(word: &AtomicU32) -> u32 {
    word.load(Ordering::Relaxed)
}

fn write(place: &AtomicU32, word: u32) {
    place.store(word, Ordering::Relaxed);
}

/// What the loop, or an excitation, does with the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Course {
    /// No loop is closed and nothing is played.
    #[default]
    Free,
    /// It is held there.
    Held(Place),
    /// It is moved.
    Moved,
}

/// What is recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Width of the encoder's counter.
    pub counter_bits: u32,
    /// Current of a step; of the largest current, either way, there are 32767 at most.
    pub step: Current,
    /// Counts within which the actuator stands.
    pub tolerance: u32,
}

impl Scale {
    /// That of a drive.
    #[must_use]
    pub fn of<const N: usize, O>(settings: &Settings<N, O>) -> Self {
        let step = settings.amplifier.step;
        let continuous = settings.limits.current_limit / STEPS;
        Self {
            counter_bits: settings.encoder.counter_bits,
            step: Current(if step > 0.0 { step } else { continuous }),
            // The cast saturates.
            tolerance: (settings.standstill.tolerance / settings.encoder.resolution + 0.5) as u32,
        }
    }
}

/// Counts from one reading of a counter to another.
fn difference(from: u32, to: u32, bits: u32) -> i32 {
    let unused = 32 - bits.clamp(1, 32);
    (to.wrapping_sub(from) << unused) as i32 >> unused
}

/// How far the recording of a move has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// There is none.
    Waiting,
    /// Every period is kept.
    Recording,
    /// The move goes on, and its first part is kept.
    Full,
}

/// Writes the last moves into their memory, period by period.
#[derive(Debug)]
pub struct Recorder<'m, const RING: usize> {
    memory: &'m LastMoves<RING>,
    scale: Scale,
    /// Steps per A.
    steps: f32,
    /// Periods.
    rested: u32,
    stood: u32,
    state: State,
    /// In the period before.
    course: Course,
    last: u32,
    /// Near which the actuator has been, and for how many periods.
    anchor: u32,
    still: u32,
    /// Stretches so far.
    number: u32,
    /// Where the last one begins, its samples, and where it goes on.
    begin: usize,
    samples: usize,
    next: usize,
    /// Words in use, the place of the first, and how many stretches they are.
    used: usize,
    oldest: usize,
    held: u32,
}

impl<'m, const RING: usize> Recorder<'m, RING> {
    /// Samples of a stretch, at most.
    const LONGEST: usize = {
        let half = (RING / 2).saturating_sub(BEFORE);
        if half > SAMPLES as usize {
            SAMPLES as usize
        } else {
            half
        }
    };

    /// An empty record.
    pub fn new(memory: &'m LastMoves<RING>, drive: &Identity<'_>, scale: Scale) -> Self {
        let [a, b, c, d] = words_of(MAGIC);
        let mut kind = [0; 16];
        for (place, byte) in kind[..8].iter_mut().zip(drive.kind.bytes()) {
            *place = byte;
        }
        let [kind, more, ..] = words_of(kind);
        let header = [
            a,
            b,
            c,
            d,
            VERSION,
            RING as u32,
            drive.sample_time.to_bits(),
            scale.step.0.to_bits(),
            scale.counter_bits,
            drive.loads.into(),
            kind,
            more,
            drive.fingerprint,
            0,
            0,
        ];
        for (place, word) in memory.header.iter().zip(header) {
            write(place, word);
        }
        Self {
            memory,
            scale,
            steps: if scale.step.0 > 0.0 {
                1.0 / scale.step.0
            } else {
                0.0
            },
            rested: (RESTED / drive.sample_time + 0.5) as u32,
            stood: (STOOD / drive.sample_time + 0.5) as u32,
            state: State::Waiting,
            course: Course::Free,
            last: 0,
            anchor: 0,
            still: 0,
            number: 0,
            begin: 0,
            samples: 0,
            next: 0,
            used: 0,
            oldest: 0,
            held: 0,
        }
    }

    /// One period.
    ///
    /// * `period`: its number
    /// * `count`: as it was read at its beginning
    /// * `applied`: the current over the period before
    /// * `course`: what is done with the machine from now on
    pub fn step(&mut self, period: u32, count: Counts, applied: Current, course: Course) {
        let Counts(count) = count;
        let begins = match (self.course, course) {
            (before, Course::Moved) => before != Course::Moved,
            // A step.
            (Course::Held(before), Course::Held(place)) => before != place,
            _ => false,
        };
        self.course = course;
        let rested = self.still >= self.rested;
        let off = difference(self.anchor, count, self.scale.counter_bits).unsigned_abs();
        if begins || course == Course::Moved || off > self.scale.tolerance {
            self.anchor = count;
            self.still = 0;
        } else {
            self.still = self.still.saturating_add(1);
        }

        if begins && (self.state == State::Waiting || rested) {
            self.end(0);
            self.begin(period, count);
        }
        if self.state == State::Recording {
            self.sample(count, applied);
        }
        // The next loop is closed from rest alone: what is asked of it then is a move of its own.
        let over = self.state == State::Full && course == Course::Free;
        if over || self.still >= self.stood {
            self.end(0);
        }
    }

    fn begin(&mut self, period: u32, count: u32) {
        if Self::LONGEST == 0 {
            return;
        }
        self.number = self.number.wrapping_add(1);
        self.make_room(BEFORE + 1);
        self.begin = self.next;
        self.samples = 0;
        for word in [self.number, period, count, 0] {
            self.push(word);
        }
        self.held += 1;
        self.last = count;
        self.state = State::Recording;
        self.note_extent();
    }

    /// * `cut`: [`CUT`] where the move goes on
    fn end(&mut self, cut: u32) {
        if self.state == State::Recording {
            self.note_samples(ENDED | cut);
        }
        self.state = State::Waiting;
    }

    fn sample(&mut self, count: u32, applied: Current) {
        // Half of a wide counter tells the whole of it as long as it does not run away.
        let step = difference(self.last, count, self.scale.counter_bits);
        if self.samples >= Self::LONGEST || i16::try_from(step).is_err() {
            self.end(CUT);
            self.state = State::Full;
            return;
        }
        self.last = count;
        self.make_room(1);
        // Rounded; the cast saturates, and makes zero of what is no number.
        let steps = applied.0 * self.steps;
        let steps = (steps + f32::copysign(0.5, steps)) as i16;
        self.push(u32::from(count as u16) | u32::from(steps as u16) << 16);
        self.samples += 1;
        self.note_samples(0);
    }

    /// The oldest stretches go until so many words are free. The one that is written is never among them: it
    /// takes half of the ring at most.
    fn make_room(&mut self, words: usize) {
        let before = self.held;
        while self.used + words > RING && self.held > 0 {
            let samples = self
                .memory
                .ring
                .get(wrapped::<RING>(self.oldest + BEFORE - 1));
            let size = BEFORE + (samples.map_or(0, read) & SAMPLES) as usize;
            self.oldest = wrapped::<RING>(self.oldest + size);
            self.used = self.used.saturating_sub(size);
            self.held -= 1;
        }
        if self.held != before {
            self.note_extent();
        }
    }

    fn push(&mut self, word: u32) {
        if let Some(place) = self.memory.ring.get(self.next) {
            write(place, word);
        }
        self.next = wrapped::<RING>(self.next + 1);
        self.used += 1;
    }

    fn note_samples(&mut self, flags: u32) {
        let place = wrapped::<RING>(self.begin + BEFORE - 1);
        if let Some(place) = self.memory.ring.get(place) {
            write(place, self.samples as u32 | flags);
        }
    }

    fn note_extent(&mut self) {
        write(&self.memory.header[OLDEST], self.oldest as u32);
        write(&self.memory.header[HELD], self.held);
    }
}

/// A place that is beyond the end of the ring by less than the ring.
const fn wrapped<const RING: usize>(place: usize) -> usize {
    if place >= RING { place - RING } else { place }
}

fn words_of(bytes: [u8; 16]) -> [u32; 4] {
    let (words, _) = bytes.as_chunks::<4>();
    core::array::from_fn(|word| {
        words
            .get(word)
            .map_or(0, |bytes| u32::from_le_bytes(*bytes))
    })
}

/// Why words are no record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unreadable {
    /// They do not begin with [`MAGIC`].
    Magic,
    /// They have another layout, of this version.
    Version(u32),
    /// There are fewer than so many.
    Short(usize),
    /// What they say does not fit together.
    Inconsistent,
}

impl core::fmt::Display for Unreadable {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Magic => f.write_str("no record of moves"),
            Self::Version(found) => write!(
                f,
                "a record of moves of version {found}, and this program reads version {VERSION}"
            ),
            Self::Short(words) => write!(
                f,
                "a record of moves that is cut off: it has {} bytes",
                4 * words
            ),
            Self::Inconsistent => f.write_str("a record of moves that is damaged"),
        }
    }
}

impl core::error::Error for Unreadable {}

/// What is in the memory of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record<'a> {
    ring: &'a [u32],
    oldest: usize,
    held: u32,
    kind: [u8; 8],
    loads: u8,
    sample_time: f32,
    fingerprint: u32,
    counter_bits: u32,
    step: f32,
}

impl<'a> Record<'a> {
    /// Reads words that begin with a record; more may follow.
    ///
    /// # Errors
    /// When they are none, or a damaged one.
    pub fn parse(words: &'a [u32]) -> Result<Self, Unreadable> {
        let (header, rest) = words
            .split_first_chunk::<HEADER>()
            .ok_or(Unreadable::Short(HEADER))?;
        // What is no record has no length either.
        if header[..4] != words_of(MAGIC) || header[4] != VERSION {
            return Self::new(header, rest);
        }
        let length = header[5] as usize;
        let short = Unreadable::Short(length.saturating_add(HEADER));
        Self::new(header, rest.get(..length).ok_or(short)?)
    }

    fn new(header: &[u32; HEADER], ring: &'a [u32]) -> Result<Self, Unreadable> {
        let [
            a,
            b,
            c,
            d,
            version,
            _,
            sample_time,
            step,
            counter_bits,
            loads,
            kind,
            more,
            fingerprint,
            oldest,
            held,
        ] = *header;
        if [a, b, c, d] != words_of(MAGIC) {
            return Err(Unreadable::Magic);
        }
        if version != VERSION {
            return Err(Unreadable::Version(version));
        }
        let mut name = [0; 8];
        let bytes = kind.to_le_bytes().into_iter().chain(more.to_le_bytes());
        for (place, byte) in name.iter_mut().zip(bytes) {
            *place = byte;
        }
        let record = Self {
            ring,
            oldest: oldest as usize,
            held,
            kind: name,
            loads: u8::try_from(loads).map_err(|_| Unreadable::Inconsistent)?,
            sample_time: f32::from_bits(sample_time),
            fingerprint,
            counter_bits,
            step: f32::from_bits(step),
        };
        let positive = |value: f32| value.is_finite() && value > 0.0;
        let words: usize = record
            .stretches()
            .map(|stretch| BEFORE + stretch.len())
            .sum();
        let whole = record.stretches().count() == held as usize && words <= ring.len();
        let sound = whole
            && (record.oldest < ring.len() || held == 0)
            && positive(record.sample_time)
            && positive(record.step)
            && (1..=32).contains(&counter_bits);
        sound.then_some(record).ok_or(Unreadable::Inconsistent)
    }

    /// Whose moves they are.
    #[must_use]
    pub fn drive(&self) -> Identity<'_> {
        let length = self.kind.iter().position(|byte| *byte == 0);
        let name = &self.kind[..length.unwrap_or(self.kind.len())];
        Identity {
            kind: core::str::from_utf8(name).unwrap_or(""),
            loads: self.loads,
            sample_time: self.sample_time,
            fingerprint: self.fingerprint,
        }
    }

    /// The moves, the oldest first.
    pub fn stretches(&self) -> impl Iterator<Item = Stretch<'a>> + use<'a> {
        let record = *self;
        let mut at = self.oldest;
        let mut left = self.held;
        core::iter::from_fn(move || {
            left = left.checked_sub(1)?;
            let stretch = Stretch::at(record, at)?;
            at = (at + BEFORE + stretch.len()) % record.ring.len();
            Some(stretch)
        })
        // No more than there is room for, whatever the header says.
        .take(self.ring.len() / BEFORE)
    }
}

/// A move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch<'a> {
    record: Record<'a>,
    /// Where its samples begin.
    first: usize,
    samples: usize,
    /// Its number since the reset, from 1; wraps.
    pub number: u32,
    /// Number of the control period in which it begins.
    pub period: u32,
    /// Encoder counter then.
    pub count: Counts,
    /// Whether it has ended: the machine stood, or the next move began.
    pub ended: bool,
    /// Whether the move went on, and this is its first part.
    pub cut: bool,
}

/// One period of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Periods since the move began.
    pub tick: u32,
    /// Encoder counter.
    pub count: Counts,
    /// Current applied over the period before.
    pub applied: Current,
}

impl<'a> Stretch<'a> {
    fn at(record: Record<'a>, begin: usize) -> Option<Self> {
        let length = record.ring.len();
        let word = |offset: usize| {
            let place = begin.checked_add(offset)?.checked_rem(length)?;
            record.ring.get(place).copied()
        };
        let last = word(BEFORE - 1)?;
        Some(Self {
            record,
            first: begin.checked_add(BEFORE)?.checked_rem(length)?,
            samples: (last & SAMPLES) as usize,
            number: word(0)?,
            period: word(1)?,
            count: Counts(word(2)?),
            ended: last & ENDED != 0,
            cut: last & CUT != 0,
        })
    }

    /// Number of samples.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a move has samples")]
    pub fn len(&self) -> usize {
        self.samples
    }

    /// Its periods, in order.
    pub fn samples(&self) -> impl Iterator<Item = Sample> + use<'a> {
        let Record {
            ring,
            counter_bits,
            step,
            ..
        } = self.record;
        let (before, after) = ring.split_at_checked(self.first).unwrap_or((ring, &[]));
        let words = after.iter().chain(before).take(self.samples);
        let mask = u32::MAX >> (32 - counter_bits.clamp(1, 32));
        let mut count = self.count.0;
        words.zip(0..).map(move |(word, tick)| {
            let moved = (*word as u16).wrapping_sub(count as u16) as i16;
            count = count.wrapping_add_signed(moved.into()) & mask;
            let steps = (word >> 16) as u16 as i16;
            Sample {
                tick,
                count: Counts(count),
                applied: Current(f32::from(steps) * step),
            }
        })
    }
}

#[cfg(test)]
mod tests;
