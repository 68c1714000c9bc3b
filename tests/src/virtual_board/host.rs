//! A host at the other end of the board's serial line, in step with the board: what it asks is answered some control
//! periods later.

use super::image::Image;
use super::rig::{Period, Switches};
use super::{Rig, Stop};
use arso_core::link::frame::{LONGEST, Receiver, frame};
use arso_core::link::message::{Answer, Answered, Ask, Asked, Piece, Status, TAG};
use arso_core::request::{Reason, Request};
use arso_core::{Mode, Place};
use host_sim::drive::{Drive, PlantFile};
use serde::Serialize;

/// An answer, and one with its number; the number of loads is the drive's.
pub type Said = Answer<Vec<f32>>;
/// See [`Said`].
pub type Heard = Answered<Vec<f32>>;

/// Who sits at the other end of the line.
pub struct Host {
    /// The board and its machine.
    pub rig: Rig,
    receiver: Receiver,
    /// Of the last question.
    pub number: u8,
    /// What came and was not asked for.
    pub telemetry: Vec<Heard>,
    /// Frames that did not hold.
    pub damaged: u32,
}

/// A frame of a message.
///
/// # Panics
/// Where it is too long.
pub fn framed<T: Serialize>(tag: u16, message: &T) -> Vec<u8> {
    let mut buffer = [0; LONGEST];
    frame(tag, message, &mut buffer).unwrap().to_vec()
}

/// Control periods within which an answer comes, and while a sector of flash is erased.
const PATIENCE: u32 = 50;
const ERASING: u32 = 5000;

impl Host {
    /// Of a board that runs.
    #[must_use]
    pub fn of(rig: Rig) -> Self {
        Self {
            rig,
            receiver: Receiver::default(),
            number: 0,
            telemetry: Vec::new(),
            damaged: 0,
        }
    }

    /// Of a default drive, just started.
    ///
    /// # Panics
    /// Where the firmware stops.
    #[must_use]
    pub fn new() -> Self {
        let drive = Drive::default_drive();
        let image = Image::parse(&crate::firmware()).unwrap();
        let mut rig = Rig::start(&image, &drive, &PlantFile::from(&drive), |_| ()).unwrap();
        rig.periods(20).unwrap();
        Self::of(rig)
    }

    /// Of a default drive that is held where it stands, over the link.
    ///
    /// # Panics
    /// Where it is not.
    #[must_use]
    pub fn running() -> Self {
        let mut host = Self::new();
        host.enable();
        host
    }

    /// Lets the drive hold its machine where it stands, which is zero from now on.
    ///
    /// # Panics
    /// Where it does not.
    pub fn enable(&mut self) {
        // What the switches would ask is asked only until somebody speaks.
        assert_eq!(self.request(Request::Stop), Ok(()));
        self.rig.switches(Switches::run(0));
        self.periods(30);
        assert_eq!(self.request(Request::Commission), Ok(()));
        self.until(3000, |status| status.mode == Mode::Ready);
        assert_eq!(self.request(Request::SetPosition(Place(0))), Ok(()));
        assert_eq!(self.request(Request::Start), Ok(()));
        self.periods(50);
    }

    /// Puts bytes on the line.
    pub fn send(&mut self, bytes: &[u8]) {
        self.rig.board.bus_mut().send(bytes);
    }

    /// One control period, and what was heard in it.
    ///
    /// # Errors
    /// Whatever stops the board.
    ///
    /// # Panics
    /// At frames of another version.
    pub fn try_period(&mut self) -> Result<(Period, Vec<Heard>), Stop> {
        let period = self.rig.period()?;
        let mut frames = Vec::new();
        for byte in self.rig.board.bus_mut().received() {
            match self.receiver.take(byte) {
                None => {}
                Some(Ok(frame)) => {
                    assert_eq!(frame.tag, TAG);
                    frames.push(frame.message().unwrap());
                }
                Some(Err(_)) => self.damaged += 1,
            }
        }
        Ok((period, frames))
    }

    /// The same.
    ///
    /// # Panics
    /// Where the board stops.
    pub fn period(&mut self) -> (Period, Vec<Heard>) {
        self.try_period().unwrap()
    }

    /// Some control periods; what is heard is kept.
    pub fn periods(&mut self, periods: usize) -> Vec<Period> {
        let mut all = Vec::new();
        for _ in 0..periods {
            let (period, frames) = self.period();
            all.push(period);
            self.telemetry.extend(frames);
        }
        all
    }

    /// Sends a question and waits for its answer.
    ///
    /// # Panics
    /// Where the board stops, or none comes.
    pub fn ask(&mut self, ask: Ask) -> Said {
        let patience = match ask {
            Ask::Request(Request::Store) => ERASING,
            _ => PATIENCE,
        };
        let words = format!("no answer to {ask:?}");
        self.try_ask(ask, patience).unwrap().expect(&words)
    }

    /// The same, for so many periods at most.
    ///
    /// # Errors
    /// Whatever stops the board.
    pub fn try_ask(&mut self, ask: Ask, patience: u32) -> Result<Option<Said>, Stop> {
        self.number = self.number.wrapping_add(1);
        let number = self.number;
        self.send(&framed(TAG, &Asked { number, ask }));
        for _ in 0..patience {
            for heard in self.try_period()?.1 {
                if matches!(heard.answer, Answer::Telemetry(_)) {
                    self.telemetry.push(heard);
                } else if heard.number == number {
                    return Ok(Some(heard.answer));
                }
            }
        }
        Ok(None)
    }

    /// Asks something of the drive.
    ///
    /// # Errors
    /// Why it refuses.
    ///
    /// # Panics
    /// Where the board stops, or says something else.
    pub fn request(&mut self, request: Request) -> Result<(), Reason> {
        match self.ask(Ask::Request(request)) {
            Answer::Taken => Ok(()),
            Answer::Refused(refusal) => {
                assert_eq!(refusal.request, request);
                Err(refusal.reason)
            }
            other => panic!("{other:?}"),
        }
    }

    /// What the drive is doing.
    ///
    /// # Panics
    /// Where it does not say so.
    pub fn status(&mut self) -> Status {
        match self.ask(Ask::Status) {
            Answer::Status(status) => status,
            other => panic!("{other:?}"),
        }
    }

    /// Asks what it is doing until it does that.
    ///
    /// # Panics
    /// Where it does not.
    pub fn until(&mut self, times: u32, done: impl Fn(&Status) -> bool) -> Status {
        for _ in 0..times {
            let status = self.status();
            if done(&status) {
                return status;
            }
        }
        panic!("{:?}", self.status());
    }

    /// Sends pieces of a set of settings, header first; the first answer that is no consent.
    ///
    /// # Panics
    /// Where the board stops.
    pub fn put(&mut self, set: &[u8]) -> Option<Said> {
        for piece in Piece::of(set) {
            match self.ask(Ask::Put(piece)) {
                Answer::Taken => {}
                other => return Some(other),
            }
        }
        None
    }

    /// Positions of all masses, as they truly are, m.
    #[must_use]
    pub fn truth(&self) -> Vec<f64> {
        self.rig
            .plant()
            .state()
            .iter()
            .step_by(2)
            .copied()
            .collect()
    }
}

impl Default for Host {
    fn default() -> Self {
        Self::new()
    }
}
