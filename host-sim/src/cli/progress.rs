//! How far a command is that takes longer than a second: a line on standard error, where that is a terminal
//! and nobody asked for quiet.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// A line that is shown, once it is worth it.
pub(super) struct Progress {
    bar: ProgressBar,
    quiet: bool,
    /// Whether [`Self::rate`] has been told of something.
    counts: AtomicBool,
    /// Shows the line in time, however long a step takes; ends when its channel does.
    clock: Option<(Sender<()>, JoinHandle<()>)>,
}

/// What is done within this is not worth a line.
const PATIENCE: Duration = Duration::from_secs(1);

impl Progress {
    /// * `what`: comes first
    pub(super) fn new(quiet: bool, what: &'static str) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        let mut progress = Self {
            bar: bar.with_message(what),
            quiet,
            counts: AtomicBool::new(false),
            clock: None,
        };
        progress.style("{spinner} {msg} ({elapsed})");
        if quiet {
            return progress;
        }
        let (sender, end) = channel();
        let bar = progress.bar.clone();
        let wait = move || {
            if end.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                show(&bar);
            }
        };
        // Without a thread there is no line, and all else goes on.
        let thread = std::thread::Builder::new().spawn(wait).ok();
        progress.clock = thread.map(|thread| (sender, thread));
        progress
    }

    /// So many steps of so many are done, and what comes next.
    pub(super) fn step(&self, done: usize, of: usize, what: &str) {
        if self.bar.length() != Some(of as u64) {
            self.bar.set_length(of as u64);
            let template = "{bar:24} {pos}/{len} {msg} ({elapsed})";
            self.style(template);
        }
        self.bar.set_message(what.to_owned());
        self.bar.set_position(done as u64);
    }

    /// So many of what there are many of are done, with their rate and the time that is left.
    pub(super) fn rate(&self, done: u64, of: u64, what: &'static str) {
        if !self.counts.swap(true, Ordering::Relaxed) {
            self.style("{bar:24} {pos}/{len} {msg}, {per_sec}, {eta} left ({elapsed})");
            self.bar.set_length(of);
            self.bar.set_message(what);
            // What was done before says nothing of the rate.
            self.bar.set_position(done);
            self.bar.reset_eta();
        }
        self.bar.set_position(done);
    }

    /// A stream whose bytes are counted from the first one on: who waits for it does so for a reason.
    pub(super) fn counting<R: Read>(&self, stream: R) -> impl Read {
        self.style("{spinner} {bytes} in {elapsed}; Ctrl-C ends the log");
        if !self.quiet {
            show(&self.bar);
        }
        self.bar.wrap_read(stream)
    }

    /// A line above the progress. Where nobody reads it any more (`2>&1 | head`), the work goes on.
    pub(super) fn say(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| {
                let _ = writeln!(std::io::stderr(), "{text}");
            });
        }
    }

    fn style(&self, template: &str) {
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
    }
}

fn show(bar: &ProgressBar) {
    bar.set_draw_target(ProgressDrawTarget::stderr());
    bar.enable_steady_tick(Duration::from_millis(200));
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((end, thread)) = self.clock.take() {
            drop(end);
            // A clock that failed has shown nothing.
            let _ = thread.join();
        }
        self.bar.finish_and_clear();
    }
}
