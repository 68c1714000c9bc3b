//! What came of one run.

use serde_json::{Value, json};

/// In a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The load is at its target, no fault.
    Tolerated,
    /// The amplifier was switched off.
    Detected,
    /// Energised, no fault, and the load is not at its target.
    Astray,
    /// As astray, with half of the largest current or more, and nothing ends it.
    LeftEnergised,
    /// Too fast or too far while energised, no fault.
    Runaway,
    /// The run switch was opened, and the amplifier was not switched off in time; or it came on again by
    /// itself.
    Unstoppable,
}

impl Verdict {
    /// All, best first.
    pub const ALL: [Self; 6] = [
        Self::Tolerated,
        Self::Detected,
        Self::Astray,
        Self::LeftEnergised,
        Self::Runaway,
        Self::Unstoppable,
    ];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tolerated => "tolerated",
            Self::Detected => "detected",
            Self::Astray => "astray",
            Self::LeftEnergised => "left energised",
            Self::Runaway => "RUNAWAY",
            Self::Unstoppable => "UNSTOPPABLE",
        }
    }

    /// Whether the drive may not be used.
    #[must_use]
    pub const fn is_danger(self) -> bool {
        matches!(self, Self::Runaway | Self::Unstoppable)
    }
}

/// What came of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// In a word.
    pub verdict: Verdict,
    /// What switched the amplifier off: the drive's fault by name, `halt`, `watchdog`, `reset`.
    pub code: Option<String>,
    /// Periods from the fault until the amplifier was off.
    pub periods: Option<u32>,
    /// Farthest the actuator came from where it was at the fault until then, m.
    pub travel: f64,
    /// Largest force of the motor from the fault on, N.
    pub force: f64,
    /// Largest velocity of the actuator from the fault on while energised, m/s.
    pub velocity: f64,
    /// Farthest the actuator came beyond the range of the motion while energised, m.
    pub beyond: f64,
    /// Periods from opening the run switch until the amplifier was off; nothing if it was off before or
    /// was never.
    pub stop_periods: Option<u32>,
}

impl Outcome {
    /// Whether this is what is wanted: control kept, or current off soon enough.
    #[must_use]
    pub fn meets_goal(&self) -> bool {
        match (self.verdict, self.periods) {
            (Verdict::Tolerated, _) => true,
            (Verdict::Detected, Some(periods)) => {
                periods <= super::GOAL_PERIODS || self.travel <= super::GOAL_TRAVEL
            }
            _ => false,
        }
    }

    /// For other programs.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "verdict": self.verdict.name(),
            "code": self.code,
            "periods_until_off": self.periods,
            "travel": self.travel,
            "largest_force": self.force,
            "largest_velocity": self.velocity,
            "farthest_beyond": self.beyond,
            "periods_from_run_switch_until_off": self.stop_periods,
            "meets_goal": self.meets_goal(),
        })
    }
}
