//! What the drive says over defmt: every control step, changes of state, and a summary each
//! second.

use crate::gains::LOADS;
use arso_core::{State, Telemetry, Vibration};

/// Follows the records and logs them.
pub(crate) struct Log {
    vibration: Vibration,
    state: State,
    /// Records per summary.
    summary: u32,
    records: u32,
    worst_cycles: u32,
    /// Number of the next record, to see what got lost.
    expected: Option<u32>,
    lost: u32,
}

impl Log {
    /// * `sample_time`: s
    pub(crate) fn new(sample_time: f32) -> Self {
        Self {
            vibration: Vibration::new(sample_time),
            state: State::Idle,
            summary: (1.0 / sample_time) as u32,
            records: 0,
            worst_cycles: 0,
            expected: None,
            lost: 0,
        }
    }

    /// Logs one record and whatever follows from it.
    pub(crate) fn record(&mut self, record: &Telemetry<LOADS>) {
        defmt::debug!("{}", record);
        if let Some(expected) = self.expected {
            self.lost = self.lost.saturating_add(record.step.wrapping_sub(expected));
        }
        self.expected = Some(record.step.wrapping_add(1));
        // Nothing is estimated in any other state.
        if record.state == State::Running {
            self.vibration.update(record);
        }
        self.worst_cycles = self.worst_cycles.max(record.cycles);

        if record.state != self.state {
            self.state = record.state;
            match record.state {
                State::Idle => defmt::info!("idle"),
                State::Commissioning => defmt::info!("commissioning"),
                State::Exciting => defmt::info!("exciting"),
                State::Ready => defmt::info!("ready"),
                State::Running => defmt::info!("running"),
                State::Fault(fault) => {
                    defmt::error!(
                        "fault {}: {} in step {}",
                        fault.number(),
                        fault,
                        record.step
                    );
                }
            }
        }

        self.records += 1;
        if self.records >= self.summary {
            // Metres, or radians: the core does not know which.
            if record.state == State::Running {
                defmt::info!(
                    "vibration {} rms, SI units, within 5 %",
                    self.vibration.level()
                );
            }
            defmt::info!(
                "at most {} cycles per step, {} records lost",
                self.worst_cycles,
                self.lost,
            );
            self.records = 0;
            self.worst_cycles = 0;
        }
    }
}
