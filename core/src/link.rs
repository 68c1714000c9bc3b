//! The drive on a wire.
//!
//! ```text
//! bytes --frame--> message --server--> request --Controller::request--> outcome --server--> message --frame--> bytes
//! ```
//!
//! [`server`] is the drive's end; [`image`] is a set of settings as bytes; [`cia402`] has the names of the profile
//! for drives.

pub mod cia402;
pub mod frame;
pub mod image;
pub mod message;
pub mod server;
