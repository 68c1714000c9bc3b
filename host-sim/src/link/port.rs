//! A serial port, or a TCP connection that stands for one.

use crate::error::{Error, Result};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// Bits per second of the drive's line; 8 data bits, no parity, one stop bit.
pub const BAUD: u32 = 1_000_000;

/// How long a reading waits for bytes.
const WAIT: Duration = Duration::from_millis(5);
/// How long a server may take to be there, and a line to take a frame.
const CONNECTING: Duration = Duration::from_secs(2);
const SENDING: Duration = Duration::from_millis(500);

#[cfg(unix)]
type Device = serialport::TTYPort;
#[cfg(windows)]
type Device = serialport::COMPort;

/// An open port.
#[derive(Debug)]
pub struct Port {
    name: String,
    line: Line,
}

#[derive(Debug)]
enum Line {
    Serial(Device),
    Tcp(TcpStream),
}

impl Port {
    /// Opens a serial device (`/dev/ttyACM0`, `COM3`, a pseudo-terminal), or connects to `HOST:PORT`.
    ///
    /// # Errors
    /// [`Error::Parameter`] where there is none, or somebody else has it.
    pub fn open(name: &str) -> Result<Self> {
        let line = if is_address(name) {
            Line::Tcp(connect(name).map_err(|error| unusable(name, &error.to_string()))?)
        } else {
            Line::Serial(device(name)?)
        };
        Ok(Self {
            name: name.to_owned(),
            line,
        })
    }

    /// As it was opened.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is a serial device.
    #[must_use]
    pub fn is_serial(&self) -> bool {
        matches!(self.line, Line::Serial(_))
    }

    /// Bytes that have come; none where none come for some milliseconds.
    ///
    /// # Errors
    /// [`Error::Link`] when the line is gone.
    pub fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let read = match &mut self.line {
            Line::Serial(device) => device.read(buffer),
            Line::Tcp(stream) => stream.read(buffer),
        };
        match read {
            Ok(0) => Err(self.gone("it was closed")),
            Ok(length) => Ok(length),
            Err(error) if nothing_yet(&error) => Ok(0),
            Err(error) => Err(self.gone(error)),
        }
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// [`Error::Link`] when the line is gone, or takes nothing for half a second.
    pub fn write(&mut self, mut bytes: &[u8]) -> Result<()> {
        let end = Instant::now() + SENDING;
        while !bytes.is_empty() {
            let written = match &mut self.line {
                Line::Serial(device) => device.write(bytes),
                Line::Tcp(stream) => stream.write(bytes),
            };
            match written {
                Ok(length) => bytes = bytes.get(length..).unwrap_or_default(),
                Err(error) if !nothing_yet(&error) => return Err(self.gone(error)),
                Err(_) => {}
            }
            if !bytes.is_empty() && Instant::now() > end {
                return Err(Error::Link(format!("{} takes no bytes", self.name)));
            }
        }
        Ok(())
    }

    fn gone(&self, why: impl std::fmt::Display) -> Error {
        Error::Link(format!("the line to {} is gone: {why}", self.name))
    }
}

/// A device that another process holds open as well would stay locked after this one.
#[cfg(unix)]
impl Drop for Port {
    fn drop(&mut self) {
        if let Line::Serial(device) = &mut self.line {
            // A device that has gone has no lock.
            let _ = device.set_exclusive(false);
        }
    }
}

fn nothing_yet(error: &io::Error) -> bool {
    use ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), TimedOut | WouldBlock | Interrupted)
}

fn unusable(name: &str, why: &str) -> Error {
    Error::parameter("port", name, format!("cannot be opened: {why}"))
}

/// Whether a name is that of a server. Devices have a path, or no colon.
fn is_address(name: &str) -> bool {
    let port = name.rsplit_once(':').map(|(_, port)| port);
    !name.contains(['/', '\\']) && port.is_some_and(|port| port.parse::<u16>().is_ok())
}

fn connect(address: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(ErrorKind::NotFound, "there is no such host");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECTING) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(WAIT))?;
                stream.set_write_timeout(Some(SENDING))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn device(name: &str) -> Result<Device> {
    let open = |baud| {
        let settings = serialport::new(name, baud).timeout(WAIT);
        settings.open_native()
    };
    // A pseudo-terminal has no rate, and may refuse this one; a device that has one must take it.
    let pseudo = name.starts_with("/dev/pts/");
    let opened = open(BAUD).or_else(|error| if pseudo { open(0) } else { Err(error) });
    opened.map_err(|error| unusable(name, &format!("{error}{}", others(name))))
}

/// The ports that there are instead, in words.
fn others(name: &str) -> String {
    let ports = serialport::available_ports().unwrap_or_default();
    let names = ports.into_iter().map(|port| port.port_name);
    let names: Vec<String> = names.filter(|other| other != name).collect();
    if names.is_empty() {
        String::new()
    } else {
        format!("; there are {}", names.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn servers_are_told_from_devices() {
        for name in ["127.0.0.1:5000", "localhost:1", "[::1]:80"] {
            assert!(is_address(name), "{name}");
        }
        for name in [
            "/dev/ttyACM0",
            "COM3",
            "COM3:",
            "/dev/serial/by-path/pci-0:2",
            r"\\.\COM12",
            "host:70000",
        ] {
            assert!(!is_address(name), "{name}");
        }
    }

    #[test]
    fn what_is_not_there_is_said() {
        for name in ["/dev/no-such-port", "127.0.0.1:1", "no.such.host.invalid:5"] {
            let error = Port::open(name).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            let begin = format!("`port` {name}: cannot be opened: ");
            assert!(error.to_string().starts_with(&begin), "{error}");
        }
    }
}
