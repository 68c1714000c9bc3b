//! Settings that come over the link: into the flash while the amplifier is off, into memory while it runs.
//!
//! ```text
//! Store taken --open--> spare slot erased --put--> written behind the header --take--> checked, header written --> reset
//! running     --put---> memory ------------------------------------------take--> checked --> Change for the interrupt
//! ```
//!
//! Flash is written with the amplifier off alone: the processor stands still while a sector is erased (seconds) or
//! written. The slot that the drive runs from is never touched, and the header comes last: a power cut anywhere
//! leaves the set that was there. Storing ends with the processor's reset, whether it succeeds or not: counts of
//! the encoder may have been missed.

use crate::board::{Capabilities, Spare};
use crate::settings::{DriveSettings, Kept, LOADS, Observer, Set, Unfit, fit, read};
use arso_core::controller::Change;
use arso_core::link::image::{HEADER, Header, NoSet};
use arso_core::link::message::Piece;
use arso_core::mode::Mode;
use core::fmt;
use heapless::Vec;

/// Bytes of a set without its rows, at most.
const STAGED: usize = 4096;
/// For how long nothing may come before the drive gives up and resets itself, s.
const SILENCE: f32 = 5.0;
/// How long the watchdog may take to heed that it is to wait longer, s: some cycles of its own oscillator, prescaled.
const HEEDED: f32 = 0.1;
/// How long the drive goes on after its last answer, so that it can be asked once more for one that was lost, s.
const PARTING: f32 = 0.7;

/// Settings that come.
pub(crate) struct Keeping<S> {
    spare: S,
    /// Largest serial number that is kept.
    newest: u32,
    staged: Vec<u8, STAGED>,
    state: State,
    /// Control periods of the times above.
    silence: u32,
    heeded: u32,
    parting: u32,
    /// What runs from the change on that the interrupt has not taken yet.
    changed: Option<DriveSettings>,
}

/// How far the drive that stores has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// It does not.
    Nothing,
    /// The sector is erased in so many periods, and the question of that number is answered then.
    Opening(u32, Option<u8>),
    /// Pieces are awaited for so many periods.
    Open(u32),
    /// All is said: the reset is due in so many periods.
    Parting(u32),
}

/// What is to be done after a control period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Due {
    Nothing,
    /// To answer the question that began it.
    Opened(Option<u8>, Result<(), Objection>),
    /// To reset the processor.
    Restart,
}

/// Why what came is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Objection {
    /// Settings are taken by a drive that stores or runs.
    Mode,
    /// They come in order, the header first and whole.
    Order,
    /// There is no room for them.
    Room,
    /// The flash could not be written.
    Flash,
    /// The drive begins with other ones: it takes them with the amplifier off.
    Restart,
    /// They cannot be run.
    Unfit(Unfit),
}

impl fmt::Display for Objection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Mode => "settings are taken after `store`, or by a drive that runs",
            Self::Order => "a piece of the settings is missing before this one",
            Self::Room => "the settings are longer than what the drive has room for",
            Self::Flash => "the flash could not be written",
            Self::Restart => {
                "another amplifier or other planned moves need the amplifier off: disable the drive before"
            }
            Self::Unfit(error) => return error.fmt(f),
        })
    }
}

impl From<NoSet> for Objection {
    fn from(error: NoSet) -> Self {
        Self::Unfit(error.into())
    }
}

impl From<Unfit> for Objection {
    fn from(error: Unfit) -> Self {
        Self::Unfit(error)
    }
}

impl<S: Spare> Keeping<S> {
    pub(crate) fn new(kept: Kept<S>, sample_time: f32) -> Self {
        // The casts saturate.
        let periods = |time: f32| (time / sample_time) as u32 + 1;
        Self {
            spare: kept.spare,
            newest: kept.newest,
            staged: Vec::new(),
            state: State::Nothing,
            silence: periods(SILENCE),
            heeded: periods(HEEDED),
            parting: periods(PARTING),
            changed: None,
        }
    }

    /// The drive stores from now on: what the spare slot held goes, once the watchdog waits for it.
    ///
    /// * `number`: of the question to be answered then
    pub(crate) fn open(&mut self, number: Option<u8>) {
        self.staged.clear();
        self.state = State::Opening(self.heeded, number);
    }

    /// Takes a piece of a set. The same piece once more changes nothing.
    pub(crate) fn put(&mut self, mode: Mode, piece: &Piece) -> Result<(), Objection> {
        let (at, bytes) = (piece.at as usize, piece.bytes.as_slice());
        match (mode, self.state) {
            (Mode::Running, _) => self.stage(at, bytes),
            (Mode::Storing, State::Open(_)) => {
                self.state = State::Open(self.silence);
                if at == 0 && bytes.len() == HEADER {
                    return self.stage(0, bytes);
                }
                if at < HEADER || self.staged.len() != HEADER {
                    return Err(Objection::Order);
                }
                let end = at.saturating_add(bytes.len());
                if end > self.spare.read().len() {
                    return Err(Objection::Room);
                }
                let written = self.spare.write(piece.at, bytes);
                written.map_err(|_| Objection::Flash)
            }
            _ => Err(Objection::Mode),
        }
    }

    fn stage(&mut self, at: usize, bytes: &[u8]) -> Result<(), Objection> {
        if at > self.staged.len() {
            return Err(Objection::Order);
        }
        self.staged.truncate(at);
        let staged = self.staged.extend_from_slice(bytes);
        staged.map_err(|_| Objection::Room)
    }

    /// Keeps the set that was written, or puts away what is kept where the header is of nothing, and lets the drive
    /// reset itself.
    pub(crate) fn keep(&mut self, board: &Capabilities) -> Result<(), Objection> {
        self.state = State::Parting(self.parting);
        let header = Header {
            serial: self.newest.saturating_add(1),
            ..Header::of(&self.staged)?
        };
        if !header.is_of_nothing() {
            read(&header, self.spare.read(), board)?;
        }
        let written = self.spare.write(0, &header.bytes());
        written.map_err(|_| Objection::Flash)
    }

    /// The set that is staged, for a drive that runs with another one: what it is to do from now on.
    pub(crate) fn change(
        &mut self,
        set: &Set,
        board: &Capabilities,
    ) -> Result<Change<'static, LOADS, Observer>, Objection> {
        let header = Header::of(&self.staged)?;
        let settled = header.settings::<LOADS, Observer>(&self.staged)?;
        let settings = settled.settings;
        if !settled.plans.are(&set.plans) || settings.amplifier != set.settings.amplifier {
            return Err(Objection::Restart);
        }
        fit(&settings, board).map_err(Unfit::Board)?;
        let change = Change::new(&settings, set.plans).map_err(NoSet::from)?;
        self.changed = Some(settings);
        Ok(change)
    }

    /// The settings of the change that the interrupt has taken, or has not.
    pub(crate) fn changed(&mut self) -> Option<DriveSettings> {
        self.changed.take()
    }

    /// A control period.
    pub(crate) fn period(&mut self, mode: Mode) -> Due {
        match &mut self.state {
            // That it stores was not heard here, and nothing is prepared for it.
            State::Nothing if mode == Mode::Storing => {
                self.state = State::Parting(self.parting);
            }
            State::Nothing => {}
            State::Opening(0, number) => {
                let number = *number;
                let erased = self.spare.erase().map_err(|_| Objection::Flash);
                // Counted from now on: the processor stood still.
                self.state = State::Open(self.silence);
                return Due::Opened(number, erased);
            }
            State::Open(0) | State::Parting(0) => return Due::Restart,
            State::Opening(left, _) | State::Open(left) | State::Parting(left) => *left -= 1,
        }
        Due::Nothing
    }
}
