//! The command, run as its users run it.

mod commands;
mod common;
mod out_of_core;
mod resume;
mod sample;
