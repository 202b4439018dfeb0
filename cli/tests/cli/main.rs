//! The command, run as its users run it.

mod commands;
mod common;
mod larger_than_memory;
mod out_of_core;
mod resume;
mod sample;
