//! The command, run as its users run it.

mod commands;
mod common;
mod resume;
mod sample;
