//! The drive on a board: one control period, and everything that may take its time.

use crate::board::{
    AmplifierFault, Board, ControlTimer, CurrentOutput, CycleCounter, Encoder, Hardware, Inputs,
    RunSwitch, Watchdog,
};
use crate::log::{self, Log};
use crate::settings::{EXCITATION, GAINS, LOADS, Observer, PERIOD_US, PLANS};
use crate::switches::Switches;
use arso_core::record::{self, Recorder, Scale};
use arso_core::{
    Controller, Counts, Current, Fault, Measurement, Refusal, Request, SettingsError, Telemetry,
};
use heapless::spsc::{Consumer, Producer, Queue};

/// Records that wait for the log: 64 ms at 1 kHz.
const RECORDS: usize = 64;
/// Requests that wait for the interrupt, which takes one per period, and refusals that wait for the log.
const REQUESTS: usize = 8;
/// Words of the ring of the last moves, which take 16 KiB in all: 4 s at 1 kHz, and of a move 2 s at most.
const RING: usize = 4096 - record::HEADER;

/// The last moves.
pub type LastMoves = record::LastMoves<RING>;

/// What goes between the control interrupt and the idle loop.
pub struct Queues {
    records: Queue<(Record, bool), RECORDS>,
    requests: Queue<Request, REQUESTS>,
    refusals: Queue<Refusal, REQUESTS>,
}

type Record = Telemetry<[f32; LOADS]>;

impl Queues {
    /// Empty ones.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "for a static")]
    pub const fn new() -> Self {
        Self {
            records: Queue::new(),
            requests: Queue::new(),
            refusals: Queue::new(),
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
    /// When the interrupt before this one began.
    before: Option<u32>,
    controller: Controller<'static, LOADS, Observer>,
    applied: Current,
    recorder: Recorder<'static, RING>,
    records: Producer<'static, (Record, bool)>,
    requests: Consumer<'static, Request>,
    refusals: Producer<'static, Refusal>,
}

/// What the idle loop owns.
pub struct Idle<B: Board> {
    watchdog: B::Watchdog,
    inputs: B::Inputs,
    switches: Switches,
    log: Log,
    records: Consumer<'static, (Record, bool)>,
    requests: Producer<'static, Request>,
    refusals: Consumer<'static, Refusal>,
}

/// The drive on a board.
///
/// * `last_moves`: where a debugger finds them
///
/// # Errors
/// When the settings cannot be run.
pub fn new<B: Board>(
    hardware: Hardware<B>,
    queues: &'static mut Queues,
    last_moves: &'static mut LastMoves,
) -> Result<(Control<B>, Idle<B>), SettingsError> {
    const { crate::settings::require_fit(&B::CAPABILITIES) };
    let controller = Controller::new(&GAINS, PLANS)?.with_excitation(EXCITATION);
    let identity = log::identity();
    let recorder = Recorder::new(last_moves, &identity, Scale::of(&GAINS));
    let (records_in, records_out) = queues.records.split();
    let (requests_in, requests_out) = queues.requests.split();
    let (refusals_in, refusals_out) = queues.refusals.split();
    let control = Control {
        timer: hardware.timer,
        encoder: hardware.encoder,
        output: hardware.output,
        cycles: hardware.cycles,
        run_switch: hardware.run_switch,
        amplifier_fault: hardware.amplifier_fault,
        before: None,
        controller,
        applied: Current(0.0),
        recorder,
        records: records_in,
        requests: requests_out,
        refusals: refusals_in,
    };
    let idle = Idle {
        watchdog: hardware.watchdog,
        inputs: hardware.inputs,
        switches: Switches::default(),
        log: Log::new(identity),
        records: records_out,
        requests: requests_in,
        refusals: refusals_out,
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
            if let Some(request) = self.requests.dequeue()
                && let Err(refusal) = self.controller.request(request)
            {
                // A full queue loses the refusal: as many others are on their way to the log.
                let _ = self.refusals.enqueue(refusal);
            }
        } else {
            // What was asked before is void but for where zero is, and no idle loop, queue or log stands
            // between the switch and the amplifier.
            let _ = self.controller.request(Request::Stop);
            while let Some(request) = self.requests.dequeue() {
                // It moves nothing.
                if let Request::SetPosition(_) = request {
                    let _ = self.controller.request(request);
                }
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
        };
        let command = self.controller.step(measurement);
        self.applied = self.output.apply(&command);

        let mut record = *self.controller.telemetry();
        self.recorder.step(
            record.period,
            Counts(record.count),
            Current(record.applied_current),
            self.controller.course(),
        );
        record.cycles = self.cycles.now().wrapping_sub(start);
        // A full queue loses the record; its number is missing in the log, which counts that.
        let _ = self.records.enqueue((record, run));
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
            let Some((record, run)) = self.records.dequeue() else {
                // The next control interrupt brings the next record.
                B::wait_for_interrupt();
                continue;
            };
            self.watchdog.feed();
            self.log.record(&record);
            while let Some(refusal) = self.refusals.dequeue() {
                self.log.refusal(&refusal);
            }
            let requests = self.switches.sample(run, self.inputs.read(), record.mode);
            for request in requests.into_iter().flatten() {
                if self.requests.enqueue(request).is_err() {
                    defmt::warn!("a request was lost: the control interrupt takes none");
                }
            }
        }
    }
}
