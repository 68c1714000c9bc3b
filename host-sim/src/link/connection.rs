//! A drive that is spoken to: questions, each answered or given up, and telemetry that comes meanwhile.

use super::line::{Heard, Line};
use super::port::{BAUD, Port};
use crate::capture::Origin;
use crate::error::{Error, Result};
use crate::simulate::corridor::Record;
use arso_core::Identity;
use arso_core::link::message::{
    Answer, Ask, Asked, HELLO, Introduction, PastFault, Status, TAG, VERSION,
};
use arso_core::request::Request;
use std::collections::VecDeque;
use std::time::{Duration, Instant, SystemTime};

/// How often the drive is greeted, and how long its introduction is waited for each time.
const GREETINGS: usize = 5;
const GREETED: Duration = Duration::from_millis(200);
/// How often a question is asked, and how long its answer is waited for each time.
const TRIES: usize = 5;
const PATIENCE: Duration = Duration::from_millis(100);
/// The same in a jog, which the drive ends when it hears nothing for 100 ms.
const MOVING_TRIES: usize = 20;
const MOVING_PATIENCE: Duration = Duration::from_millis(25);
/// How often a drive may be busy, and for how long it is left alone then.
const BUSY_TRIES: usize = 50;
const BUSY: Duration = Duration::from_millis(5);
/// Telemetry that waits to be taken, at most: 4 s at 1 kHz.
const RECORDS: usize = 4096;

/// Control periods from one record to a later one; none where the drive was reset between them, whose periods begin
/// anew.
#[must_use]
pub fn passed(from: u32, to: u32) -> Option<u32> {
    let periods = to.wrapping_sub(from);
    (periods <= u32::MAX / 2).then_some(periods)
}

/// An answer; the number of loads is the drive's.
type Said = Answer<Vec<f32>>;

/// A drive that has introduced itself.
#[derive(Debug)]
pub struct Connection {
    line: Line,
    introduction: Introduction,
    origin: Origin,
    /// Of the last question, of the last request, and of the subscription.
    number: u8,
    requested: Option<u8>,
    subscription: Option<u8>,
    records: VecDeque<Record>,
}

impl Connection {
    /// Greets a drive.
    ///
    /// # Errors
    /// [`Error::Link`] when nothing answers, or a drive that speaks another version.
    pub fn new(port: Port) -> Result<Self> {
        let mut line = Line::new(port);
        let introduction = greeted(&mut line)?;
        let origin = understood(&introduction)?;
        // An answer to the program before must not be taken for one to this.
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let number = now.map_or(0, |time| time.subsec_micros() as u8);
        Ok(Self {
            line,
            introduction,
            origin,
            number,
            requested: None,
            subscription: None,
            records: VecDeque::new(),
        })
    }

    /// Greets the drive anew, which may be another one after its reset.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(super) fn greet_again(&mut self) -> Result<()> {
        self.introduction = greeted(&mut self.line)?;
        self.origin = understood(&self.introduction)?;
        self.requested = None;
        self.subscription = None;
        self.records.clear();
        Ok(())
    }

    /// How the drive introduced itself.
    #[must_use]
    pub fn introduction(&self) -> &Introduction {
        &self.introduction
    }

    /// Which drive it is.
    #[must_use]
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Asks, as often as it takes.
    ///
    /// # Errors
    /// [`Error::Link`] when no answer comes.
    pub fn ask(&mut self, ask: Ask) -> Result<Said> {
        self.ask_within(ask, PATIENCE, TRIES)
    }

    /// * `patience`: for an answer, each of so many `tries`
    pub(super) fn ask_within(
        &mut self,
        ask: Ask,
        patience: Duration,
        tries: usize,
    ) -> Result<Said> {
        let number = self.next_number();
        match &ask {
            Ask::Request(_) => self.requested = Some(number),
            Ask::Subscribe(every) => {
                self.records.clear();
                self.subscription = (*every > 0).then_some(number);
            }
            _ => {}
        }
        let asked = Asked { number, ask };
        let (mut left, mut busy) = (tries, BUSY_TRIES);
        while left > 0 && busy > 0 {
            self.line.send(TAG, &asked)?;
            match self.answer(number, Instant::now() + patience)? {
                Some(Answer::Busy) => {
                    busy -= 1;
                    std::thread::sleep(BUSY);
                }
                Some(answer) => return Ok(answer),
                None => left -= 1,
            }
        }
        let name = self.line.port.name();
        Err(Error::Link(if busy == 0 {
            format!("the drive on {name} takes no more requests")
        } else {
            let waited = tries as u128 * patience.as_millis();
            let request = match asked.ask {
                Ask::Request(_) => ": what was asked may have been done, and may yet be",
                _ => "",
            };
            format!("the drive on {name} has not answered for {waited} ms{request}")
        }))
    }

    /// Not that of the question before, nor one by which something else would be known.
    fn next_number(&mut self) -> u8 {
        loop {
            self.number = self.number.wrapping_add(1);
            let taken = [self.requested, self.subscription];
            if !taken.contains(&Some(self.number)) {
                return self.number;
            }
        }
    }

    /// The answer of that number, if it comes until then; telemetry that comes before it is kept.
    fn answer(&mut self, number: u8, until: Instant) -> Result<Option<Said>> {
        while let Some(heard) = self.line.hear(until)? {
            let Heard::Answered(said) = heard else {
                continue;
            };
            match said.answer {
                Answer::Telemetry(record) => self.keep(said.number, record),
                answer if said.number == number => return Ok(Some(answer)),
                _ => {}
            }
        }
        Ok(None)
    }

    /// Keeps a record; the oldest makes room. One with what is no number says nothing.
    fn keep(&mut self, number: u8, record: Record) {
        let whole = record.load_position.len() == record.load_velocity.len()
            && record.columns().all(|column| column.value.is_finite());
        if !whole || self.subscription != Some(number) {
            return;
        }
        if self.records.len() >= RECORDS {
            self.records.pop_front();
        }
        self.records.push_back(record);
    }

    /// What the drive is doing.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub fn status(&mut self) -> Result<Status> {
        match self.ask(Ask::Status)? {
            Answer::Status(status) => Ok(status),
            _ => Err(beside("what it is doing")),
        }
    }

    /// The same of a drive that moves for as long as it is spoken to.
    pub(super) fn status_in_jog(&mut self) -> Result<Status> {
        match self.ask_within(Ask::Status, MOVING_PATIENCE, MOVING_TRIES)? {
            Answer::Status(status) => Ok(status),
            _ => Err(beside("what it is doing")),
        }
    }

    /// Asks something of the drive.
    ///
    /// # Errors
    /// [`Error::Refused`] when the drive refuses; [`Error::Link`].
    pub fn request(&mut self, request: Request) -> Result<()> {
        match self.ask(Ask::Request(request))? {
            Answer::Taken => Ok(()),
            Answer::Refused(refusal) => Err(Error::Refused(refusal)),
            _ => Err(beside("to do something")),
        }
    }

    /// Lets the drive send a record of every so manieth control period, of none with zero.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub fn subscribe(&mut self, every: u16) -> Result<()> {
        self.ask(Ask::Subscribe(every)).map(drop)
    }

    /// The next record, if one comes in time.
    ///
    /// # Errors
    /// [`Error::Link`] when the line is gone.
    pub fn record(&mut self, timeout: Duration) -> Result<Option<Record>> {
        let until = Instant::now() + timeout;
        loop {
            if let Some(record) = self.records.pop_front() {
                return Ok(Some(record));
            }
            match self.line.hear(until)? {
                None => return Ok(None),
                Some(Heard::Answered(said)) => {
                    if let Answer::Telemetry(record) = said.answer {
                        self.keep(said.number, record);
                    }
                }
                Some(Heard::Introduction(_)) => {}
            }
        }
    }

    /// The last faults, the oldest first.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub fn faults(&mut self) -> Result<Vec<PastFault>> {
        match self.ask(Ask::Faults)? {
            Answer::Faults(faults) => Ok(faults.to_vec()),
            _ => Err(beside("for its faults")),
        }
    }

    /// Words of the last moves from one on; fewer at the end.
    pub(super) fn words(&mut self, first: u16) -> Result<Vec<u32>> {
        match self.ask(Ask::LastMoves(first))? {
            Answer::LastMoves(words) => Ok(words.to_vec()),
            _ => Err(beside("for its last moves")),
        }
    }
}

/// A drive that answers another question.
fn beside(question: &str) -> Error {
    Error::Link(format!("asked {question}, the drive says something else"))
}

/// Which drive it is that has introduced itself, if it speaks as this program does.
fn understood(introduction: &Introduction) -> Result<Origin> {
    let Introduction { version, tag, .. } = introduction;
    if (*version, *tag) != (VERSION, TAG) {
        return Err(Error::Link(format!(
            "the drive speaks version {version} of the link, tag {tag:#06x}, and this program version \
             {VERSION}, tag {TAG:#06x}: use the host-sim of the drive's firmware, {}",
            introduction.firmware
        )));
    }
    let identity = Identity {
        kind: &introduction.kind,
        loads: introduction.loads,
        sample_time: introduction.sample_time,
        fingerprint: introduction.fingerprint,
    };
    let positive = |value: f32| value.is_finite() && value > 0.0;
    let possible = positive(introduction.sample_time) && positive(introduction.resolution);
    let origin = Origin::said(&identity).filter(|_| possible);
    origin.ok_or_else(|| {
        Error::Link("the drive says of itself what no drive of this program is".into())
    })
}

/// The introduction of the drive on a line.
fn greeted(line: &mut Line) -> Result<Introduction> {
    for _ in 0..GREETINGS {
        line.send(HELLO, &())?;
        let until = Instant::now() + GREETED;
        while let Some(heard) = line.hear(until)? {
            // Whatever the program before had asked for may still be on its way.
            if let Heard::Introduction(introduction) = heard {
                return Ok(introduction);
            }
        }
    }
    let name = line.port.name();
    let rate = if line.port.is_serial() {
        format!(" at {} Mbaud", BAUD / 1_000_000)
    } else {
        String::new()
    };
    Err(Error::Link(match line.received {
        0 => format!(
            "nothing answers on {name}{rate}: is it the drive's port, is the drive powered, and does each end send \
             where the other receives?"
        ),
        bytes => format!(
            "no drive answers on {name}{rate}, though {bytes} bytes came: is it the port of its link, and of no log?"
        ),
    }))
}
