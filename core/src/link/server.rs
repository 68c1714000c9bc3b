//! The drive's end of the link, fed from its idle loop; knows nothing of lines and interrupts.
//!
//! ```text
//! bytes --take--> question --> answer ----------------------------------------+
//!                    | request: to the control interrupt                      v
//!                    +--------> outcome --outcome--> answer --> frames --waiting--> bytes
//!                    | settings: to whoever keeps them                        ^
//!                    +--------> settings, objected -> answer -----------------+
//! record of each period --period--> status, faults, telemetry ----------------^
//! ```
//!
//! *Once.* A request that comes again with its number, because its answer was lost, is answered again and not
//! carried out again. [`HELLO`] begins anew.
//!
//! *Silence.* A jog, and homing, goes on for as long as questions come. After [`SILENCE`] seconds without one, and where another
//! host says [`HELLO`], the machine is brought to rest by a plan.

use super::frame::{LONGEST, Receiver, frame};
use super::message::{
    Answer, Answered, Ask, Asked, BYTES, FAULTS, HELLO, Introduction, PastFault, Piece, Source,
    Status, TAG, WORDING, WORDS,
};
use crate::controller::Doing;
use crate::mode::Mode;
use crate::record::Course;
use crate::request::{Refusal, Request};
use crate::telemetry::Telemetry;
use crate::units::Current;
use core::fmt::{self, Write};
use heapless::{Deque, String, Vec};
use serde::Serialize;

/// How long nothing may be heard in a jog, or in homing, s.
pub const SILENCE: f32 = 0.1;
/// Bytes that wait for the line, at most.
pub const WAITING: usize = 512;

/// What is known of a period beside its record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// What is done with the machine.
    pub doing: Doing,
    /// Whether the run switch is closed.
    pub run_switch: bool,
    /// Vibration of the load, rms, m.
    pub vibration: f32,
}

/// A request, and the number under which it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbered {
    /// Of the question; none where the link did not ask.
    pub number: Option<u8>,
    /// What is asked.
    pub request: Request,
}

/// What the drive is to do for its host.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// To carry out a request, and to say what [became of it](Server::outcome).
    Request(Numbered),
    /// To take bytes of a set of settings, and to [answer](Server::settled) under that number.
    Put(u8, Piece),
    /// To take the set as it has come, and to [answer](Server::settled).
    Take(u8),
    /// To say bytes of the present settings, from that one on, by [`Server::settings`].
    Settings(u8, u16),
}

/// What the drive asks of itself where its host is not there.
const HALT: Numbered = Numbered {
    number: None,
    request: Request::Halt,
};

/// Telemetry that was subscribed to.
#[derive(Clone, Copy, Debug)]
struct Subscription {
    number: u8,
    /// Control periods from one to the next, and until the next.
    every: u16,
    left: u16,
}

/// What the drive's end of the link remembers; the drive has `N` load masses.
#[derive(Clone, Debug)]
pub struct Server<const N: usize> {
    introduction: Introduction,
    receiver: Receiver,
    waiting: Vec<u8, WAITING>,
    subscription: Option<Subscription>,
    /// The last request, and what became of it.
    last: Option<(Numbered, Option<Result<(), Refusal>>)>,
    status: Status,
    faults: Deque<PastFault, FAULTS>,
    /// Control periods without a frame, and how many are too many in a jog.
    silent: u32,
    patience: u32,
}

impl<const N: usize> Server<N> {
    /// A drive that nobody has spoken to.
    ///
    /// * `current_limit`: its largest current
    /// * `source`: where its settings are from
    #[must_use]
    pub fn new(introduction: Introduction, current_limit: Current, source: Source) -> Self {
        Self {
            // The cast saturates.
            patience: (SILENCE / introduction.sample_time) as u32,
            status: Status {
                current_limit: current_limit.0,
                source,
                fingerprint: introduction.fingerprint,
                ..Status::default()
            },
            introduction,
            receiver: Receiver::default(),
            waiting: Vec::new(),
            subscription: None,
            last: None,
            faults: Deque::new(),
            silent: 0,
        }
    }

    /// The drive goes on with other settings.
    ///
    /// * `current_limit`, `fingerprint`: of them
    pub fn changed(&mut self, current_limit: Current, fingerprint: u32) {
        self.status.current_limit = current_limit.0;
        self.status.source = Source::Changed;
        self.status.fingerprint = fingerprint;
        self.introduction.fingerprint = fingerprint;
    }

    /// Whether the link commands the drive: somebody has spoken since the reset.
    #[must_use]
    pub fn remote(&self) -> bool {
        self.status.remote
    }

    /// Takes a byte from the line; gives what is asked of the drive.
    ///
    /// * `word`: of the last moves, where there is such a one
    pub fn take(&mut self, byte: u8, word: impl Fn(usize) -> Option<u32>) -> Option<Task> {
        let Ok(frame) = self.receiver.take(byte)? else {
            self.damaged();
            return None;
        };
        if frame.tag == HELLO {
            // A question, and not what the drive says itself, come back from the other end.
            if frame.message() != Ok(()) {
                return None;
            }
            self.status.remote = true;
            (self.last, self.subscription) = (None, None);
            put(&mut self.waiting, HELLO, &self.introduction);
            let moves = self.status.jogging || self.status.homing;
            return moves.then_some(Task::Request(HALT));
        }
        // Of another version.
        if frame.tag != TAG {
            return None;
        }
        let Ok(asked) = frame.message() else {
            self.damaged();
            return None;
        };
        self.status.remote = true;
        self.silent = 0;
        self.answer(asked, word)
    }

    fn damaged(&mut self) {
        self.status.damaged = self.status.damaged.saturating_add(1);
    }

    fn answer(&mut self, asked: Asked, word: impl Fn(usize) -> Option<u32>) -> Option<Task> {
        let Asked { number, ask } = asked;
        let answer = match ask {
            Ask::Status => Answer::Status(self.status),
            Ask::Heartbeat => Answer::Taken,
            Ask::Subscribe(every) => {
                self.subscription = (every > 0).then_some(Subscription {
                    number,
                    every,
                    left: 0,
                });
                Answer::Taken
            }
            Ask::LastMoves(first) => {
                let places = usize::from(first)..usize::from(first) + WORDS;
                Answer::LastMoves(places.map_while(word).collect())
            }
            Ask::Faults => Answer::Faults(self.faults.iter().copied().collect()),
            Ask::Settings(at) => return Some(Task::Settings(number, at)),
            Ask::Put(piece) => return Some(Task::Put(number, piece)),
            Ask::Take => return Some(Task::Take(number)),
            Ask::Request(request) => {
                let asked = Numbered {
                    number: Some(number),
                    request,
                };
                match self.last {
                    Some((last, outcome)) if last == asked => match outcome {
                        Some(Ok(())) => Answer::Taken,
                        Some(Err(refusal)) => Answer::Refused(refusal),
                        None => return None,
                    },
                    _ => {
                        self.last = Some((asked, None));
                        return Some(Task::Request(asked));
                    }
                }
            }
        };
        self.say(number, answer);
        None
    }

    /// What was asked under that number cannot be put to the drive now.
    pub fn busy(&mut self, number: u8) {
        self.forget(number);
        self.say(number, Answer::Busy);
    }

    /// A request whose outcome is not awaited: asked again, it is another one.
    fn forget(&mut self, number: u8) {
        if let Some((last, None)) = self.last
            && last.number == Some(number)
        {
            self.last = None;
        }
    }

    /// What became of settings that came; an objection is said in words.
    pub fn settled<E: fmt::Display>(&mut self, number: u8, taken: Result<(), E>) {
        self.forget(number);
        let answer = match taken {
            Ok(()) => Answer::Taken,
            Err(objection) => {
                let mut words = Words(String::new());
                // As much of it as there is room for.
                let _ = write!(words, "{objection}");
                Answer::Objection(words.0)
            }
        };
        self.say(number, answer);
    }

    /// Bytes of the present settings.
    pub fn settings(&mut self, number: u8, bytes: Vec<u8, BYTES>) {
        self.say(number, Answer::Settings(bytes));
    }

    /// What became of a request, whoever asked.
    pub fn outcome(&mut self, asked: Numbered, outcome: Result<(), Refusal>) {
        let Some(number) = asked.number else {
            return;
        };
        if let Some((last, awaited @ None)) = &mut self.last
            && last.number == asked.number
        {
            *awaited = Some(outcome);
        }
        self.say(
            number,
            outcome.map_or_else(Answer::Refused, |()| Answer::Taken),
        );
    }

    /// Takes what a control period was; gives what is asked of the drive where the host has fallen silent.
    pub fn period(&mut self, record: &Telemetry<[f32; N]>, seen: &Seen) -> Option<Numbered> {
        let before = self.status;
        let expected = before.period.wrapping_add(1);
        // The first one has none before it.
        let missed = if before.period == 0 {
            0
        } else {
            record.period.wrapping_sub(expected)
        };
        let held = match seen.doing.course {
            Course::Held(place) if record.mode == Mode::Running => Some(place),
            _ => None,
        };
        self.status = Status {
            period: record.period,
            mode: record.mode,
            fault_value: record.fault_value,
            run_switch: seen.run_switch,
            position_set: record.position_set,
            jogging: seen.doing.jogs,
            homing: seen.doing.homes,
            held,
            position: record.position,
            reference: record.reference,
            velocity: record.velocity,
            command: record.command,
            current_limit: before.current_limit,
            source: before.source,
            fingerprint: before.fingerprint,
            limited: record.limited,
            vibration: seen.vibration,
            worst_cycles: before.worst_cycles.max(record.cycles),
            lost: before.lost.saturating_add(missed),
            remote: before.remote,
            damaged: before.damaged,
        };
        self.remember(before.mode, record);
        self.stream(record);
        self.silent = self.silent.saturating_add(1);
        // Until it does not.
        ((seen.doing.jogs || seen.doing.homes) && self.silent >= self.patience).then_some(HALT)
    }

    /// A fault that is new is kept; the oldest makes room.
    fn remember(&mut self, before: Mode, record: &Telemetry<[f32; N]>) {
        let Some(fault) = record.mode.fault() else {
            return;
        };
        if before.fault() == Some(fault) {
            return;
        }
        if self.faults.is_full() {
            self.faults.pop_front();
        }
        let (period, value) = (record.period, record.fault_value);
        let past = PastFault {
            period,
            fault,
            value,
        };
        // There is room.
        let _ = self.faults.push_back(past);
    }

    /// Telemetry leaves room for an answer: it is the first to be missed where the line is too slow.
    fn stream(&mut self, record: &Telemetry<[f32; N]>) {
        let Some(subscription) = &mut self.subscription else {
            return;
        };
        if subscription.left > 1 {
            subscription.left -= 1;
            return;
        }
        subscription.left = subscription.every;
        let number = subscription.number;
        if self.waiting.len() + 2 * LONGEST <= WAITING {
            self.say(number, Answer::Telemetry(*record));
        }
    }

    fn say(&mut self, number: u8, answer: Answer<[f32; N]>) {
        put(&mut self.waiting, TAG, &Answered { number, answer });
    }

    /// What waits for the line: whole frames.
    #[must_use]
    pub fn waiting(&self) -> &[u8] {
        &self.waiting
    }

    /// The line has taken all that [`waiting`](Self::waiting) gave.
    pub fn taken(&mut self) {
        self.waiting.clear();
    }
}

/// A sentence that is cut where there is no more room.
struct Words(String<WORDING>);

impl Write for Words {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let mut letters = text.chars();
        let whole = letters.all(|letter| self.0.push(letter).is_ok());
        if whole { Ok(()) } else { Err(fmt::Error) }
    }
}

/// A frame behind those that wait. What finds no room is lost, and its host asks again.
fn put<T: Serialize>(waiting: &mut Vec<u8, WAITING>, tag: u16, message: &T) {
    let mut buffer = [0; LONGEST];
    if let Some(bytes) = frame(tag, message, &mut buffer) {
        let _ = waiting.extend_from_slice(bytes);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::fault::Fault;
    use crate::link::message::VERSION;
    use crate::request::Reason;
    use crate::units::{Place, Velocity};
    use std::borrow::ToOwned;
    use std::vec::Vec as List;

    type Heard = Answered<List<f32>>;

    fn server() -> Server<3> {
        let introduction = Introduction {
            version: VERSION,
            tag: TAG,
            firmware: "0.1.0".try_into().unwrap(),
            kind: "linear".try_into().unwrap(),
            loads: 3,
            sample_time: 1e-3,
            resolution: 1e-6,
            fingerprint: 0x1234_5678,
        };
        Server::new(introduction, Current(1.85), Source::CompiledIn)
    }

    /// The request that comes of a message.
    fn send<T: Serialize>(server: &mut Server<3>, tag: u16, message: &T) -> Option<Numbered> {
        match task(server, tag, message) {
            Some(Task::Request(asked)) => Some(asked),
            None => None,
            Some(other) => panic!("{other:?}"),
        }
    }

    fn task<T: Serialize>(server: &mut Server<3>, tag: u16, message: &T) -> Option<Task> {
        let mut buffer = [0; LONGEST];
        let bytes = frame(tag, message, &mut buffer).unwrap();
        let mut given = bytes
            .iter()
            .filter_map(|byte| server.take(*byte, |place| (place < 30).then_some(place as u32)))
            .collect::<List<_>>();
        assert!(given.len() < 2);
        given.pop()
    }

    fn ask(server: &mut Server<3>, number: u8, ask: Ask) -> Option<Numbered> {
        send(server, TAG, &Asked { number, ask })
    }

    fn heard(server: &mut Server<3>) -> List<Heard> {
        let mut receiver = Receiver::default();
        let mut heard = List::new();
        for byte in server.waiting() {
            if let Some(frame) = receiver.take(*byte) {
                let frame = frame.unwrap();
                assert_eq!(frame.tag, TAG);
                heard.push(frame.message().unwrap());
            }
        }
        server.taken();
        heard
    }

    fn answer(server: &mut Server<3>) -> Answer<List<f32>> {
        let mut heard = heard(server);
        assert_eq!(heard.len(), 1);
        heard.remove(0).answer
    }

    fn period(server: &mut Server<3>, number: u32, mode: Mode, course: Course) -> Option<Numbered> {
        seen(server, number, mode, course, false)
    }

    fn jog(server: &mut Server<3>, number: u32) -> Option<Numbered> {
        seen(server, number, Mode::Running, Course::Moved, true)
    }

    fn home(server: &mut Server<3>, number: u32) -> Option<Numbered> {
        let record = Telemetry::<[f32; 3]> {
            period: number,
            mode: Mode::Running,
            ..Telemetry::default()
        };
        let seen = Seen {
            doing: Doing {
                course: Course::Moved,
                jogs: false,
                homes: true,
            },
            run_switch: true,
            vibration: 0.5,
        };
        server.period(&record, &seen)
    }

    fn seen(
        server: &mut Server<3>,
        number: u32,
        mode: Mode,
        course: Course,
        jogs: bool,
    ) -> Option<Numbered> {
        let record = Telemetry::<[f32; 3]> {
            period: number,
            mode,
            fault_value: number as f32,
            ..Telemetry::default()
        };
        let seen = Seen {
            doing: Doing {
                course,
                jogs,
                homes: false,
            },
            run_switch: true,
            vibration: 0.5,
        };
        server.period(&record, &seen)
    }

    /// What concerns settings is passed on with its number, and what came of it is said under that.
    #[test]
    fn settings_are_passed_on() {
        let mut server = server();
        let piece = Piece {
            at: 128,
            bytes: Vec::from_slice(&[0; BYTES]).unwrap(),
        };
        for (ask, expected) in [
            (Ask::Put(piece.clone()), Task::Put(9, piece)),
            (Ask::Take, Task::Take(9)),
            (Ask::Settings(256), Task::Settings(9, 256)),
        ] {
            let asked = Asked { number: 9, ask };
            assert_eq!(task(&mut server, TAG, &asked), Some(expected));
            assert_eq!(server.waiting(), []);
        }
        server.settled(9, Ok::<_, &str>(()));
        assert_eq!(answer(&mut server), Answer::Taken);
        // As much of a sentence as there is room for is a message still.
        let long = "too long ".repeat(30);
        server.settled(9, Err(&long));
        server.settled(10, Err("the settings are damaged"));
        let heard = heard(&mut server);
        assert_eq!(heard.len(), 2);
        let words = |heard: &Heard| match &heard.answer {
            Answer::Objection(words) => words.as_str().to_owned(),
            other => panic!("{other:?}"),
        };
        assert!(long.starts_with(&words(&heard[0])));
        assert_eq!(words(&heard[1]), "the settings are damaged");
        server.settings(11, Vec::from_slice(&[7; BYTES]).unwrap());
        let Answer::Settings(bytes) = answer(&mut server) else {
            panic!("no settings");
        };
        assert_eq!(bytes.as_slice(), [7; BYTES]);

        server.changed(Current(5.0), 77);
        ask(&mut server, 12, Ask::Status);
        let Answer::Status(status) = answer(&mut server) else {
            panic!("no status");
        };
        assert_eq!(
            (status.source, status.fingerprint, status.current_limit),
            (Source::Changed, 77, 5.0)
        );
    }

    const JOG: Request = Request::Jog(Velocity(0.1));

    #[test]
    fn a_request_is_carried_out_once_and_answered_as_often_as_it_comes() {
        let mut server = server();
        let request = Request::MoveBy(5);
        let taken = ask(&mut server, 7, Ask::Request(request)).unwrap();
        assert_eq!((taken.number, taken.request), (Some(7), request));
        // Its outcome is not known yet.
        assert_eq!(ask(&mut server, 7, Ask::Request(request)), None);
        assert_eq!(heard(&mut server), []);
        let refusal = Refusal {
            request,
            mode: Mode::Idle,
            reason: Reason::Mode,
        };
        server.outcome(taken, Err(refusal));
        assert_eq!(answer(&mut server), Answer::Refused(refusal));
        assert_eq!(ask(&mut server, 7, Ask::Request(request)), None);
        assert_eq!(answer(&mut server), Answer::Refused(refusal));
        // Questions between do not make it new; another number does, another request does, a greeting does.
        assert_eq!(ask(&mut server, 8, Ask::Heartbeat), None);
        assert_eq!(ask(&mut server, 7, Ask::Request(request)), None);
        assert!(ask(&mut server, 9, Ask::Request(request)).is_some());
        assert!(ask(&mut server, 9, Ask::Request(Request::Halt)).is_some());
        server.taken();
        assert_eq!(send(&mut server, HELLO, &()), None);
        let mut receiver = Receiver::default();
        let (last, rest) = server.waiting().split_last().unwrap();
        assert!(rest.iter().all(|byte| receiver.take(*byte).is_none()));
        let frame = receiver.take(*last).unwrap().unwrap();
        assert_eq!(frame.tag, HELLO);
        assert_eq!(frame.message(), Ok(server.introduction.clone()));
        server.taken();
        assert!(ask(&mut server, 9, Ask::Request(Request::Halt)).is_some());
        // What could not be put to the drive may come again.
        server.busy(9);
        assert_eq!(answer(&mut server), Answer::Busy);
        assert!(ask(&mut server, 9, Ask::Request(Request::Halt)).is_some());
    }

    #[test]
    fn whoever_speaks_takes_the_drive_over() {
        let mut noise = server();
        noise.take(3, |_| None);
        noise.take(0, |_| None);
        send(&mut noise, TAG ^ 0x5555, &());
        // Its own voice, from a line that is short-circuited.
        let introduction = noise.introduction.clone();
        send(&mut noise, HELLO, &introduction);
        assert!(!noise.remote() && noise.waiting().is_empty());
        let mut greeted = server();
        send(&mut greeted, HELLO, &());
        assert!(greeted.remote());
        let mut asked = server();
        ask(&mut asked, 1, Ask::Status);
        assert!(asked.remote());
    }

    #[test]
    fn a_jog_ends_where_the_host_falls_silent() {
        let mut server = server();
        let asked = ask(&mut server, 1, Ask::Request(JOG)).unwrap();
        server.outcome(asked, Ok(()));
        for number in 0..99 {
            assert_eq!(jog(&mut server, number), None);
        }
        // A question is a sign of life; noise and frames of other versions are none.
        ask(&mut server, 2, Ask::Heartbeat);
        for number in 0..99 {
            assert_eq!(jog(&mut server, number), None);
            send(&mut server, TAG ^ 0x5555, &());
            server.take(1, |_| None);
            server.take(0, |_| None);
        }
        // Until it ends: a request may get lost.
        for number in 99..110 {
            let halt = jog(&mut server, number).unwrap();
            assert_eq!((halt.number, halt.request), (None, Request::Halt));
            // Nobody is answered.
            server.taken();
            server.outcome(halt, Ok(()));
            assert_eq!(heard(&mut server), []);
        }
        // A move needs no sign of life.
        for number in 110..500 {
            assert_eq!(
                period(&mut server, number, Mode::Running, Course::Moved),
                None
            );
        }
        // Another host does not go on with a jog that is not its own.
        ask(&mut server, 3, Ask::Heartbeat);
        assert_eq!(jog(&mut server, 500), None);
        assert_eq!(send(&mut server, HELLO, &()), Some(HALT));
    }

    /// As a jog.
    #[test]
    fn homing_ends_where_the_host_falls_silent() {
        let mut server = server();
        ask(&mut server, 1, Ask::Heartbeat);
        for number in 0..99 {
            assert_eq!(home(&mut server, number), None);
        }
        assert_eq!(home(&mut server, 99), Some(HALT));
        ask(&mut server, 2, Ask::Heartbeat);
        assert_eq!(home(&mut server, 100), None);
        assert_eq!(send(&mut server, HELLO, &()), Some(HALT));
    }

    #[test]
    fn faults_are_remembered_once_each_the_newest_eight() {
        let mut server = server();
        let mut expected = List::new();
        for number in 0..10 {
            let fault = if number % 2 == 0 {
                Fault::Thermal
            } else {
                Fault::Travel
            };
            let begin = 10 * number + 1;
            period(&mut server, begin - 1, Mode::Running, Course::Moved);
            period(&mut server, begin, Mode::Stopping(fault), Course::Moved);
            period(&mut server, begin + 1, Mode::Stopping(fault), Course::Moved);
            period(&mut server, begin + 2, Mode::Fault(fault), Course::Free);
            expected.push(PastFault {
                period: begin,
                fault,
                value: begin as f32,
            });
        }
        ask(&mut server, 1, Ask::Faults);
        let Answer::Faults(faults) = answer(&mut server) else {
            panic!("no faults");
        };
        assert_eq!(faults[..], expected[2..]);
    }

    #[test]
    fn telemetry_comes_at_its_rate_and_leaves_room_for_answers() {
        let mut server = server();
        ask(&mut server, 3, Ask::Subscribe(4));
        assert_eq!(answer(&mut server), Answer::Taken);
        let mut periods = List::new();
        for number in 1..=12 {
            period(&mut server, number, Mode::Idle, Course::Free);
            for heard in heard(&mut server) {
                assert_eq!(heard.number, 3);
                let Answer::Telemetry(record) = heard.answer else {
                    panic!("{heard:?}");
                };
                assert_eq!(record.load_position.len(), 3);
                periods.push(record.period);
            }
        }
        assert_eq!(periods, [1, 5, 9]);
        // The line takes nothing for a while.
        ask(&mut server, 4, Ask::Subscribe(1));
        for number in 13..100 {
            period(&mut server, number, Mode::Idle, Course::Free);
        }
        ask(&mut server, 5, Ask::LastMoves(6));
        let mut heard = heard(&mut server);
        let words: heapless::Vec<u32, WORDS> = (6..30).collect();
        assert_eq!(heard.pop().unwrap().answer, Answer::LastMoves(words));
        assert!(heard.len() > 2);
        // None beyond the last, however far.
        for first in [30, u16::MAX] {
            ask(&mut server, 6, Ask::LastMoves(first));
            assert_eq!(answer(&mut server), Answer::LastMoves(Vec::new()));
        }
    }

    #[test]
    fn the_status_is_that_of_the_last_period() {
        let mut server = server();
        period(&mut server, 1, Mode::Idle, Course::Free);
        period(&mut server, 5, Mode::Running, Course::Held(Place(8)));
        server.take(3, |_| None);
        server.take(0, |_| None);
        ask(&mut server, 1, Ask::Status);
        let expected = Status {
            period: 5,
            mode: Mode::Running,
            fault_value: 5.0,
            run_switch: true,
            remote: true,
            held: Some(Place(8)),
            current_limit: 1.85,
            fingerprint: 0x1234_5678,
            vibration: 0.5,
            lost: 3,
            damaged: 1,
            ..Status::default()
        };
        assert_eq!(answer(&mut server), Answer::Status(expected));
    }
}
