//! Linear systems: matrices in, matrices out, by the names of the textbooks.
//!
//! ```text
//! A, B --zoh--> F, G --dare--> X --+--> dlqr (regulator gain)      eigen, margins: what came of it
//!                                  +--> dlqe (Kalman gain)         place: poles instead of weights
//! A, x --product--> A x
//! A, B, C --response--> C (z 1 - A)^-1 B
//! ```
//!
//! Nothing here knows a drive, a file or a unit. What cannot be solved is a
//! [`NoSolution`].

pub mod dare;
pub mod dlqe;
pub mod dlqr;
pub mod eigen;
pub mod margins;
pub mod place;
pub mod product;
pub mod response;
pub mod zoh;

use crate::error::NoSolution;

/// Result of a computation that may have none.
pub type Result<T> = std::result::Result<T, NoSolution>;
