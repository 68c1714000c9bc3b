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
use crate::settings::{DriveSettings, LOADS, Observer, Set, Unfit, read};
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
/// How long the last answer has to leave, s.
const PARTING: f32 = 0.05;

/// Settings that come.
pub(crate) struct Keeping<S> {
    spare: S,
    staged: Vec<u8, STAGED>,
    /// Control periods until the reset; none while the drive does not store.
    left: Option<u32>,
    silence: u32,
    parting: u32,
    /// What is to run from the next period on, and what becomes of the set then.
    pub(crate) changed: Option<DriveSettings>,
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
            Self::Order => "a piece of the settings is missing",
            Self::Room => "the settings are longer than what the drive has room for",
            Self::Flash => "the flash could not be written",
            Self::Restart => {
                "amplifier and plans are changed with the amplifier off only: disable the drive"
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
    pub(crate) fn new(spare: S, sample_time: f32) -> Self {
        // The casts saturate.
        let periods = |time: f32| (time / sample_time) as u32;
        Self {
            spare,
            staged: Vec::new(),
            left: None,
            silence: periods(SILENCE),
            parting: periods(PARTING),
            changed: None,
        }
    }

    /// The drive stores from now on: what the spare slot held goes.
    pub(crate) fn open(&mut self) -> Result<(), Objection> {
        let erased = self.spare.erase();
        self.staged.clear();
        // Counted from now on: the processor stood still.
        self.left = Some(self.silence);
        erased.map_err(|_| Objection::Flash)
    }

    /// Takes a piece of a set. The same piece once more changes nothing.
    pub(crate) fn put(&mut self, mode: Mode, piece: &Piece) -> Result<(), Objection> {
        let (at, bytes) = (piece.at as usize, piece.bytes.as_slice());
        match mode {
            Mode::Running => self.stage(at, bytes),
            Mode::Storing if at == 0 => {
                self.left = Some(self.silence);
                if bytes.len() != HEADER {
                    return Err(Objection::Order);
                }
                self.stage(0, bytes)
            }
            Mode::Storing => {
                self.left = Some(self.silence);
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

    /// Keeps the set that was written, and lets the drive reset itself.
    ///
    /// * `serial`: of the set that the drive runs with
    pub(crate) fn keep(&mut self, serial: u32, board: &Capabilities) -> Result<(), Objection> {
        self.left = Some(self.parting);
        let header = Header {
            serial: serial.wrapping_add(1),
            ..Header::of(&self.staged)?
        };
        read(&header, self.spare.read(), board)?;
        let written = self.spare.write(0, &header.bytes());
        written.map_err(|_| Objection::Flash)
    }

    /// The set that is staged, for a drive that runs with another one.
    pub(crate) fn change(
        &mut self,
        set: &Set,
    ) -> Result<Change<'static, LOADS, Observer>, Objection> {
        let header = Header::of(&self.staged)?;
        let settled = header.settings::<LOADS, Observer>(&self.staged)?;
        let settings = settled.settings;
        if !settled.plans.are(&set.plans) || settings.amplifier != set.settings.amplifier {
            return Err(Objection::Restart);
        }
        let change = Change::new(&settings, set.plans).map_err(NoSet::from)?;
        self.changed = Some(settings);
        Ok(change)
    }

    /// A control period; whether the processor is to be reset.
    pub(crate) fn period(&mut self) -> bool {
        let Some(left) = &mut self.left else {
            return false;
        };
        *left = left.saturating_sub(1);
        *left == 0
    }
}
