//! Firmware of the drive: start-up, the control interrupt, and the idle loop.
//!
//! ```text
//! TIM2 update, every control period, nothing can delay it:
//!     read encoder -> Controller::step -> current output -> record into a queue
//! idle loop, in what time is left:
//!     switches -> requests into a queue; records out of the queue -> defmt over RTT
//! ```
//!
//! The two share nothing but two lock-free queues. All that touches hardware is in [`board`], gains
//! and excitation are generated ([`gains`], [`excitation`]), and what happens between encoder and current is
//! `arso_core::Controller`, the same that the simulation runs.
#![cfg_attr(target_os = "none", no_std, no_main)]
#![deny(unsafe_code)]

#[cfg(not(target_os = "none"))]
compile_error!(
    "the firmware is built for the drive board: `cargo fw`, or tests/build-firmware where the \
     target thumbv7em-none-eabihf is not installed"
);

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod excitation;
#[cfg(target_os = "none")]
mod gains;
#[cfg(target_os = "none")]
mod log;
#[cfg(target_os = "none")]
mod switches;

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac)]
mod app {
    use crate::board::{
        self, ControlTimer, CurrentOutput, Cycles, DacOutput, Encoder, Inputs, Watchdog,
    };
    use crate::gains::{GAINS, LOADS, STATES};
    use crate::log::Log;
    use crate::switches::Switches;
    use arso_core::{Controller, Current, Measurement, Request, Telemetry};
    use heapless::spsc::{Consumer, Producer, Queue};

    /// Records that wait for the log: 64 ms at 1 kHz.
    const RECORDS: usize = 64;
    /// Requests that wait for the interrupt, which takes one per period.
    const REQUESTS: usize = 8;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        timer: ControlTimer,
        encoder: Encoder,
        output: DacOutput,
        cycles: Cycles,
        controller: Controller<LOADS, STATES>,
        applied: Current,
        records: Producer<'static, Telemetry<LOADS>>,
        requests: Consumer<'static, Request>,
        idle: Idle,
    }

    /// What the idle loop owns.
    pub(crate) struct Idle {
        watchdog: Watchdog,
        inputs: Inputs,
        switches: Switches,
        log: Log,
        records: Consumer<'static, Telemetry<LOADS>>,
        requests: Producer<'static, Request>,
    }

    #[init(local = [
        record_queue: Queue<Telemetry<LOADS>, RECORDS> = Queue::new(),
        request_queue: Queue<Request, REQUESTS> = Queue::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let board = board::start(cx.device, cx.core);
        let Ok(controller) = Controller::new(&GAINS) else {
            defmt::error!("the gains of this firmware cannot be run");
            board::stop();
        };
        let (records_in, records_out) = cx.local.record_queue.split();
        let (requests_in, requests_out) = cx.local.request_queue.split();
        defmt::info!(
            "drive ready: {} loads, period {} s",
            LOADS,
            GAINS.sample_time
        );
        let local = Local {
            timer: board.timer,
            encoder: board.encoder,
            output: board.output,
            cycles: board.cycles,
            controller,
            applied: Current(0.0),
            records: records_in,
            requests: requests_out,
            idle: Idle {
                watchdog: board.watchdog,
                inputs: board.inputs,
                switches: Switches::default(),
                log: Log::new(GAINS.sample_time),
                records: records_out,
                requests: requests_in,
            },
        };
        (Shared {}, local)
    }

    /// One control period. The highest priority there is: no critical section masks it.
    #[task(
        binds = TIM2,
        priority = 16,
        local = [timer, encoder, output, cycles, controller, applied, records, requests]
    )]
    fn control(cx: control::Context) {
        let start = cx.local.cycles.now();
        cx.local.timer.acknowledge();
        if let Some(request) = cx.local.requests.dequeue() {
            cx.local.controller.request(request);
        }
        let measurement = Measurement {
            count: cx.local.encoder.count(),
            current: *cx.local.applied,
        };
        let command = cx.local.controller.step(measurement);
        *cx.local.applied = cx.local.output.apply(&command);

        let mut record = *cx.local.controller.telemetry();
        record.cycles = cx.local.cycles.since(start);
        // A full queue loses the record; its number is missing in the log, which counts that.
        let _ = cx.local.records.enqueue(record);
    }

    /// Everything that may take its time.
    #[idle(local = [idle])]
    fn idle(cx: idle::Context) -> ! {
        let Idle {
            watchdog,
            inputs,
            switches,
            log,
            records,
            requests,
        } = cx.local.idle;
        loop {
            let Some(record) = records.dequeue() else {
                // The next control interrupt brings the next record.
                board::wait_for_interrupt();
                continue;
            };
            watchdog.feed();
            log.record(&record);
            for request in switches
                .sample(inputs.read(), record.state)
                .into_iter()
                .flatten()
            {
                if requests.enqueue(request).is_err() {
                    defmt::warn!("a request was lost: the control interrupt takes none");
                }
            }
        }
    }
}
