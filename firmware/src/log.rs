//! What the drive says over defmt: which drive it is, the record of every control period, changes of mode,
//! refusals, and a summary each second.
//!
//! Records and the drive's identity are logged in their serialised form (postcard) with a checksum, which
//! `host-sim capture` reads with the very types that wrote them. The identity is repeated with each summary,
//! for who listens late.

use crate::settings::LOADS;
use arso_core::link::frame::CHECKSUM;
use arso_core::link::message::Source;
use arso_core::{Identity, Mode, Refusal, Telemetry, Vibration};

/// Follows the records and logs them.
pub(crate) struct Log {
    identity: Identity<'static>,
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
    /// Says which drive this is.
    pub(crate) fn new(identity: Identity<'static>, source: Source) -> Self {
        let sample_time = identity.sample_time;
        match source {
            Source::Kept(serial) => defmt::info!("settings: kept in flash, set {}", serial),
            Source::Fallback => {
                defmt::warn!("settings: compiled in, for those in flash cannot be run");
            }
            Source::CompiledIn | Source::Changed => defmt::info!("settings: compiled in"),
        }
        // `capture` takes these words for a start of the drive.
        defmt::info!("drive ready: {}", Shown(&identity));
        Self {
            identity,
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
        if let Ok(bytes) = postcard::to_slice_crc32(record, &mut buffer, CHECKSUM.digest()) {
            defmt::debug!("record {=[u8]}", bytes);
        }
        if let Some(expected) = self.expected {
            self.lost = self
                .lost
                .saturating_add(record.period.wrapping_sub(expected));
        }
        self.expected = Some(record.period.wrapping_add(1));
        // Nothing is estimated while the loop is open.
        if record.mode.closed_loop() {
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
                Mode::Storing => {
                    defmt::info!("storing settings: the processor stands still at times");
                }
                Mode::Running if record.position_set => defmt::info!("running"),
                Mode::Running => {
                    defmt::info!(
                        "running; positions count from where the drive stood at its reset"
                    );
                }
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
            if record.mode.closed_loop() {
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
            defmt::info!("drive: {}", Shown(&self.identity));
            self.records = 0;
            self.worst_cycles = 0;
        }
    }

    /// Vibration of the load, rms, m.
    pub(crate) fn vibration(&self) -> f32 {
        self.vibration.level()
    }

    /// The drive goes on with other settings.
    ///
    /// * `fingerprint`: of them
    pub(crate) fn changed(&mut self, fingerprint: u32) {
        self.identity.fingerprint = fingerprint;
        defmt::info!("settings: changed while running, kept nowhere");
        defmt::info!("drive: {}", Shown(&self.identity));
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

/// An identity for people, followed by its serialised form.
struct Shown<'a>(&'a Identity<'a>);

impl defmt::Format for Shown<'_> {
    fn format(&self, f: defmt::Formatter<'_>) {
        let mut buffer = [0; 32];
        let bytes = postcard::to_slice_crc32(self.0, &mut buffer, CHECKSUM.digest());
        defmt::write!(
            f,
            "{} loads, {}, period {} s, fingerprint {:08x}, identity {=[u8]}",
            self.0.loads,
            self.0.kind,
            self.0.sample_time,
            self.0.fingerprint,
            bytes.unwrap_or_default()
        );
    }
}
