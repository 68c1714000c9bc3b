//! The switches of the drive board, debounced, as requests to the drive.
//!
//! | run | target switches | |
//! |---|---|---|
//! | off | | stop |
//! | on | 0 | step to the origin |
//! | on | 1 | step to 30 mm |
//! | on | 2 | step to 15 mm |
//! | on | 3 | jerk-limited move to 30 mm |

use crate::board::Levels;
use arso_core::{Position, Request};

/// Control periods for which the switches must agree before they count.
const DEBOUNCE: u8 = 10;

/// Debouncing state; starts as if everything were off.
#[derive(Default)]
pub(crate) struct Switches {
    settled: Levels,
    candidate: Levels,
    periods: u8,
}

impl Switches {
    /// Takes the levels of one period; gives what they newly ask for.
    pub(crate) fn sample(&mut self, levels: Levels) -> [Option<Request>; 2] {
        if levels != self.candidate {
            self.candidate = levels;
            self.periods = 0;
        }
        self.periods = self.periods.saturating_add(1);
        if self.periods < DEBOUNCE || self.settled == levels {
            return [None, None];
        }
        let before = core::mem::replace(&mut self.settled, levels);
        match (before.run, levels.run) {
            (false, true) => [Some(Request::Start), Some(target(levels.target))],
            (true, false) => [Some(Request::Stop), None],
            (true, true) => [Some(target(levels.target)), None],
            (false, false) => [None, None],
        }
    }
}

fn target(selection: u8) -> Request {
    match selection {
        1 => Request::Step(Position(0.03)),
        2 => Request::Step(Position(0.015)),
        3 => Request::Move(Position(0.03)),
        _ => Request::Step(Position(0.0)),
    }
}
