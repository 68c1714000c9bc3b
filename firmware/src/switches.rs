//! The switches of the drive board, debounced, as requests to the drive.
//!
//! | run | excite | target switches | |
//! |---|---|---|---|
//! | off | any | any | stop |
//! | on | on when run is closed | any | play the excitation once |
//! | on | off | any | first: prove the signs (commissioning), then start |
//! | on | | 0 | step to the origin |
//! | on | | 1 | step to 30 mm |
//! | on | | 2 | step to 15 mm |
//! | on | | 3 | jerk-limited move to 30 mm |
//!
//! The excite switch counts at the moment the run switch is closed; after an excitation the drive
//! stays idle until the run switch has been opened and is closed again.

use crate::board::Levels;
use crate::excitation::{self, EXCITATION};
use crate::gains::GAINS;
use arso_core::{Position, Request, State};

const _: () = assert!(
    excitation::SAMPLE_TIME == GAINS.sample_time,
    "excitation and gains are made for different control periods"
);

/// Control periods for which the switches must agree before they count.
const DEBOUNCE: u8 = 10;

/// Debouncing state; starts as if everything were off.
#[derive(Default)]
pub(crate) struct Switches {
    settled: Levels,
    candidate: Levels,
    periods: u8,
    asked: Asked,
}

/// What has been asked of the drive since the run switch was closed.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Asked {
    #[default]
    Nothing,
    Excite,
    Commission,
    Start,
}

impl Switches {
    /// Takes the levels of one period and the drive's state; gives what is to be asked of it.
    pub(crate) fn sample(&mut self, levels: Levels, state: State) -> [Option<Request>; 2] {
        if levels != self.candidate {
            self.candidate = levels;
            self.periods = 0;
        }
        self.periods = self.periods.saturating_add(1);
        if self.periods >= DEBOUNCE && self.settled != levels {
            let before = core::mem::replace(&mut self.settled, levels);
            if before.run && !levels.run {
                self.asked = Asked::Nothing;
                return [Some(Request::Stop), None];
            }
            if before.target != levels.target && self.asked == Asked::Start {
                return [Some(target(levels.target)), None];
            }
        }
        if !self.settled.run {
            return [None, None];
        }
        match (state, self.asked) {
            (State::Idle | State::Ready, Asked::Nothing) if self.settled.excite => {
                self.asked = Asked::Excite;
                [Some(Request::Excite(EXCITATION)), None]
            }
            (State::Idle, Asked::Nothing) => {
                self.asked = Asked::Commission;
                [Some(Request::Commission), None]
            }
            (State::Ready, Asked::Nothing | Asked::Commission) => {
                self.asked = Asked::Start;
                [Some(Request::Start), Some(target(self.settled.target))]
            }
            _ => [None, None],
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
