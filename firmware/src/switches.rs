//! The switches of the drive board, debounced, as requests to the drive.
//!
//! | run | excite | target switches | |
//! |---|---|---|---|
//! | off | any | any | stop, within one control period; the zero switch then sets the position to zero |
//! | on | on when run is closed | any | play the excitation once |
//! | on | off | any | first: prove the signs (commissioning), then start |
//! | on | | 0 | planned move to the origin |
//! | on | | 1 | planned move to 30 mm |
//! | on | | 2 | planned move to 15 mm |
//! | on | | 3 | step to 30 mm, the paper's |
//!
//! After a reset nothing is asked until the run switch has been seen open: a drive whose supply or
//! processor failed does not move by itself. The excite switch counts at the moment the run switch is
//! closed; after an excitation the drive stays idle until the run switch has been opened and is closed
//! again.

use crate::board::Levels;
use arso_core::encoder::Encoder;
use arso_core::{Mode, Place, Position, Request};

/// Control periods for which a switch must stand still before it counts.
const DEBOUNCE: u8 = 10;

/// One switch, or what several say together.
#[derive(Default)]
struct Debounced<T> {
    /// Where it stands; unknown after a reset.
    settled: Option<T>,
    candidate: Option<T>,
    periods: u8,
}

/// Stands there.
impl<T: Copy> From<T> for Debounced<T> {
    fn from(level: T) -> Self {
        Self {
            settled: Some(level),
            candidate: Some(level),
            periods: 0,
        }
    }
}

impl<T: Copy + PartialEq> Debounced<T> {
    /// Takes the level of one period; whether where it stands has changed.
    fn sample(&mut self, level: T) -> bool {
        if self.candidate != Some(level) {
            self.candidate = Some(level);
            self.periods = 0;
        }
        self.periods = self.periods.saturating_add(1);
        let changed = self.periods >= DEBOUNCE && self.settled != self.candidate;
        if changed {
            self.settled = self.candidate;
        }
        changed
    }
}

/// The switches, each debounced by itself, so that none can keep the run switch from being seen.
pub(crate) struct Switches {
    encoder: Encoder,
    run: Debounced<bool>,
    excite: Debounced<bool>,
    zero: Debounced<bool>,
    target: Debounced<u8>,
    asked: Asked,
}

/// What has been asked of the drive since the run switch was closed.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Asked {
    /// Nothing, and nothing may be: the run switch has not been open since the reset.
    #[default]
    Locked,
    Nothing,
    Excite,
    Commission,
    Start,
}

impl Switches {
    /// Nothing is known of them.
    ///
    /// * `encoder`: in whose counts targets are asked for
    pub(crate) fn new(encoder: Encoder) -> Self {
        Self {
            encoder,
            run: Debounced::default(),
            excite: Debounced::default(),
            zero: Debounced::default(),
            target: Debounced::default(),
            asked: Asked::default(),
        }
    }

    /// Takes the levels of one period and the drive's mode; gives what is to be asked of it. The run switch
    /// stops the drive by itself, in the control interrupt: here it counts when it is closed.
    pub(crate) fn sample(&mut self, run: bool, levels: Levels, mode: Mode) -> [Option<Request>; 2] {
        if !run && self.run.settled == Some(true) {
            // The drive has stopped; the switch counts as closed when it has been so for a while again.
            self.run = Debounced::from(false);
        }
        self.run.sample(run);
        let retargeted = self.target.sample(levels.target);
        self.excite.sample(levels.excite);
        // One that was closed at the reset has not been closed by anybody.
        let opened = self.zero.settled == Some(false);
        let zeroed = self.zero.sample(levels.zero) && opened;
        match self.run.settled {
            None => return [None, None],
            Some(false) => {
                self.asked = Asked::Nothing;
                return [zeroed.then_some(Request::SetPosition(Place(0))), None];
            }
            Some(true) => {}
        }
        if retargeted && self.asked == Asked::Start {
            return [Some(self.target()), None];
        }
        match (mode, self.asked) {
            (Mode::Idle | Mode::Ready, Asked::Nothing) if self.excite.settled == Some(true) => {
                self.asked = Asked::Excite;
                [Some(Request::Excite), None]
            }
            (Mode::Idle, Asked::Nothing) => {
                self.asked = Asked::Commission;
                [Some(Request::Commission), None]
            }
            (Mode::Ready, Asked::Nothing | Asked::Commission) => {
                self.asked = Asked::Start;
                [Some(Request::Start), Some(self.target())]
            }
            _ => [None, None],
        }
    }

    fn target(&self) -> Request {
        match self.target.settled {
            Some(1) => Request::Move(self.encoder.place(Position(0.03))),
            Some(2) => Request::Move(self.encoder.place(Position(0.015))),
            Some(3) => Request::Step(self.encoder.place(Position(0.03))),
            _ => Request::Move(Place(0)),
        }
    }
}
