//! What the drive says over defmt: the record of every control period, changes of mode, refusals, and a
//! summary each second.
//!
//! A record is logged in its serialised form (postcard), which `host-sim capture` reads with the very type
//! that wrote it.

use crate::settings::LOADS;
use arso_core::{Mode, Refusal, Telemetry, Vibration};

/// Follows the records and logs them.
pub(crate) struct Log {
    vibration: Vibration,
    mode: Mode,
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
            mode: Mode::Idle,
            summary: (1.0 / sample_time) as u32,
            records: 0,
            worst_cycles: 0,
            expected: None,
            lost: 0,
        }
    }

    /// Logs one record and whatever follows from it.
    pub(crate) fn record(&mut self, record: &Telemetry<[f32; LOADS]>) {
        // A record of six loads takes 104 bytes at most.
        let mut buffer = [0; 128];
        if let Ok(bytes) = postcard::to_slice(record, &mut buffer) {
            defmt::debug!("record {=[u8]}", bytes);
        }
        if let Some(expected) = self.expected {
            self.lost = self
                .lost
                .saturating_add(record.period.wrapping_sub(expected));
        }
        self.expected = Some(record.period.wrapping_add(1));
        // Nothing is estimated in any other state.
        if record.mode == Mode::Running {
            self.vibration.update(record);
        }
        self.worst_cycles = self.worst_cycles.max(record.cycles);

        if record.mode != self.mode {
            self.mode = record.mode;
            match record.mode {
                Mode::Idle => defmt::info!("idle"),
                Mode::Commissioning => defmt::info!("commissioning"),
                Mode::Exciting => defmt::info!("exciting"),
                Mode::Ready => defmt::info!("ready"),
                Mode::Running => defmt::info!("running"),
                Mode::Stopping(fault) => {
                    defmt::error!("stopping because of fault {}: {}", fault.number(), fault);
                }
                Mode::Fault(fault) => {
                    defmt::error!(
                        "fault {}: {} in period {}, value {}",
                        fault.number(),
                        fault,
                        record.period,
                        record.fault_value
                    );
                }
            }
        }

        self.records += 1;
        if self.records >= self.summary {
            // Metres, or radians: the core does not know which.
            if record.mode == Mode::Running {
                defmt::info!(
                    "vibration {} rms, SI units, within 5 %",
                    self.vibration.level()
                );
            }
            defmt::info!(
                "at most {} cycles per period, {} records lost",
                self.worst_cycles,
                self.lost,
            );
            self.records = 0;
            self.worst_cycles = 0;
        }
    }

    /// Logs what was asked in vain.
    #[expect(clippy::unused_self, reason = "the log says it")]
    pub(crate) fn refusal(&self, refusal: &Refusal) {
        defmt::warn!(
            "refused: {} ({}), the drive is {}",
            refusal.request,
            refusal.reason,
            refusal.mode
        );
    }
}
