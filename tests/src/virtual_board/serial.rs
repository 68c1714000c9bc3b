//! The drive's serial port for programs on this machine, the board in step with its clock.
//!
//! ```text
//! peer (pseudo-terminal, TCP) <--bridge, once a control period--> USART1
//! ```
//!
//! Nothing here waits for a peer. One that sends faster than the line carries is read no faster; of
//! what one does not read the newest is lost; and while there is none all is lost, as on a line.

use super::bus::Bus;
use super::{Rig, Stop};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Bytes that wait for the line, and for the peer, at most.
const MOST_ARRIVING: usize = 4 << 10;
const MOST_LEAVING: usize = 64 << 10;

/// So much behind the clock the board gives up catching up.
const LATE: Duration = Duration::from_millis(100);

/// A pseudo-terminal: our end, which never blocks, and the path of the other, which passes bytes as
/// they are. While nobody has the other end open, ours has nothing to read but an error.
///
/// # Errors
/// Whatever the system says.
pub fn open_terminal() -> Result<(File, String)> {
    let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&ours)?;
    unlockpt(&ours)?;
    let path = ptsname(&ours, Vec::new())?;
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let other = rustix::fs::open(&path, flags, Mode::empty())?;
    let mut settings = tcgetattr(&other)?;
    settings.make_raw();
    tcsetattr(&other, OptionalActions::Now, &settings)?;
    rustix::io::ioctl_fionbio(&ours, true)?;
    Ok((ours.into(), path.to_string_lossy().into_owned()))
}

/// A TCP server for one client at a time; the next one waits until the last has gone.
pub struct Listener {
    socket: TcpListener,
    client: Option<TcpStream>,
}

impl Listener {
    /// * `address`: host and port; port 0 for a free one
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn new(address: &str) -> Result<Self> {
        let socket = TcpListener::bind(address)?;
        socket.set_nonblocking(true)?;
        Ok(Self {
            socket,
            client: None,
        })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn address(&self) -> Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// The client, or the one that has come meanwhile.
    fn client(&mut self) -> Result<&mut TcpStream> {
        if self.client.is_none() {
            let (client, _) = self.socket.accept().map_err(|_| nobody())?;
            client.set_nonblocking(true)?;
            client.set_nodelay(true)?;
            self.client = Some(client);
        }
        self.client.as_mut().ok_or_else(nobody)
    }
}

fn nobody() -> Error {
    ErrorKind::NotConnected.into()
}

/// Whether an error says that there is nothing now, but may be later.
fn later(error: &Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

impl Read for Listener {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let result = self.client()?.read(buffer);
        match &result {
            Ok(0) => self.client = None,
            Err(error) if !later(error) => self.client = None,
            _ => {}
        }
        result
    }
}

impl Write for Listener {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        // A client that has gone is noticed on reading.
        self.client.as_mut().ok_or_else(nobody)?.write(bytes)
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

/// What lies between the line and its peer.
pub struct Bridge<P> {
    peer: P,
    leaving: VecDeque<u8>,
}

impl<P: Read + Write> Bridge<P> {
    /// * `peer`: never blocks; has gone when it reads as nothing or as any error but that there is
    ///   nothing now
    pub fn new(peer: P) -> Self {
        Self {
            peer,
            leaving: VecDeque::new(),
        }
    }

    /// Passes on what can be passed on now.
    pub fn exchange(&mut self, bus: &mut Bus) {
        let mut buffer = [0; MOST_ARRIVING];
        let room = MOST_ARRIVING.saturating_sub(bus.waiting());
        // Nothing can be read into no room; whoever has filled it is likely there still.
        let there = room == 0
            || match self.peer.read(&mut buffer[..room]) {
                Ok(length) => {
                    bus.send(&buffer[..length]);
                    length > 0
                }
                Err(error) => later(&error),
            };
        let sent = bus.received();
        if !there {
            self.leaving.clear();
            return;
        }
        let room = MOST_LEAVING - self.leaving.len();
        self.leaving.extend(sent.into_iter().take(room));
        while !self.leaving.is_empty() {
            match self.peer.write(self.leaving.as_slices().0) {
                Ok(length) if length > 0 => drop(self.leaving.drain(..length)),
                _ => return,
            }
        }
    }
}

/// The clock that the board keeps in step with.
struct Pace {
    began: Instant,
    late: bool,
}

/// What keeps the board in step.
#[derive(Debug, PartialEq, Eq)]
enum Step {
    Sleep(Duration),
    GoOn,
    /// It cannot keep up; said once.
    Late,
}

impl Pace {
    /// * `simulated`: time of the board since the clock began
    fn step(&mut self, simulated: Duration, now: Instant) -> Step {
        let due = self.began + simulated;
        let late = now.saturating_duration_since(due);
        if late > LATE {
            // What was missed is not made up for: the peer's time has passed, too.
            self.began += late;
            return if std::mem::replace(&mut self.late, true) {
                Step::GoOn
            } else {
                Step::Late
            };
        }
        match due.saturating_duration_since(now) {
            Duration::ZERO => Step::GoOn,
            early => Step::Sleep(early),
        }
    }
}

/// Runs a rig in step with the clock until it is ended.
///
/// * `end`: set by whoever ends it
/// * `log`: called after each period with what the firmware has logged in it
/// * `late`: called once if the board cannot keep up
///
/// # Errors
/// Whatever stops the firmware, or `log` does not take.
pub fn run<P: Read + Write, E: From<Stop>>(
    rig: &mut Rig,
    bridge: &mut Bridge<P>,
    end: &AtomicBool,
    mut log: impl FnMut(&[u8]) -> std::result::Result<(), E>,
    late: impl Fn(),
) -> std::result::Result<(), E> {
    let begin = rig.board.bus().now;
    let mut pace = Pace {
        began: Instant::now(),
        late: false,
    };
    while !end.load(Ordering::Relaxed) {
        bridge.exchange(rig.board.bus_mut());
        let result = rig.period();
        log(&std::mem::take(&mut rig.log))?;
        result?;
        let bus = rig.board.bus();
        let seconds = (bus.now - begin) as f64 / bus.rcc.processor_hz() as f64;
        match pace.step(Duration::from_secs_f64(seconds), Instant::now()) {
            Step::Sleep(time) => std::thread::sleep(time),
            Step::GoOn => {}
            Step::Late => late(),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A peer in memory: gone, or with what it sends and what it takes, as much as it has room for.
    #[derive(Default)]
    struct Fake {
        gone: bool,
        sends: VecDeque<u8>,
        took: Vec<u8>,
        room: usize,
    }

    impl Read for Fake {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
            if self.gone {
                return Ok(0);
            }
            match self.sends.read(buffer) {
                Ok(0) => Err(ErrorKind::WouldBlock.into()),
                result => result,
            }
        }
    }

    impl Write for Fake {
        fn write(&mut self, bytes: &[u8]) -> Result<usize> {
            // In pieces, as sockets do.
            let length = bytes.len().min(self.room).min(3);
            if length == 0 {
                return Err(ErrorKind::WouldBlock.into());
            }
            self.room -= length;
            self.took.extend(&bytes[..length]);
            Ok(length)
        }

        fn flush(&mut self) -> Result<()> {
            Ok(())
        }
    }

    /// USART1 with the processor's clock, 160 cycles a byte, without DMA.
    fn bus() -> Bus {
        let mut bus = Bus::new();
        for (address, value) in [
            (0x4002_3830, 1),
            (0x4002_3844, 1 << 4),
            (0x4002_0024, 7 << 4 | 7 << 8),
            (0x4002_0000, 0b10 << 18 | 0b10 << 20),
            (0x4001_1008, 16),
            (0x4001_100C, 1 << 13 | 1 << 3 | 1 << 2),
        ] {
            bus.write(address, value).unwrap();
        }
        bus
    }

    fn transmit(bus: &mut Bus, bytes: &[u8]) {
        for byte in bytes {
            bus.write(0x4001_1004, u32::from(*byte)).unwrap();
            bus.now += 160;
            bus.advance();
        }
    }

    #[test]
    fn bytes_pass_both_ways() {
        let (mut bus, mut bridge) = (bus(), Bridge::new(Fake::default()));
        bridge.peer.sends.extend(b"hi");
        bridge.exchange(&mut bus);
        bus.now += 160;
        bus.advance();
        assert_eq!((bus.read(0x4001_1004), bus.waiting()), (Ok(b'h'.into()), 1));
        // A peer that takes little now gets the rest later.
        transmit(&mut bus, b"0123456789");
        bridge.peer.room = 4;
        bridge.exchange(&mut bus);
        assert_eq!(bridge.peer.took, b"0123");
        transmit(&mut bus, b"ab");
        bridge.peer.room = 100;
        bridge.exchange(&mut bus);
        assert_eq!(bridge.peer.took, b"0123456789ab");
    }

    #[test]
    fn what_waits_is_bounded() {
        let (mut bus, mut bridge) = (bus(), Bridge::new(Fake::default()));
        bridge.peer.sends.extend([1; MOST_ARRIVING + 10]);
        for _ in 0..3 {
            bridge.exchange(&mut bus);
            assert_eq!(
                (bus.waiting(), bridge.peer.sends.len()),
                (MOST_ARRIVING, 10)
            );
        }
        transmit(&mut bus, &vec![7; MOST_LEAVING + 10]);
        bridge.exchange(&mut bus);
        assert_eq!(bridge.leaving.len(), MOST_LEAVING);
        // The next peer gets nothing of it.
        bridge.peer.gone = true;
        bus.now += 1_000_000;
        bus.advance();
        bridge.exchange(&mut bus);
        bridge.peer.gone = false;
        bridge.peer.room = usize::MAX;
        transmit(&mut bus, b"new");
        bridge.exchange(&mut bus);
        assert_eq!(bridge.peer.took, b"new");
    }

    /// Exchanges until something holds, for some seconds at most.
    fn until<P: Read + Write>(
        bridge: &mut Bridge<P>,
        bus: &mut Bus,
        holds: impl Fn(&mut Bus) -> bool,
    ) {
        for _ in 0..5000 {
            bridge.exchange(bus);
            if holds(bus) {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("it never did");
    }

    #[test]
    fn one_client_after_the_other() {
        let listener = Listener::new("127.0.0.1:0").unwrap();
        let address = listener.address().unwrap();
        let (mut bus, mut bridge) = (bus(), Bridge::new(listener));
        // Nobody is there to hear this.
        transmit(&mut bus, b"lost");
        bridge.exchange(&mut bus);
        for byte in [b'x', b'y'] {
            let mut client = TcpStream::connect(address).unwrap();
            client.write_all(&[byte]).unwrap();
            until(&mut bridge, &mut bus, |bus| bus.waiting() == 1);
            bus.now += 160;
            bus.advance();
            assert_eq!(bus.read(0x4001_1004), Ok(byte.into()));
            transmit(&mut bus, &[byte; 2]);
            bridge.exchange(&mut bus);
            let mut answer = [0; 2];
            client.read_exact(&mut answer).unwrap();
            assert_eq!(answer, [byte; 2]);
        }
    }

    #[test]
    fn a_terminal_passes_every_byte_as_it_is() {
        let (ours, path) = open_terminal().unwrap();
        let (mut bus, mut bridge) = (bus(), Bridge::new(ours));
        transmit(&mut bus, b"lost");
        bridge.exchange(&mut bus);
        let all: Vec<u8> = (0..=255).collect();
        for _ in 0..2 {
            let flags = OFlags::RDWR | OFlags::NOCTTY;
            let other = rustix::fs::open(path.as_str(), flags, Mode::empty()).unwrap();
            let mut other = File::from(other);
            other.write_all(&all).unwrap();
            until(&mut bridge, &mut bus, |bus| bus.waiting() == all.len());
            for byte in 0..=255 {
                bus.now += 160;
                bus.advance();
                assert_eq!(bus.read(0x4001_1004), Ok(byte));
            }
            transmit(&mut bus, &all);
            bridge.exchange(&mut bus);
            let mut answer = vec![0; all.len()];
            other.read_exact(&mut answer).unwrap();
            assert_eq!(answer, all);
        }
    }

    #[test]
    fn the_pace_sleeps_when_ahead_and_says_once_that_it_is_late() {
        let began = Instant::now();
        let ms = Duration::from_millis;
        let mut pace = Pace { began, late: false };
        assert_eq!(pace.step(ms(10), began + ms(4)), Step::Sleep(ms(6)));
        assert_eq!(pace.step(ms(11), began + ms(111)), Step::GoOn);
        assert_eq!(pace.step(ms(12), began + ms(500)), Step::Late);
        assert_eq!(pace.step(ms(13), began + ms(500)), Step::Sleep(ms(1)));
        assert_eq!(pace.step(ms(14), began + ms(900)), Step::GoOn);
    }
}
