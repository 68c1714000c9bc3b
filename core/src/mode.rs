//! What the drive is doing.
//!
//! ```text
//! Idle --Commission--> Commissioning --signs proven--> Ready --Start--> Running --Stop--> Ready
//! Idle, Ready --Excite--> Exciting --all played, Stop--> Idle
//! any mode --fault--> Fault --Stop--> Idle
//! Running --fault that leaves the loop trustworthy--> Stopping --at rest--> Fault
//! Idle, Ready, Fault --Store--> Storing, which the processor's reset alone ends
//! ```
//!
//! Current flows in `Commissioning`, `Exciting`, `Running` and `Stopping` alone. The loop is never closed before
//! the signs of encoder and current have been proven since the last reset, excitation or fault.
//! [`Mode::next`] is the whole of that table; what a mode remembers is the controller's.

use crate::fault::Fault;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// What the drive is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// No current; the encoder is read. The signs are not proven.
    #[default]
    Idle,
    /// The signs are being proven.
    Commissioning,
    /// A current profile is played in open loop.
    Exciting,
    /// No current; the loop may be closed.
    Ready,
    /// The loop is closed.
    Running,
    /// The loop brakes the machine to a stand because of a fault.
    Stopping(Fault),
    /// No current, until `Stop` acknowledges the fault.
    Fault(Fault),
    /// No current, until the reset: settings are being written, and the processor may stand still meanwhile.
    Storing,
}

impl Mode {
    /// Whether current may flow.
    #[must_use]
    pub const fn energised(self) -> bool {
        matches!(
            self,
            Self::Commissioning | Self::Exciting | Self::Running | Self::Stopping(_)
        )
    }

    /// Whether the loop is closed: loads are estimated and a reference is followed.
    #[must_use]
    pub const fn closed_loop(self) -> bool {
        matches!(self, Self::Running | Self::Stopping(_))
    }

    /// The fault that it is about.
    #[must_use]
    pub const fn fault(self) -> Option<Fault> {
        match self {
            Self::Stopping(fault) | Self::Fault(fault) => Some(fault),
            _ => None,
        }
    }

    /// The mode that follows when this one has done what it is there for.
    #[must_use]
    pub(crate) const fn completed(self) -> Self {
        match self {
            Self::Commissioning => Self::Ready,
            // What it did to the machine is not known: as after a reset.
            Self::Exciting => Self::Idle,
            Self::Stopping(fault) => Self::Fault(fault),
            other => other,
        }
    }
}
