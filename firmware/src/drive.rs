//! The drive on a board: one control period, and everything that may take its time.

use crate::board::{
    AmplifierFault, Board, ControlTimer, CurrentOutput, CycleCounter, Encoder, Hardware,
    HomeSwitch, Inputs, RunSwitch, Serial, Watchdog,
};
use crate::identity;
use crate::log::Log;
use crate::settings::{EXCITATION, GAINS, LOADS, Observer, PERIOD_US, PLANS};
use crate::switches::Switches;
use arso_core::link::server::{Numbered, Seen, Server};
use arso_core::record::{self, Course, Recorder, Scale};
use arso_core::request::Reason;
use arso_core::{
    Controller, Counts, Current, Fault, Measurement, Refusal, Request, SettingsError, Telemetry,
};
use heapless::spsc::{Consumer, Producer, Queue};

/// Records that wait for the log: 64 ms at 1 kHz.
const RECORDS: usize = 64;
/// Requests that wait for the interrupt, which takes one per period, and outcomes that wait for the idle loop.
const REQUESTS: usize = 8;
/// Bytes of the link in one turn of the idle loop: more than come in a control period, so that none waits for
/// long, and few enough that whatever they are the turn ends.
const BYTES: usize = 128;
/// Words of the ring of the last moves, which take 16 KiB in all: 4 s at 1 kHz, and of a move 2 s at most.
const RING: usize = 4096 - record::HEADER;

/// The last moves.
pub type LastMoves = record::LastMoves<RING>;

/// What goes between the control interrupt and the idle loop.
pub struct Queues {
    periods: Queue<Period, RECORDS>,
    requests: Queue<Numbered, REQUESTS>,
    outcomes: Queue<Outcome, REQUESTS>,
}

/// What a control period was.
struct Period {
    record: Telemetry<[f32; LOADS]>,
    /// What was done with the machine, whether it jogs, and whether it homes.
    course: Course,
    jogs: bool,
    homes: bool,
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
    /// When the interrupt before this one began.
    before: Option<u32>,
    controller: Controller<'static, LOADS, Observer>,
    applied: Current,
    recorder: Recorder<'static, RING>,
    periods: Producer<'static, Period>,
    requests: Consumer<'static, Numbered>,
    outcomes: Producer<'static, Outcome>,
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
}

/// The drive on a board.
///
/// * `last_moves`: where a debugger finds them, and the link
///
/// # Errors
/// When the settings cannot be run.
pub fn new<B: Board>(
    hardware: Hardware<B>,
    queues: &'static mut Queues,
    last_moves: &'static LastMoves,
) -> Result<(Control<B>, Idle<B>), SettingsError> {
    const { crate::settings::require_fit(&B::CAPABILITIES) };
    let controller = Controller::new(&GAINS, PLANS)?.with_excitation(EXCITATION);
    let identity = identity::identity();
    let recorder = Recorder::new(last_moves, &identity, Scale::of(&GAINS));
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
        controller,
        applied: Current(0.0),
        recorder,
        periods: periods_in,
        requests: requests_out,
        outcomes: outcomes_in,
    };
    let idle = Idle {
        watchdog: hardware.watchdog,
        inputs: hardware.inputs,
        serial: hardware.serial,
        switches: Switches::default(),
        log: Log::new(identity),
        link: Server::new(
            identity::introduction(&identity),
            Current(GAINS.limits.current_limit),
        ),
        last_moves,
        periods: periods_out,
        requests: requests_in,
        outcomes: outcomes_out,
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
            // What became of it can be told.
            if self.outcomes.ready()
                && let Some(asked) = self.requests.dequeue()
            {
                let outcome = self.controller.request(asked.request);
                self.tell(asked, outcome);
            }
        } else {
            // What was asked before is void but for where zero is, and no idle loop, queue or log stands
            // between the switch and the amplifier.
            let _ = self.controller.request(Request::Stop);
            while let Some(asked) = self.requests.dequeue() {
                let outcome = match asked.request {
                    // They move nothing.
                    Request::SetPosition(_) | Request::Stop => {
                        self.controller.request(asked.request)
                    }
                    request => Err(Refusal {
                        request,
                        mode: self.controller.mode(),
                        reason: Reason::RunSwitch,
                    }),
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
        let command = self.controller.step(measurement);
        self.applied = self.output.apply(&command);

        let mut record = *self.controller.telemetry();
        let course = self.controller.course();
        self.recorder.step(
            record.period,
            Counts(record.count),
            Current(record.applied_current),
            course,
        );
        record.cycles = self.cycles.now().wrapping_sub(start);
        // A full queue loses the record; its number is missing in the log, which counts that.
        let _ = self.periods.enqueue(Period {
            record,
            course,
            jogs: self.controller.jogs(),
            homes: self.controller.homes(),
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
        let period = (B::Cycles::HZ / 1_000_000) * PERIOD_US;
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
                course,
                jogs,
                homes,
                run_switch,
            } = period;
            self.watchdog.feed();
            self.log.record(&record);
            while let Some((asked, outcome)) = self.outcomes.dequeue() {
                if let Err(refusal) = outcome {
                    self.log.refusal(&refusal);
                }
                self.link.outcome(asked, outcome);
            }
            let seen = Seen {
                course,
                jogs,
                homes,
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

    /// The bytes that have come over the link, and those that are to go.
    fn serve(&mut self) {
        for _ in 0..BYTES {
            let Some(byte) = self.serial.read() else {
                break;
            };
            let last_moves = self.last_moves;
            if let Some(asked) = self.link.take(byte, |place| last_moves.word(place)) {
                self.ask(asked);
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
            if asked.number.is_some() {
                self.link.busy();
            }
        }
    }
}
