//! The drive on a board: one control period, and everything that may take its time.

use crate::board::{
    AmplifierFault, Board, ControlTimer, CurrentOutput, CycleCounter, Encoder, Hardware,
    HomeSwitch, Inputs, RunSwitch, Serial, SpareOf, Watchdog,
};
use crate::identity;
use crate::keeping::{Due, Keeping, Objection};
use crate::log::Log;
use crate::settings::{LOADS, Observer, Set, period_us, require_fit};
use crate::switches::Switches;
use arso_core::controller::{Change, Doing};
use arso_core::link::image::HEADER;
use arso_core::link::message::BYTES;
use arso_core::link::server::{Numbered, Seen, Server, Task};
use arso_core::record::{self, Recorder, Scale};
use arso_core::request::Reason;
use arso_core::{
    Controller, Counts, Current, Fault, Measurement, Mode, Refusal, Request, SettingsError,
    Telemetry,
};
use core::hint::black_box;
use heapless::Vec;
use heapless::spsc::{Consumer, Producer, Queue};

/// Records that wait for the log: 64 ms at 1 kHz.
const RECORDS: usize = 64;
/// Requests that wait for the interrupt, which takes one per period, and outcomes that wait for the idle loop.
const REQUESTS: usize = 8;
/// One less changes of settings that wait for the interrupt.
const CHANGES: usize = 2;
/// Bytes of the link in one turn of the idle loop: more than come in a control period, so that none waits for
/// long, and few enough that whatever they are the turn ends.
const LINK_BYTES: usize = 128;
/// Words of the ring of the last moves, which take 16 KiB in all: 4 s at 1 kHz, and of a move 2 s at most.
const RING: usize = 4096 - record::HEADER;

/// The last moves.
pub type LastMoves = record::LastMoves<RING>;

/// What goes between the control interrupt and the idle loop.
pub struct Queues {
    periods: Queue<Period, RECORDS>,
    requests: Queue<Numbered, REQUESTS>,
    outcomes: Queue<Outcome, REQUESTS>,
    changes: Queue<Settings, CHANGES>,
}

/// Other settings for the drive that runs.
type Settings = Change<'static, LOADS, Observer>;

/// What a control period was.
struct Period {
    record: Telemetry<[f32; LOADS]>,
    doing: Doing,
    /// Whether the run switch was closed.
    run_switch: bool,
}

/// What became of a request.
type Outcome = (Numbered, Result<(), Refusal>);

impl Queues {
    /// Empty ones.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "for a static")]
    pub const fn new() -> Self {
        Self {
            periods: Queue::new(),
            requests: Queue::new(),
            outcomes: Queue::new(),
            changes: Queue::new(),
        }
    }
}

/// What the control interrupt owns.
pub struct Control<B: Board> {
    timer: B::Timer,
    encoder: B::Encoder,
    output: B::Output,
    cycles: B::Cycles,
    run_switch: B::RunSwitch,
    amplifier_fault: B::AmplifierFault,
    home_switch: B::HomeSwitch,
    /// When the interrupt before this one began, and cycles of a control period.
    before: Option<u32>,
    cycles_per_period: u32,
    controller: Controller<'static, LOADS, Observer>,
    applied: Current,
    recorder: Recorder<'static, RING>,
    periods: Producer<'static, Period>,
    requests: Consumer<'static, Numbered>,
    outcomes: Producer<'static, Outcome>,
    changes: Consumer<'static, Settings>,
}

/// What the idle loop owns.
pub struct Idle<B: Board> {
    watchdog: B::Watchdog,
    inputs: B::Inputs,
    serial: B::Serial,
    switches: Switches,
    log: Log,
    link: Server<LOADS>,
    last_moves: &'static LastMoves,
    periods: Consumer<'static, Period>,
    requests: Producer<'static, Numbered>,
    outcomes: Consumer<'static, Outcome>,
    changes: Producer<'static, Settings>,
    set: Set,
    keeping: Keeping<SpareOf<B>>,
    mode: Mode,
}

/// The drive on a board.
///
/// * `set`: the settings that it runs with
/// * `last_moves`: where a debugger finds them, and the link
///
/// # Errors
/// When the settings cannot be run.
pub fn new<B: Board>(
    hardware: Hardware<B>,
    set: Set,
    queues: &'static mut Queues,
    last_moves: &'static LastMoves,
) -> Result<(Control<B>, Idle<B>), SettingsError> {
    const { require_fit(&B::CAPABILITIES) };
    let settings = &set.settings;
    let controller = Controller::new(settings, set.plans)?;
    let controller = match set.excitation {
        Some(excitation) => controller.with_excitation(excitation),
        None => controller,
    };
    let identity = identity::identity(&set);
    let recorder = Recorder::new(last_moves, &identity, Scale::of(settings));
    let (changes_in, changes_out) = queues.changes.split();
    let (periods_in, periods_out) = queues.periods.split();
    let (requests_in, requests_out) = queues.requests.split();
    let (outcomes_in, outcomes_out) = queues.outcomes.split();
    let control = Control {
        timer: hardware.timer,
        encoder: hardware.encoder,
        output: hardware.output,
        cycles: hardware.cycles,
        run_switch: hardware.run_switch,
        amplifier_fault: hardware.amplifier_fault,
        home_switch: hardware.home_switch,
        before: None,
        cycles_per_period: (B::Cycles::HZ / 1_000_000) * period_us(settings),
        controller,
        applied: Current(0.0),
        recorder,
        periods: periods_in,
        requests: requests_out,
        outcomes: outcomes_in,
        changes: changes_out,
    };
    let idle = Idle {
        watchdog: hardware.watchdog,
        inputs: hardware.inputs,
        serial: hardware.serial,
        switches: Switches::new(settings.encoder),
        log: Log::new(identity, set.source),
        link: Server::new(
            identity::introduction(&identity, &set),
            Current(settings.limits.current_limit),
            set.source,
        ),
        last_moves,
        periods: periods_out,
        requests: requests_in,
        outcomes: outcomes_out,
        changes: changes_in,
        keeping: Keeping::new(hardware.kept, settings.sample_time),
        mode: Mode::Idle,
        set,
    };
    Ok((control, idle))
}

impl<B: Board> Control<B> {
    /// One control period, called by the interrupt.
    #[inline]
    pub fn period(&mut self) {
        let start = self.cycles.now();
        self.timer.acknowledge();
        let run = self.run_switch.closed();
        if run {
            // What became of it can be told. Whether there is anything to tell of is seen sooner.
            if self.requests.ready()
                && self.outcomes.ready()
                && let Some(asked) = self.requests.dequeue()
            {
                let change = match asked.request {
                    Request::Change => self.changes.dequeue(),
                    _ => None,
                };
                let outcome = match change {
                    Some(change) => self.controller.change(&change),
                    None => self.controller.request(asked.request),
                };
                self.tell(asked, outcome);
            }
        } else {
            // What was asked before is void but for where zero is, and no idle loop, queue or log stands
            // between the switch and the amplifier.
            let _ = self.controller.request(Request::Stop);
            while let Some(asked) = self.requests.dequeue() {
                let outcome = match asked.request {
                    // They move nothing.
                    Request::SetPosition(_) | Request::Stop | Request::Store => {
                        self.controller.request(asked.request)
                    }
                    request => {
                        if request == Request::Change {
                            // Nor is what was handed over for it.
                            let _ = self.changes.dequeue();
                        }
                        Err(Refusal {
                            request,
                            mode: self.controller.mode(),
                            reason: Reason::RunSwitch,
                        })
                    }
                };
                self.tell(asked, outcome);
            }
        }
        if self.controller.mode().energised() {
            if self.late(start) {
                self.controller.trip(Fault::Timing);
            }
            if self.amplifier_fault.active() {
                self.controller.trip(Fault::Amplifier);
            }
        }
        self.before = Some(start);
        let measurement = Measurement {
            count: self.encoder.count(),
            current: self.applied,
            home: self.home_switch.active(),
        };
        // The compiler knows where the controller lies, and would put each of its addresses together anew.
        let command = black_box(&mut self.controller).step(measurement);
        self.applied = self.output.apply(&command);

        let record = self.controller.telemetry();
        let doing = self.controller.doing();
        self.recorder.step(
            record.period,
            Counts(record.count),
            Current(record.applied_current),
            doing.course,
        );
        let cycles = self.cycles.now().wrapping_sub(start);
        // A full queue loses the record; its number is missing in the log, which counts that.
        let _ = self.periods.enqueue(Period {
            record: Telemetry { cycles, ..*record },
            doing,
            run_switch: run,
        });
    }

    /// The idle loop is told what became of a request; of one that the switches made, if nothing did.
    fn tell(&mut self, asked: Numbered, outcome: Result<(), Refusal>) {
        if asked.number.is_some() || outcome.is_err() {
            // A full queue loses it, of requests that an open run switch makes void.
            let _ = self.outcomes.enqueue((asked, outcome));
        }
    }

    /// Whether this interrupt began more than a tenth of a period off the one before.
    fn late(&self, start: u32) -> bool {
        let period = self.cycles_per_period;
        self.before.is_some_and(|before| {
            let elapsed = start.wrapping_sub(before);
            elapsed.abs_diff(period) > period / 10
        })
    }
}

impl<B: Board> Idle<B> {
    /// Everything that may take its time, for ever.
    pub fn run(&mut self) -> ! {
        loop {
            let Some(period) = self.periods.dequeue() else {
                // The next control interrupt brings the next record.
                B::wait_for_interrupt();
                continue;
            };
            let Period {
                record,
                doing,
                run_switch,
            } = period;
            self.watchdog.feed();
            self.mode = record.mode;
            self.log.record(&record);
            while let Some((asked, outcome)) = self.outcomes.dequeue() {
                self.outcome(asked, outcome);
            }
            match self.keeping.period(record.mode) {
                Due::Nothing => {}
                Due::Opened(number, erased) => {
                    if let Some(number) = number {
                        self.opened(number, erased);
                    }
                }
                Due::Restart => B::restart(),
            }
            let seen = Seen {
                doing,
                run_switch,
                vibration: self.log.vibration(),
            };
            if let Some(halt) = self.link.period(&record, &seen) {
                self.ask(halt);
            }
            self.serve();
            // Who commands over the link commands alone; the run switch stops the drive all the same.
            if !self.link.remote() {
                let levels = self.inputs.read();
                let requests = self.switches.sample(run_switch, levels, record.mode);
                for request in requests.into_iter().flatten() {
                    let number = None;
                    self.ask(Numbered { number, request });
                }
            }
        }
    }

    /// What became of a request, and what follows from it.
    fn outcome(&mut self, asked: Numbered, outcome: Result<(), Refusal>) {
        match (asked.request, outcome) {
            (request, Err(refusal)) => {
                self.log.refusal(&refusal);
                if request == Request::Change {
                    let _ = self.keeping.changed();
                }
            }
            (Request::Store, Ok(())) => {
                // From now on no current flows, whatever is asked. It is answered when the flash is erased.
                self.watchdog.wait_for_flash();
                return self.keeping.open(asked.number);
            }
            (Request::Change, Ok(())) => {
                if let Some(settings) = self.keeping.changed() {
                    self.set.change(settings);
                    let limit = Current(self.set.settings.limits.current_limit);
                    let fingerprint = self.set.header.fingerprint;
                    self.link.changed(limit, fingerprint);
                    self.log.changed(fingerprint);
                    self.last_moves.changed(fingerprint);
                }
            }
            _ => {}
        }
        self.link.outcome(asked, outcome);
    }

    /// The flash is erased, or was not: what `Store` waits for.
    fn opened(&mut self, number: u8, erased: Result<(), Objection>) {
        let asked = Numbered {
            number: Some(number),
            request: Request::Store,
        };
        match erased {
            Ok(()) => self.link.outcome(asked, Ok(())),
            Err(objection) => self.link.settled(number, Err(objection)),
        }
    }

    /// What the link asks; whether that may have taken long.
    fn task(&mut self, task: Task) -> bool {
        let long = !matches!(task, Task::Request(_));
        match task {
            Task::Request(asked) => self.ask(asked),
            Task::Put(number, piece) => {
                let taken = self.keeping.put(self.mode, &piece);
                self.link.settled(number, taken);
            }
            Task::Take(number) => match self.mode {
                Mode::Storing => {
                    let kept = self.keeping.keep(&B::CAPABILITIES);
                    self.link.settled(number, kept);
                }
                Mode::Running => {
                    if let Err(objection) = self.change(number) {
                        self.link.settled(number, Err(objection));
                    }
                }
                _ => self.link.settled(number, Err(Objection::Mode)),
            },
            Task::Settings(number, at) => {
                let bytes = self.said(at.into());
                self.link.settings(number, bytes);
            }
        }
        long
    }

    /// Hands over settings that are staged; what becomes of them is said later.
    fn change(&mut self, number: u8) -> Result<(), Objection> {
        // The interrupt takes both in the same period.
        if !self.requests.ready() || !self.changes.ready() {
            self.link.busy(number);
            return Ok(());
        }
        let change = self.keeping.change(&self.set, &B::CAPABILITIES)?;
        // There is room for either.
        let _ = self.changes.enqueue(change);
        let number = Some(number);
        let request = Request::Change;
        self.ask(Numbered { number, request });
        Ok(())
    }

    /// Bytes of the present settings, header first.
    fn said(&self, at: usize) -> Vec<u8, BYTES> {
        let header = self.set.header.bytes();
        let mut bytes: Vec<u8, BYTES> = Vec::new();
        // There is room for either.
        let _ = bytes.extend_from_slice(header.get(at..).unwrap_or_default());
        let behind = bytes.len();
        let _ = bytes.resize_default(BYTES);
        let from = at.saturating_sub(HEADER);
        let room = bytes.get_mut(behind..).unwrap_or_default();
        let copied = self.set.copy(from, room);
        bytes.truncate(behind + copied);
        bytes
    }

    /// The bytes that have come over the link, and those that are to go.
    fn serve(&mut self) {
        for _ in 0..LINK_BYTES {
            let Some(byte) = self.serial.read() else {
                break;
            };
            let last_moves = self.last_moves;
            // One that takes long is the last of this turn.
            if let Some(task) = self.link.take(byte, |place| last_moves.word(place))
                && self.task(task)
            {
                break;
            }
        }
        if self.serial.send(self.link.waiting()) {
            self.link.taken();
        }
    }

    /// Puts a request to the control interrupt.
    fn ask(&mut self, asked: Numbered) {
        if self.requests.enqueue(asked).is_err() {
            defmt::warn!("a request was lost: the control interrupt takes none");
            if let Some(number) = asked.number {
                self.link.busy(number);
            }
        }
    }
}
