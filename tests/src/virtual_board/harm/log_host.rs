//! The host that takes the log out of the board's memory.

/// How it does that.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LogHost {
    /// Everything, each period.
    #[default]
    Reads,
    /// Nobody is there: nothing is taken, and what does not fit is dropped.
    Absent,
    /// It has told the board to wait until there is room, and takes this many bytes a period.
    Blocks(f64),
}
