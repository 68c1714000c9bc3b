//! Restarts of the board while the machine goes on.

use super::{Rig, Stop};

impl Rig {
    /// Resets the board. It starts with the next period.
    pub fn reset(&mut self) {
        self.detach();
        self.board.reset();
    }

    /// Takes the board's power away and gives it back at once. It starts with the next period.
    pub fn power_cycle(&mut self) {
        self.detach();
        self.board.power_cycle();
    }

    /// The board until the control timer's next update; one that asks for a reset goes on from there.
    ///
    /// * `most`: periods after which the clock ends it, where it may
    pub(super) fn part(&mut self, most: f64) -> Result<(), Stop> {
        let result = self.run(most);
        if result != Err(Stop::ResetRequested) {
            return result;
        }
        self.resets += 1;
        self.reset();
        // One that asks again before its first control period would do so for ever.
        self.run(most)
    }

    /// The log ends here, and so does a frame that is not complete; another log may follow.
    fn detach(&mut self) {
        let Some(rtt) = &mut self.rtt else {
            return;
        };
        self.log.extend(rtt.period(self.log_host, &mut self.board));
        rtt.detach(&mut self.board);
        if self.log.last().is_some_and(|byte| *byte != 0) {
            self.log.push(0);
        }
    }
}
