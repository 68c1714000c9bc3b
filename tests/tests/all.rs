//! All tests of the drive but those that keep time: in one binary, so that the long ones of a file run beside those of
//! another.

mod board_amplifier;
mod board_excite;
mod board_faults;
mod board_learning;
mod board_link;
mod board_log;
mod board_loop;
mod board_program;
mod board_rate;
mod board_record;
mod board_restart;
mod board_settings;
mod experiments;
mod false_alarms;
mod generated;
mod homing;
mod learning;
mod move_campaign;
mod planned_moves;
mod reference_agreement;
mod second_opinion;
mod start_up;
mod structure;
