//! The messages of the link: what a host asks, and what the drive answers.
//!
//! ```text
//! host --Asked(number, Ask)--> drive        drive --Answered(number, Answer)--> host
//! ```
//!
//! Firmware and PC compile this very file. An answer carries the number of its question; telemetry that was
//! subscribed to comes by itself. The drive carries a request out once: the same number again gets the same
//! answer again and nothing else. Settings that come again are taken again, which changes nothing.
//!
//! **Versions.** Each frame begins with a tag, drawn from the schema of all messages. Frames of another tag are
//! not read, whatever they say, but for tag [`HELLO`], whose two messages stay as they are for ever: an empty
//! one asks, and an [`Introduction`] answers. So a host of any age can say in words why it is not understood.

use super::image::HEADER;
use crate::fault::Fault;
use crate::mode::Mode;
use crate::request::{Refusal, Request};
use crate::telemetry::Telemetry;
use crate::units::Place;
use heapless::{String, Vec};
use postcard_schema::{Schema, key::Key};
use serde::{Deserialize, Serialize};

/// Version of the link; the tag tells in detail.
pub const VERSION: u16 = 1;
/// Tag of the two messages that never change.
pub const HELLO: u16 = 0;
/// Tag of all others.
pub const TAG: u16 = tag();
/// Words of the last moves in one message.
pub const WORDS: usize = 24;
/// Bytes of a set of settings in one message.
pub const BYTES: usize = 128;
/// Longest sentence of the drive.
pub const WORDING: usize = 120;
/// Faults that the drive remembers.
pub const FAULTS: usize = 8;

/// Of the schema: the key of its two types, folded; never [`HELLO`].
const fn tag() -> u16 {
    let asked = Key::for_path::<Asked>("asked").to_bytes();
    let answered = Key::for_path::<Answered<[f32; 1]>>("answered").to_bytes();
    let (mut folded, mut i) = ([0; 2], 0);
    while i < asked.len() {
        folded[i % 2] ^= asked[i] ^ answered[i].rotate_left(1);
        i += 1;
    }
    let tag = u16::from_le_bytes(folded);
    if tag == HELLO { 1 } else { tag }
}

/// A question with its number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Asked {
    /// Not that of the question before, nor that of the last request, however long ago that was.
    pub number: u8,
    /// The question.
    pub ask: Ask,
}

/// What a host can ask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Ask {
    /// What the drive is doing: [`Answer::Status`].
    Status,
    /// Something of the drive: [`Answer::Taken`] or [`Answer::Refused`].
    Request(Request),
    /// Nothing, but that the host is there: [`Answer::Taken`].
    Heartbeat,
    /// Telemetry of every so manieth control period, of none with zero: [`Answer::Taken`].
    Subscribe(u16),
    /// Words of the last moves from that one on: [`Answer::LastMoves`].
    LastMoves(u16),
    /// The last faults: [`Answer::Faults`].
    Faults,
    /// Bytes of the settings that the drive runs with, header first, from that one on: [`Answer::Settings`].
    Settings(u16),
    /// Bytes of a set of settings (see [`image`](super::image)): [`Answer::Taken`] or [`Answer::Objection`]. Into the
    /// flash after [`Request::Store`], and into memory while the drive runs.
    Put(Piece),
    /// The set has come whole. Of a drive that stores, it is to be kept, and the drive resets itself:
    /// [`Answer::Taken`] before that, or [`Answer::Objection`]. One that runs goes on with it, see
    /// [`Request::Change`], until the reset.
    Take,
}

/// Bytes of a set of settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Piece {
    /// Where they begin, in the set. The first piece is the header.
    pub at: u32,
    /// What they are.
    pub bytes: Vec<u8, BYTES>,
}

impl Piece {
    /// The pieces of a set in their order, the header first.
    pub fn of(set: &[u8]) -> impl Iterator<Item = Self> {
        let (header, rest) = set.split_at(HEADER.min(set.len()));
        let mut at = 0;
        core::iter::once(header)
            .chain(rest.chunks(BYTES))
            .map(move |bytes| {
                let piece = Self {
                    at,
                    bytes: bytes.iter().copied().collect(),
                };
                at += bytes.len() as u32;
                piece
            })
    }
}

/// An answer with the number of its question.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[serde(bound(serialize = "L: AsRef<[f32]>", deserialize = "L: Deserialize<'de>"))]
pub struct Answered<L> {
    /// Of the question; telemetry has that of its subscription.
    pub number: u8,
    /// The answer.
    pub answer: Answer<L>,
}

/// What the drive answers; `L` holds a value for each load mass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[serde(bound(serialize = "L: AsRef<[f32]>", deserialize = "L: Deserialize<'de>"))]
pub enum Answer<L> {
    /// See [`Ask::Status`].
    Status(Status),
    /// It is done, or begun.
    Taken,
    /// It is not done.
    Refused(Refusal),
    /// More is asked than the drive can take: once more, a little later.
    Busy,
    /// See [`Ask::Subscribe`].
    Telemetry(Telemetry<L>),
    /// See [`Ask::LastMoves`]; none beyond the last.
    LastMoves(Vec<u32, WORDS>),
    /// See [`Ask::Faults`]: the oldest first.
    Faults(Vec<PastFault, FAULTS>),
    /// See [`Ask::Settings`]; none beyond the last.
    Settings(Vec<u8, BYTES>),
    /// Settings are not taken, and why.
    Objection(String<WORDING>),
}

/// Where the settings are from that a drive runs with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// They are the firmware's own, and no others are kept.
    #[default]
    CompiledIn,
    /// They are kept in its flash, under that serial number.
    Kept(u32),
    /// They are the firmware's own, for what is kept cannot be run.
    Fallback,
    /// They were changed while it ran, and are kept nowhere.
    Changed,
}

/// What the drive is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a fact of its own, as on the wire"
)]
pub struct Status {
    /// Control period that it is of.
    pub period: u32,
    /// The mode.
    pub mode: Mode,
    /// Value that tripped the fault, in the unit of its limit; zero without a fault.
    pub fault_value: f32,
    /// Whether the run switch is closed; with an open one nothing moves.
    pub run_switch: bool,
    /// Whether zero is known.
    pub position_set: bool,
    /// Whether the link commands the drive, and no longer the switches.
    pub remote: bool,
    /// Whether the drive moves at a velocity that was asked for.
    pub jogging: bool,
    /// Whether the drive looks for its zero.
    pub homing: bool,
    /// Whether the machine is held at a target, and at which, counts from zero.
    pub held: Option<Place>,
    /// Position of the actuator, m.
    pub position: f32,
    /// Reference position, m.
    pub reference: f32,
    /// Velocity of the actuator, m/s.
    pub velocity: f32,
    /// Commanded current, A.
    pub command: f32,
    /// Largest current that is commanded, either way, A.
    pub current_limit: f32,
    /// Where its settings are from, and by which checksum they are known.
    pub source: Source,
    /// See `source`.
    pub fingerprint: u32,
    /// Whether the current limit acts.
    pub limited: bool,
    /// Vibration of the load, rms, m.
    pub vibration: f32,
    /// Most processor cycles of a control interrupt since the reset.
    pub worst_cycles: u32,
    /// Records of control periods that the idle loop has missed since the reset.
    pub lost: u32,
    /// Frames of the link that were damaged, since the reset.
    pub damaged: u32,
}

/// A fault that was.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct PastFault {
    /// Control period in which the drive began to stop.
    pub period: u32,
    /// Which.
    pub fault: Fault,
    /// The value that tripped it, in the unit of its limit.
    pub value: f32,
}

/// Which drive there is, and how it can be spoken to. Never changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Introduction {
    /// Its [`VERSION`].
    pub version: u16,
    /// Its [`TAG`].
    pub tag: u16,
    /// Version of the firmware.
    pub firmware: String<24>,
    /// `"linear"` or `"rotary"`.
    pub kind: String<8>,
    /// Number of load masses.
    pub loads: u8,
    /// Control period, s.
    pub sample_time: f32,
    /// Distance per count, m.
    pub resolution: f32,
    /// CRC-32 (ISO-HDLC) of the settings.
    pub fingerprint: u32,
}
