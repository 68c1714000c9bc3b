//! The paper's chain: an actuator and the masses behind it, as equations.
//!
//! ```text
//! Chain --model--> A, B of eqs. (1), (15)      --load--> A_p, B_p of eq. (16), relative motion
//!       --modes--> frequencies, dampings, shapes
//!       --hamiltonian--> K(t), eqs. (8) to (12) and (14)
//!       --minimum_time--> least time to settle and to rest
//!       --transfer--> currents of a planned move within limits
//! ```
//!
//! Nothing here knows a file, or what a drive is made of.

pub mod hamiltonian;
pub mod load;
pub mod minimum_time;
mod modal;
mod model;
mod modes;
mod rows;
pub mod transfer;

pub use model::{Chain, controlled_mass};
pub use modes::Mode;
