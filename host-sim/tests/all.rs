//! The tests of the program, but for those of the link, which keep time: in one binary, so that the long ones of a file
//! run beside those of another.

mod common;

mod bound;
mod capture;
mod cli;
mod commands;
mod design;
mod excite;
mod identify;
mod learn;
mod misleading;
mod moves;
mod record;
mod simulate_move;
mod streamed_figures;
mod sweep;
mod tune;
