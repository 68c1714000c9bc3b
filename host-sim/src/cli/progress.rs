//! How far a command is that takes longer than a second: a line on standard error, where that is a terminal
//! and nobody asked for quiet.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{Read, Write};
use std::time::Duration;

/// A line that is shown, once it is worth it.
pub(super) struct Progress {
    bar: ProgressBar,
    quiet: bool,
}

/// What is done within this is not worth a line.
const PATIENCE: Duration = Duration::from_secs(1);

impl Progress {
    pub(super) fn new(quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        Self { bar, quiet }
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
        if !self.quiet && self.bar.is_hidden() && self.bar.elapsed() > PATIENCE {
            self.show();
        }
    }

    /// A stream whose bytes are counted from the first one on: who waits for it does so for a reason.
    pub(super) fn counting<R: Read>(&self, stream: R) -> impl Read {
        self.style("{spinner} {bytes} in {elapsed}; Ctrl-C ends the log");
        if !self.quiet {
            self.show();
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

    fn show(&self) {
        self.bar.set_draw_target(ProgressDrawTarget::stderr());
        self.bar.enable_steady_tick(Duration::from_millis(200));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
