//! A stream that can be ended from outside, however silent it is.
//!
//! A thread reads, and blocks where it must; what it has read comes through a channel. Whoever ends the
//! stream gets what has come, and leaves the thread where it is.

use std::io::{Error, ErrorKind, Read, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Pieces that wait in the channel at most: what an endless stream may still deliver when it is ended.
const WAITING: usize = 16;
/// How long the stream may be silent before the end is looked for.
const SILENCE: Duration = Duration::from_millis(50);

/// A stream that ends when its source does, or when it is told to.
pub struct Live {
    pieces: Receiver<Result<Vec<u8>>>,
    end: &'static AtomicBool,
    /// Pieces to be taken after the end was asked for.
    left: usize,
    piece: Vec<u8>,
    at: usize,
}

impl Live {
    /// * `open`: opens the source, which may block as well
    /// * `end`: set by whoever ends the stream
    ///
    /// # Errors
    /// When no thread can be started.
    pub fn new<R: Read>(
        open: impl FnOnce() -> Result<R> + Send + 'static,
        end: &'static AtomicBool,
    ) -> Result<Self> {
        let (sender, pieces) = sync_channel(WAITING);
        let read = move || {
            let mut source = match open() {
                Ok(source) => source,
                Err(error) => return drop(sender.send(Err(error))),
            };
            let mut buffer = vec![0; 16 * 1024];
            loop {
                let piece = match source.read(&mut buffer) {
                    Ok(0) => return,
                    Ok(length) => Ok(buffer[..length].to_vec()),
                    Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                    Err(error) => Err(error),
                };
                let last = piece.is_err();
                if sender.send(piece).is_err() || last {
                    return;
                }
            }
        };
        std::thread::Builder::new().spawn(read)?;
        Ok(Self {
            pieces,
            end,
            left: WAITING,
            piece: Vec::new(),
            at: 0,
        })
    }

    /// The next piece; nothing at the end.
    fn next(&mut self) -> Option<Result<Vec<u8>>> {
        loop {
            if self.end.load(Ordering::Relaxed) {
                self.left = self.left.checked_sub(1)?;
                return self.pieces.try_recv().ok();
            }
            match self.pieces.recv_timeout(SILENCE) {
                Ok(piece) => return Some(piece),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        }
    }
}

impl Read for Live {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if self.at == self.piece.len() {
            self.piece = self.next().transpose()?.unwrap_or_default();
            self.at = 0;
        }
        let mut rest = self
            .piece
            .get(self.at..)
            .ok_or_else(|| Error::other("a piece of the log is missing"))?;
        let length = rest.read(buffer)?;
        self.at += length;
        Ok(length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Says something, and then nothing for ever.
    struct Silent(Option<&'static [u8]>);

    impl Read for Silent {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
            match self.0.take() {
                Some(mut text) => text.read(buffer),
                None => loop {
                    std::thread::park();
                },
            }
        }
    }

    /// Never stops.
    struct Endless;

    impl Read for Endless {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
            buffer.fill(b'x');
            Ok(buffer.len())
        }
    }

    fn ended() -> &'static AtomicBool {
        Box::leak(Box::new(AtomicBool::new(false)))
    }

    #[test]
    fn a_silent_stream_ends_when_it_is_told_to() {
        let end = ended();
        let mut live = Live::new(|| Ok(Silent(Some(b"hello"))), end).unwrap();
        let mut begin = [0; 5];
        live.read_exact(&mut begin).unwrap();
        end.store(true, Ordering::Relaxed);
        let mut rest = Vec::new();
        live.read_to_end(&mut rest).unwrap();
        assert_eq!((&begin, rest.len()), (b"hello", 0));
    }

    #[test]
    fn an_endless_stream_ends_when_it_is_told_to() {
        let end = ended();
        let mut live = Live::new(|| Ok(Endless), end).unwrap();
        live.read_exact(&mut vec![0; 100_000]).unwrap();
        end.store(true, Ordering::Relaxed);
        let mut rest = Vec::new();
        live.read_to_end(&mut rest).unwrap();
        assert!(rest.len() <= (WAITING + 1) * 16 * 1024);
    }

    #[test]
    fn a_source_that_ends_or_fails_says_so() {
        let mut text = String::new();
        let mut live = Live::new(|| Ok(&b"whole"[..]), ended()).unwrap();
        live.read_to_string(&mut text).unwrap();
        assert_eq!(text, "whole");
        let open = || Err::<&[u8], _>(ErrorKind::PermissionDenied.into());
        let error = Live::new(open, ended())
            .unwrap()
            .read(&mut [0])
            .unwrap_err();
        assert_eq!(error.kind(), ErrorKind::PermissionDenied);
    }
}
