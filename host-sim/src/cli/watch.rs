//! `host-sim learn --watch`: after each move, how far the load is from what the drive file says.

use super::interrupt::{INTERRUPTED, catch_interrupt};
use super::records::{DescribedDrive, together};
use crate::capture::{Follower, Stretch};
use crate::error::{Error, Result};
use crate::identify::{Columns, Log, drift};
use crate::output::print;
use crate::report::learning;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// How often the record is looked at.
const EVERY: Duration = Duration::from_millis(200);

/// What is to be watched, and for how long.
pub(super) struct Watch<'a> {
    pub(super) path: &'a Path,
    pub(super) drive: &'a DescribedDrive,
    pub(super) columns: &'a [Columns],
    /// After so many moves it ends; none: at Ctrl-C.
    pub(super) moves: Option<usize>,
    pub(super) json: bool,
}

impl Watch<'_> {
    pub(super) fn run(&self) -> Result<()> {
        let read = || Error::read(self.path);
        let mut file = File::open(self.path).map_err(read())?;
        catch_interrupt()?;
        let mut follower = self.follower();
        let (mut taken, mut seen) = (0, 0);
        while !INTERRUPTED.load(Ordering::Relaxed) {
            // A record that was begun anew, in the same file or in one of the same name.
            let length = self.path.metadata().map_or(taken, |found| found.len());
            if length < taken {
                file = File::open(self.path).map_err(read())?;
                (follower, taken) = (self.follower(), 0);
            }
            let mut bytes = Vec::new();
            taken += file.read_to_end(&mut bytes).map_err(read())? as u64;
            for stretch in follower.take(&bytes)? {
                self.say(&stretch)?;
                seen += 1;
                if self.moves.is_some_and(|moves| seen >= moves) {
                    return Ok(());
                }
            }
            std::thread::sleep(EVERY);
        }
        Ok(())
    }

    fn follower(&self) -> Follower {
        let columns = together(self.columns);
        let titles = [columns.time, columns.count, columns.position, columns.mode];
        let encoder = &self.drive.drive.encoder;
        let name = self.path.display().to_string();
        Follower::new(&name, titles, (encoder.counter_bits, encoder.resolution))
    }

    /// One line for a move; one that cannot be read is said, and the next one waited for.
    fn say(&self, stretch: &Stretch) -> Result<()> {
        let drive = &self.drive.drive;
        let place = format!("the move from {} to {}", stretch.from, stretch.to);
        let log = Log::parse(
            stretch.text.as_bytes(),
            &place,
            drive,
            &together(self.columns),
        );
        let found = log.and_then(|log| drift(drive, &log));
        let found = found.as_ref().map_err(ToString::to_string);
        if self.json {
            let found = found.as_ref().map_err(String::as_str);
            return print(&format!(
                "{}\n",
                learning::drift_json(stretch, found.copied())
            ));
        }
        print(&match found {
            Ok(drift) => format!("{} s: {}\n", stretch.to, learning::drift(drift)),
            Err(why) => format!("{} s: a move that says nothing: {why}\n", stretch.to),
        })
    }
}
