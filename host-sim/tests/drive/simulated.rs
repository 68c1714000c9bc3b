//! A drive on a line: the control core, the drive's end of the link and the exact plant, a period each millisecond.

use arso_core::link::frame::{LONGEST, Receiver, frame};
use arso_core::link::message::{HELLO, Introduction, Source, TAG, VERSION};
use arso_core::link::server::{Numbered, Seen, Server, Task};
use arso_core::observer::Anchored;
use arso_core::record::{LastMoves, Recorder, Scale};
use arso_core::{
    Controller, Counts, Current, Fault, Identity, Measurement, Mode, Request, Settings,
};
use host_sim::capture::Origin;
use host_sim::design::Design;
use host_sim::drive::{Drive, PlantFile};
use host_sim::simulate::plant::Plant;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Load masses and states of the embedded drive's observer.
const LOADS: usize = 3;
const STATES: usize = 9;
const RING: usize = 4081;
/// Current that its converter tells apart, A.
const STEP: f32 = 1e-3;
/// Where the machine has a stop, and from where on its home switch is active, m.
const WALL: f64 = -0.1;
const EDGE: f64 = -0.09;

type Observer = Anchored<LOADS, STATES>;

/// What is done to the line, and to the drive.
#[derive(Clone, Debug, Default)]
pub struct Orders {
    /// Every so manieth frame of the drive is lost; none with zero.
    pub lost: usize,
    /// Bytes that are no frames stand between frames, which come twice and in pieces.
    pub noise: bool,
    /// So many requests the drive cannot take at once.
    pub busy: u32,
    /// The drive finds this fault.
    pub fault: Option<Fault>,
    /// Asked by its switches.
    pub asked: Option<Request>,
    /// It is the end.
    pub end: bool,
}

/// What is so.
#[derive(Clone, Copy, Debug, Default)]
pub struct Truth {
    /// Of the actuator and of the last load, m.
    pub position: f64,
    pub load: f64,
    /// What the drive is doing.
    pub mode: Mode,
    /// Requests for moves that the drive has carried out.
    pub moves: u32,
    /// Frames that were lost.
    pub lost: u32,
}

/// A line to one host.
pub trait Wire: Send {
    /// What has come.
    fn receive(&mut self) -> Vec<u8>;
    /// Sends.
    fn send(&mut self, bytes: &[u8]);
}

/// A server for one host at a time; the next takes over.
pub struct Tcp {
    listener: TcpListener,
    host: Option<TcpStream>,
}

impl Tcp {
    pub fn new() -> (Self, String) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap().to_string();
        (
            Self {
                listener,
                host: None,
            },
            address,
        )
    }
}

impl Wire for Tcp {
    fn receive(&mut self) -> Vec<u8> {
        let mut buffer = [0; 512];
        if let Some(host) = &mut self.host {
            match host.read(&mut buffer) {
                Ok(0) => self.host = None,
                Ok(length) => return buffer[..length].to_vec(),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Vec::new(),
                Err(_) => self.host = None,
            }
        }
        if let Ok((host, _)) = self.listener.accept() {
            host.set_nonblocking(true).unwrap();
            host.set_nodelay(true).unwrap();
            self.host = Some(host);
        }
        Vec::new()
    }

    fn send(&mut self, bytes: &[u8]) {
        if let Some(host) = &mut self.host {
            // A host that has gone is found out when it is read from.
            let _ = host.write_all(bytes);
        }
    }
}

/// The drive, its line, and what is known of it from outside.
pub struct Simulated {
    /// Where it is.
    pub port: String,
    orders: Arc<Mutex<Orders>>,
    truth: Arc<Mutex<Truth>>,
    thread: Option<JoinHandle<()>>,
}

impl Simulated {
    /// A drive that has just been switched on.
    pub fn idle() -> Self {
        let (wire, port) = Tcp::new();
        Self::on(wire, port, false)
    }

    /// A drive that runs, held at zero.
    pub fn running() -> Self {
        let (wire, port) = Tcp::new();
        Self::on(wire, port, true)
    }

    pub fn on(wire: impl Wire + 'static, port: String, running: bool) -> Self {
        let orders = Arc::new(Mutex::new(Orders::default()));
        let truth = Arc::new(Mutex::new(Truth::default()));
        let mut board = Board::new(running);
        let (theirs, found) = (Arc::clone(&orders), Arc::clone(&truth));
        let thread = std::thread::spawn(move || board.run(wire, &theirs, &found));
        Self {
            port,
            orders,
            truth,
            thread: Some(thread),
        }
    }

    /// What is done to it from now on.
    pub fn orders(&self) -> MutexGuard<'_, Orders> {
        self.orders.lock().unwrap()
    }

    /// What is so now.
    pub fn truth(&self) -> Truth {
        *self.truth.lock().unwrap()
    }

    /// Waits until something is so.
    pub fn wait(&self, so: impl Fn(&Truth) -> bool) -> Truth {
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(10) {
            let truth = self.truth();
            if so(&truth) {
                return truth;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        panic!("it is never so: {:?}", self.truth());
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.orders().end = true;
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(std::thread::panicking() || matches!(ended, Some(Ok(()))));
    }
}

fn settings() -> &'static (Design, Settings<LOADS, Observer>) {
    static SETTINGS: OnceLock<(Design, Settings<LOADS, Observer>)> = OnceLock::new();
    SETTINGS.get_or_init(|| {
        let design = Design::new(&Drive::default_drive()).unwrap();
        design.plans().unwrap();
        let settings = design.settings::<LOADS, STATES, _>(Anchored::new, &design.protection());
        (design, settings)
    })
}

/// What the drive says of itself.
pub fn introduction() -> Introduction {
    let (design, settings) = settings();
    Introduction {
        version: VERSION,
        tag: TAG,
        firmware: "0.1.0".try_into().unwrap(),
        kind: "linear".try_into().unwrap(),
        loads: LOADS as u8,
        sample_time: settings.sample_time,
        resolution: settings.encoder.resolution,
        fingerprint: Origin::of(design).unwrap().fingerprint,
    }
}

/// Core and plant.
struct Board {
    controller: Controller<'static, LOADS, Observer>,
    server: Server<LOADS>,
    memory: &'static LastMoves<RING>,
    recorder: Recorder<'static, RING>,
    plant: Plant,
    applied: Current,
    asked: VecDeque<Numbered>,
    moves: u32,
}

impl Board {
    fn new(running: bool) -> Self {
        let (design, settings) = settings();
        let controller = Controller::new(settings, design.plans().unwrap().plans()).unwrap();
        let introduction = introduction();
        let identity = Identity {
            kind: "linear",
            loads: LOADS as u8,
            sample_time: settings.sample_time,
            fingerprint: introduction.fingerprint,
        };
        let memory: &LastMoves<RING> = Box::leak(Box::new(LastMoves::new()));
        let scale = Scale {
            step: Current(STEP),
            ..Scale::of(settings)
        };
        let plant = PlantFile::from(&design.drive);
        let mut board = Self {
            controller,
            server: Server::new(introduction, Current(1.85), Source::CompiledIn),
            memory,
            recorder: Recorder::new(memory, &identity, scale),
            plant: Plant::new(&plant, design.drive.control.sample_time),
            applied: Current(0.0),
            asked: VecDeque::new(),
            moves: 0,
        };
        board.plant.stop_at(WALL);
        if running {
            board.controller.request(Request::Commission).unwrap();
            while board.controller.mode() != Mode::Ready {
                board.period();
            }
            let zero = arso_core::Place(0);
            board
                .controller
                .request(Request::SetPosition(zero))
                .unwrap();
            board.controller.request(Request::Start).unwrap();
            for _ in 0..100 {
                board.period();
            }
        }
        board
    }

    fn period(&mut self) {
        let mut outcome = None;
        if let Some(asked) = self.asked.pop_front() {
            let taken = self.controller.request(asked.request);
            let moves = matches!(asked.request, Request::Move(_) | Request::MoveBy(_));
            self.moves += u32::from(moves && taken.is_ok());
            outcome = Some((asked, taken));
        }
        let count = Counts(self.plant.count());
        let command = self.controller.step(Measurement {
            count,
            current: self.applied,
            home: self.plant.state()[0] < EDGE,
        });
        let record = *self.controller.telemetry();
        let doing = self.controller.doing();
        self.recorder
            .step(record.period, count, self.applied, doing.course);
        if let Some((asked, taken)) = outcome {
            self.server.outcome(asked, taken);
        }
        let seen = Seen {
            doing,
            run_switch: true,
            vibration: 0.0,
        };
        self.asked.extend(self.server.period(&record, &seen));
        self.plant.enable(command.enable);
        // As its converter makes it.
        self.applied = Current((command.current.0 / STEP).round() * STEP);
        self.plant.advance(self.applied.0.into()).unwrap();
    }

    fn run(&mut self, mut wire: impl Wire, orders: &Mutex<Orders>, found: &Mutex<Truth>) {
        let begun = Instant::now();
        let (mut sent, mut lost) = (0, 0);
        for period in 1_u64.. {
            let Orders {
                lost: every,
                noise,
                fault,
                asked,
                mut busy,
                end,
            } = {
                let mut orders = orders.lock().unwrap();
                let now = orders.clone();
                (orders.fault, orders.asked, orders.busy) = (None, None, 0);
                now
            };
            if end {
                return;
            }
            if let Some(fault) = fault {
                self.controller.trip(fault);
            }
            let number = None;
            self.asked
                .extend(asked.map(|request| Numbered { number, request }));
            self.period();
            for byte in wire.receive() {
                let memory = self.memory;
                let task = self.server.take(byte, |place| memory.word(place));
                // It has no flash for settings.
                let asked = match task {
                    Some(Task::Request(asked)) => Some(asked),
                    _ => None,
                };
                if let Some(Numbered {
                    number: Some(number),
                    ..
                }) = asked
                    && busy > 0
                {
                    busy -= 1;
                    self.server.busy(number);
                } else {
                    self.asked.extend(asked);
                }
            }
            // A frame begins with a zero, and ends with one.
            for frame in self.server.waiting().split_inclusive(|byte| *byte == 0) {
                if frame == [0] {
                    continue;
                }
                sent += 1;
                if every > 0 && sent % every == 0 {
                    lost += 1;
                    continue;
                }
                send(&mut wire, frame, noise, sent);
            }
            self.server.taken();
            orders.lock().unwrap().busy += busy;
            *found.lock().unwrap() = Truth {
                position: self.plant.state()[0],
                load: self.plant.state()[2 * LOADS],
                mode: self.controller.mode(),
                moves: self.moves,
                lost,
            };
            // In step with the clock; what comes too late catches up.
            let due = begun + Duration::from_millis(period);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
    }
}

fn send(wire: &mut impl Wire, frame: &[u8], noise: bool, number: usize) {
    if !noise {
        wire.send(frame);
        return;
    }
    let garbage: Vec<u8> = (0..number % 40)
        .map(|k| (k * 37 + number * 101) as u8)
        .chain([0])
        .collect();
    wire.send(&garbage);
    for _ in 0..2 {
        let (first, second) = frame.split_at(number % frame.len());
        wire.send(first);
        std::thread::sleep(Duration::from_micros(100));
        wire.send(second);
    }
}

/// Something that greets back as it is told, or says nothing sensible; the address, and its thread.
pub fn impostor(says: Option<Introduction>, babble: &'static [u8]) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let (mut host, _) = listener.accept().unwrap();
        let mut receiver = Receiver::default();
        let mut byte = [0];
        while let Ok(1) = host.read(&mut byte) {
            let greeted = matches!(receiver.take(byte[0]), Some(Ok(frame)) if frame.tag == HELLO);
            if greeted {
                let mut buffer = [0; LONGEST];
                let said = says.as_ref();
                let said = said.map(|says| frame(HELLO, says, &mut buffer).unwrap());
                let _ = host.write_all(said.unwrap_or(babble));
            }
        }
    });
    address
}
