//! What happens while a drive is watched: it is listened to and asked, keys are read, all is drawn.

use super::draw::draw;
use super::model::Model;
use super::{Files, go_on};
use crate::error::{Error, Result};
use crate::link::Connection;
use arso_core::request::Request;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

/// How often the drive is asked what it is doing, how often for its faults, and how often all is drawn.
const STATUS: Duration = Duration::from_millis(200);
const FAULTS: Duration = Duration::from_secs(1);
const DRAWING: Duration = Duration::from_millis(50);
/// Without records for so long, s, and so many of them, they are asked for anew: a drive that was reset has
/// forgotten that.
const NO_RECORDS: (f64, f64) = (1.0, 3.0);
/// A drive that has not answered for so long is given up.
const GIVEN_UP: Duration = Duration::from_secs(5);

/// Watches until a key ends it.
///
/// # Errors
/// [`Error::Link`] for a drive that no longer answers; [`Error::Write`] where the terminal fails, or a file.
pub(super) fn watch(drive: &mut Connection, model: &mut Model, files: &mut Files) -> Result<()> {
    drive.subscribe(model.subject.every)?;
    let now = Instant::now();
    let watching = Watching {
        drive,
        model,
        files,
        answered: now,
        recorded: now,
    };
    let ended = in_terminal(watching);
    let unsubscribed = drive.subscribe(0);
    ended.and(unsubscribed)
}

fn in_terminal(watching: Watching<'_>) -> Result<()> {
    let _restored = Restored;
    let terminal = ratatui::try_init().map_err(failed)?;
    watching.run(terminal)
}

/// Gives the terminal back as it was, however this ends; a panic does so by itself, before it is told.
struct Restored;

impl Drop for Restored {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

fn failed(error: io::Error) -> Error {
    Error::write(Path::new("the terminal"))(error)
}

struct Watching<'a> {
    drive: &'a mut Connection,
    model: &'a mut Model,
    files: &'a mut Files,
    /// When the drive last said anything, and when the last record came or was asked for.
    answered: Instant,
    recorded: Instant,
}

impl Watching<'_> {
    fn run(mut self, mut terminal: DefaultTerminal) -> Result<()> {
        let subject = &self.model.subject;
        let interval = f64::from(subject.every) * subject.origin.period;
        let patience = NO_RECORDS.0.max(NO_RECORDS.1 * interval);
        let now = Instant::now();
        let (mut status, mut faults, mut drawing) = (now, now, now);
        while go_on() {
            match key().map_err(failed)? {
                Some(Key::End) => return Ok(()),
                Some(Key::Stop) => self.stop()?,
                None => {}
            }
            let now = Instant::now();
            if now >= status {
                status = now + STATUS;
                self.ask_status()?;
            }
            // The rest is for a drive that answers.
            if now >= faults && self.model.silent.is_none() {
                faults = now + FAULTS;
                let found = self.drive.faults();
                if let Some(found) = self.answer(found)? {
                    self.model.faults = found;
                }
            }
            if self.recorded.elapsed().as_secs_f64() > patience && self.model.silent.is_none() {
                self.recorded = Instant::now();
                let subscribed = self.drive.subscribe(self.model.subject.every);
                self.answer(subscribed)?;
            }
            if now >= drawing {
                drawing = now + DRAWING;
                let drawn = terminal.draw(|frame| draw(frame, self.model));
                drawn.map_err(failed)?;
            }
            self.listen(status.min(drawing))?;
        }
        Ok(())
    }

    /// Takes the records that come until then.
    fn listen(&mut self, until: Instant) -> Result<()> {
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.drive.record(left) {
                Ok(Some(record)) => {
                    self.recorded = Instant::now();
                    self.answered = self.recorded;
                    if let Some(time) = self.model.take(&record) {
                        self.files.add(self.drive.origin(), &record, time)?;
                    }
                }
                Ok(None) => return Ok(()),
                Err(error) => return self.answer(Err(error)).map(|_: Option<()>| ()),
            }
            if left.is_zero() {
                return Ok(());
            }
        }
    }

    fn ask_status(&mut self) -> Result<()> {
        let status = self.drive.status();
        if let Some(status) = self.answer(status)? {
            self.model.report(status);
        }
        Ok(())
    }

    /// Brings the machine to rest, as far as the drive takes it.
    fn stop(&mut self) -> Result<()> {
        self.model.said = match self.drive.request(Request::Halt) {
            Ok(()) => "stop: the machine comes to rest".into(),
            Err(Error::Refused(refusal)) => refusal.to_string(),
            Err(error) => {
                let said = format!("stop: {error}");
                self.answer(Err(error)).map(|_: Option<()>| said)?
            }
        };
        Ok(())
    }

    /// What the drive answered; nothing where it does not, which is borne for a while.
    fn answer<T>(&mut self, answer: Result<T>) -> Result<Option<T>> {
        match answer {
            Ok(answer) => {
                self.answered = Instant::now();
                self.model.silent = None;
                Ok(Some(answer))
            }
            Err(Error::Link(_)) if self.answered.elapsed() < GIVEN_UP => {
                self.model.silent = Some(self.answered.elapsed().as_secs_f64());
                // A line that is gone says so at once.
                std::thread::sleep(DRAWING);
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Key {
    End,
    Stop,
}

/// The first key that means something, if one was pressed.
fn key() -> io::Result<Option<Key>> {
    while event::poll(Duration::ZERO)? {
        if let Event::Key(key) = event::read()?
            && let Some(meant) = meant(key)
        {
            return Ok(Some(meant));
        }
    }
    Ok(None)
}

fn meant(key: KeyEvent) -> Option<Key> {
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    match key.code {
        _ if key.kind != KeyEventKind::Press => None,
        KeyCode::Esc | KeyCode::Char('q') => Some(Key::End),
        // In a terminal that is drawn on, Ctrl-C is a key.
        KeyCode::Char('c') if control => Some(Key::End),
        KeyCode::Char('s') => Some(Key::Stop),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_mean_what_the_footer_says() {
        let key = |code, modifiers| meant(KeyEvent::new(code, modifiers));
        let none = KeyModifiers::NONE;
        for code in [KeyCode::Esc, KeyCode::Char('q')] {
            assert_eq!(key(code, none), Some(Key::End));
        }
        assert_eq!(
            key(KeyCode::Char('c'), KeyModifiers::CONTROL),
            Some(Key::End)
        );
        assert_eq!(key(KeyCode::Char('c'), none), None);
        assert_eq!(key(KeyCode::Char('s'), none), Some(Key::Stop));
        let mut released = KeyEvent::new(KeyCode::Char('s'), none);
        released.kind = KeyEventKind::Release;
        assert_eq!(meant(released), None);
    }
}
