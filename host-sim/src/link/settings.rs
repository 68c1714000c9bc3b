//! Settings that are sent to a drive, and those that it runs with.
//!
//! ```text
//! amplifier off: Store (a sector is erased) -> header, pieces -> Take -> the drive resets itself, greeted anew
//! running:                                     header, pieces -> Take -> taken between two control periods
//! ```
//!
//! What a set is made of is said in [`arso_core::link::image`].

use super::Connection;
use crate::error::{Error, Result};
use arso_core::Mode;
use arso_core::link::image::Header;
use arso_core::link::message::{Answer, Ask, BYTES, Piece, Source, Status};
use arso_core::request::Request;
use std::time::{Duration, Instant};

/// How long the drive may take to erase its flash, 4 s by its data sheet, and to be there again after its reset.
const ERASED: Duration = Duration::from_secs(1);
const ERASE_TRIES: usize = 8;
const RESTARTED: Duration = Duration::from_secs(10);
/// How often a drive that stores is looked at.
const AGAIN: Duration = Duration::from_millis(100);

/// What became of settings that were sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pushed {
    /// The drive had them already.
    Known,
    /// They are kept in its flash, and it has begun anew with them.
    Kept,
    /// It runs with them until its reset: flash is written with the amplifier off alone.
    Changed,
}

impl Connection {
    /// Sends settings to the drive.
    ///
    /// * `set`: as [`settings_image`](crate::simulate::corridor::settings_image) makes it
    /// * `progress`: told how many bytes of how many have been sent
    ///
    /// # Errors
    /// [`Error::Refused`], [`Error::Drive`] for settings that the drive does not take; [`Error::Link`].
    pub fn push(&mut self, set: &[u8], progress: impl Fn(usize, usize)) -> Result<Pushed> {
        let header = Header::of(set).map_err(|error| Error::Drive(error.to_string()))?;
        let loads = self.introduction().loads;
        if header.loads != loads {
            return Err(Error::Drive(format!(
                "the settings are for {} loads, and the drive's firmware is built for {loads}: build it with the \
                 gains of a drive of as many loads",
                header.loads
            )));
        }
        let status = self.status()?;
        let kept = matches!(status.source, Source::CompiledIn | Source::Kept(_));
        if kept && status.fingerprint == header.fingerprint {
            return Ok(Pushed::Known);
        }
        if status.mode == Mode::Running {
            // The plans that it has remain, and with them their rows.
            let settings = set.get(..header.first_row()).unwrap_or(set);
            self.send_pieces(settings, progress)?;
            self.taken(Ask::Take)?;
            self.greet_again()?;
            return Ok(Pushed::Changed);
        }
        self.store(set, progress)?;
        if self.introduction().fingerprint == header.fingerprint {
            return Ok(Pushed::Kept);
        }
        Err(Error::Drive(
            "the drive has begun anew without the settings that were sent: its log says why".into(),
        ))
    }

    /// Lets the drive go back to the settings that are compiled into its firmware; the amplifier must be off. Whether
    /// it ran with others.
    ///
    /// # Errors
    /// [`Error::Refused`]; [`Error::Drive`] where it does not; [`Error::Link`].
    pub fn forget_settings(&mut self) -> Result<bool> {
        if self.status()?.source == Source::CompiledIn {
            return Ok(false);
        }
        self.store(&Header::of_nothing().bytes(), |_, _| ())?;
        match self.status()?.source {
            Source::CompiledIn => Ok(true),
            _ => Err(Error::Drive(
                "the drive has begun anew and runs with what it keeps still".into(),
            )),
        }
    }

    /// Lets the drive keep a set, and greets it when it has begun anew.
    fn store(&mut self, set: &[u8], progress: impl Fn(usize, usize)) -> Result<()> {
        let patience = Instant::now() + RESTARTED;
        // What a host before this one has begun ends by itself.
        while self.status()?.mode == Mode::Storing && Instant::now() < patience {
            std::thread::sleep(AGAIN);
        }
        match self.ask_within(Ask::Request(Request::Store), ERASED, ERASE_TRIES)? {
            Answer::Taken => {}
            other => return Err(refused(other)),
        }
        self.send_pieces(set, progress)?;
        self.taken(Ask::Take)?;
        let patience = Instant::now() + RESTARTED;
        loop {
            std::thread::sleep(AGAIN);
            let greeted = self.greet_again().and_then(|()| self.status());
            match greeted {
                // It has not begun anew yet.
                Ok(Status {
                    mode: Mode::Storing,
                    ..
                }) => {}
                Ok(_) => return Ok(()),
                Err(error) if Instant::now() > patience => return Err(error),
                Err(_) => {}
            }
            if Instant::now() > patience {
                return Err(Error::Drive("the drive does not begin anew".into()));
            }
        }
    }

    fn send_pieces(&mut self, set: &[u8], progress: impl Fn(usize, usize)) -> Result<()> {
        for piece in Piece::of(set) {
            let sent = piece.at as usize + piece.bytes.len();
            self.taken(Ask::Put(piece))?;
            progress(sent, set.len());
        }
        Ok(())
    }

    fn taken(&mut self, ask: Ask) -> Result<()> {
        match self.ask(ask)? {
            Answer::Taken => Ok(()),
            other => Err(refused(other)),
        }
    }

    /// The settings that the drive runs with: the header, and the set but for the rows of its plans.
    ///
    /// # Errors
    /// [`Error::Link`].
    pub fn settings(&mut self) -> Result<(Header, Vec<u8>)> {
        let mut set = Vec::new();
        loop {
            let Ok(at) = u16::try_from(set.len()) else {
                return Err(Error::Link("the settings of the drive do not end".into()));
            };
            let Answer::Settings(bytes) = self.ask(Ask::Settings(at))? else {
                return Err(Error::Link(
                    "asked for its settings, the drive says something else".into(),
                ));
            };
            set.extend_from_slice(&bytes);
            if bytes.len() < BYTES {
                break;
            }
        }
        let header = Header::of(&set);
        let header = header.map_err(|error| Error::Link(format!("of the drive: {error}")))?;
        Ok((header, set))
    }
}

/// An answer that is no consent.
fn refused(answer: Answer<Vec<f32>>) -> Error {
    match answer {
        Answer::Refused(refusal) => Error::Refused(refusal),
        Answer::Objection(words) => Error::Drive(format!("the drive does not take them: {words}")),
        _ => Error::Link("sent settings, the drive says something else".into()),
    }
}
